"""`hypermap diff`: what changed from one map to another."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.options import AsJson, MapPath, check_picture
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.cli.two_maps import SameFrame, pose_on
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.core.semantic import SemanticObject
    from hypermap.evaluation import Change, Changes


def command(
    path: MapPath,
    other: Annotated[
        Path,
        typer.Argument(
            metavar="OTHER", readable=False, show_default=False, help="A later map of the place."
        ),
    ],
    min_moved: Annotated[
        float,
        typer.Option(
            "--min-moved",
            metavar="METERS",
            min=0,
            help="An object that is nearer to its old place has not moved.",
        ),
    ] = 0.3,
    names: Annotated[
        list[str] | None,
        typer.Option(
            "--name", metavar="NAME", help="Only objects with this name: may be repeated."
        ),
    ] = None,
    same_frame: SameFrame = False,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="Draw both maps on top of each other, with matches or changes: .png or .svg.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show what changed from MAP to OTHER: added, gone, moved, reshaped or renamed objects.

    Two maps of one drive and its continuation are compared as they are. Other maps are aligned by
    walls and objects first. If only one of the maps knows a place, its objects are first seen or
    not revisited. "moved" says how likely the two are the same object: of equal chairs, any may
    have gone anywhere.

    Examples:
        hypermap diff monday.hmap tuesday.hmap
        hypermap diff monday.hmap tuesday.hmap --picture changes.png
        hypermap diff monday.hmap tuesday.hmap --name chair --min-moved 0.5 --json
    """
    from hypermap.core.frames import Pose2D
    from hypermap.evaluation import changes_between, knowledge_of, objects_in_frame
    from hypermap.formats import open_map
    from hypermap.formats.backup import MAP_ID
    from hypermap.viewer.changes import render_changes
    from hypermap.viewer.picture import check_suffix

    if picture is not None:
        check_suffix(picture)
        check_picture(picture)
    first, second = open_map(path), open_map(other)
    pose = pose_on(first, second, None, same_frame, other)
    known = first.metadata.get(MAP_ID)
    changes = changes_between(
        objects_in_frame(first, str(path), first.base_frame, Pose2D()),
        objects_in_frame(second, str(other), first.base_frame, pose),
        min_moved=min_moved,
        is_known=(knowledge_of(first, Pose2D()), knowledge_of(second, pose.inverse())),
        same_ids=known is not None and second.metadata.get(MAP_ID) == known,
        names=names,
    )
    if picture is not None:
        render_changes(first, changes, picture, title=f"{path.stem} to {other.stem}")
    if as_json:
        rows = [_described(change) for change in changes.changes]
        say_json({"frame_id": first.base_frame, "changes": rows, "unchanged": changes.unchanged})
    else:
        _show(changes)
    if picture is not None:
        note(f"saved {picture}")


def _show(changes: Changes) -> None:
    if changes.changes:
        rows = table("change", "object", "before", "now", "distance", right=("distance",))
        for change in changes.changes:
            rows.add_row(
                change.kind,
                _named(change),
                _place(change.before),
                _place(change.after),
                _distance(change),
            )
        out().print(rows)
    counts = Counter(change.kind for change in changes.changes)
    words = [f"{count} {kind}" for kind, count in counts.items()]
    say(", ".join([*words, f"{counted(changes.unchanged, 'object')} unchanged"]))


def _named(change: Change) -> str:
    names = dict.fromkeys(one.name for one in (change.before, change.after) if one is not None)
    name = printable(" → ".join(names), 80)
    return name if change.layer == "semantic" else f"{name} ({printable(change.layer, 40)})"


def _place(thing: SemanticObject | None) -> str:
    if thing is None:
        return "-"
    center = thing.footprint.centroid
    return f"{center.x:.2f}, {center.y:.2f}"


def _distance(change: Change) -> str:
    if change.kind != "moved" or change.distance is None or change.confidence is None:
        return ""
    return f"{change.distance:.2f} m ({change.confidence:.0%})"


def _described(change: Change) -> dict[str, Any]:
    row: dict[str, Any] = {"change": change.kind, "layer": change.layer}
    for when, thing in (("before", change.before), ("after", change.after)):
        if thing is not None:
            center = thing.footprint.centroid
            row[when] = {"id": thing.id, "name": thing.name, "x": center.x, "y": center.y}
    values = {"distance": change.distance, "confidence": change.confidence}
    return row | {key: value for key, value in values.items() if value is not None}
