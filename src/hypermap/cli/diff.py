"""`hypermap diff`: what changed from one map to another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.change_rows import counts_of, described, distance_of, named, place_of
from hypermap.cli.options import AsJson, MapPath, OnlyNames, check_picture, name_of, title_of
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.cli.two_maps import ComparisonPicture, SameFrame, pose_on
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.evaluation import Changes


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
            help="Minimum distance of a move; an object nearer to its old place has not moved.",
        ),
    ] = 0.3,
    names: OnlyNames = None,
    same_frame: SameFrame = False,
    picture: ComparisonPicture = None,
    as_json: AsJson = False,
) -> None:
    """Show what changed from MAP to OTHER: added, gone, moved, reshaped or renamed objects.

    Two maps of one drive and its continuation are compared as they are. Other maps are aligned by
    walls and objects first. Objects in a place that only one of the maps shows are "first seen" or
    "not revisited". For "moved", the output says how likely the two are the same object, because
    several equal chairs may have been swapped.

    Examples:
        hypermap diff monday.hmap tuesday.hmap
        hypermap diff monday.hmap tuesday.hmap --picture changes.png
        hypermap diff monday.hmap tuesday.hmap --name chair --min-moved 0.5 --json
    """
    from hypermap.core.frames import Pose2D
    from hypermap.core.history import MAP_ID
    from hypermap.evaluation import (
        are_of_one_map,
        changes_between,
        knowledge_of,
        objects_in_frame,
    )
    from hypermap.formats import open_map
    from hypermap.viewer.changes import render_changes
    from hypermap.viewer.picture import check_suffix

    if picture is not None:
        check_suffix(picture)
        check_picture(picture)
    first, second = open_map(path), open_map(other)
    pose = pose_on(first, second, None, same_frame, other)
    before = objects_in_frame(first, name_of(path), first.base_frame, Pose2D())
    after = objects_in_frame(second, name_of(other), first.base_frame, pose)
    known = first.metadata.get(MAP_ID)
    is_one = known is not None and second.metadata.get(MAP_ID) == known
    changes = changes_between(
        before,
        after,
        min_moved=min_moved,
        is_known=(knowledge_of(first, Pose2D()), knowledge_of(second, pose.inverse())),
        same_ids=is_one and are_of_one_map(before, after),
        names=names,
    )
    if picture is not None:
        title = f"{title_of(path)} to {title_of(other)}"
        render_changes(first, changes, picture, title=title)
    if as_json:
        rows = [described(change) for change in changes.changes]
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
                named(change),
                place_of(change.before),
                place_of(change.after),
                distance_of(change),
            )
        out().print(rows)
    unchanged = f"{counted(changes.unchanged, 'object')} unchanged"
    say(", ".join(filter(None, [counts_of(changes.changes), unchanged])))
