"""`hypermap merge`: make one map of several maps of one floor."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.onto import is_same_file
from hypermap.cli.options import AsJson, ForceMap, MapOutput, MapPath, check_map_output, name_of
from hypermap.cli.progress import working
from hypermap.cli.saving import replace_from
from hypermap.cli.terminal import note, say, say_json
from hypermap.cli.two_maps import InitialPose, SameFrame, pose_on
from hypermap.core.errors import FrameError, HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.core.frames import Pose2D
    from hypermap.core.hypermap import Hypermap
    from hypermap.mapping.merging import Merged

COMMAND_CLASS = PointsCommand


def command(
    path: MapPath,
    others: Annotated[
        list[Path],
        typer.Argument(
            metavar="OTHER...",
            readable=False,
            show_default=False,
            help="Maps of other days, or of other robots.",
        ),
    ],
    output: MapOutput,
    initial: InitialPose = None,
    same_frame: SameFrame = False,
    as_json: AsJson = False,
    force: ForceMap = False,
) -> None:
    """Merge maps of one floor: their objects, by the evidence for them, and their occupancy.

    All maps must be made by `hypermap map` or `live`, with the same configuration, from different
    recordings. Each OTHER is aligned to MAP by walls and objects, unless `hypermap align -o` has
    done that. Objects in several maps become one, with its id in MAP. The frames that the maps keep
    are mapped again in the order of time, without images, so that the later drive decides what has
    moved or is gone. Edits made by hand stay; if two maps differ, those of MAP win. All other
    layers are kept. `hypermap map --onto OUT` can continue the result.

    Examples:
        hypermap merge monday.hmap tuesday.hmap -o week.hmap
        hypermap merge robot1.hmap robot2.hmap robot3.hmap -o floor.hmap
        hypermap merge monday.hmap tuesday.hmap --initial 2,-1,90 -o week.hmap
    """
    from hypermap.formats import open_map
    from hypermap.questions.asking import parse_pose

    if initial is not None and (same_frame or len(others) > 1):
        raise HypermapError(
            "--initial is for one OTHER, and not with --same-frame; use `hypermap align` first"
        )
    check_map_output(output, force or is_same_file(output, path))
    about = None if initial is None else parse_pose(initial, "--initial")
    hypermap = open_map(path)
    rows = []
    for other in others:
        second = open_map(other)
        pose = pose_on(hypermap, second, about, same_frame, other)
        merged = _merged(hypermap, second, pose, path, other)
        hypermap = merged.hypermap
        rows.append(_described(merged, pose, other))
    backup = replace_from(hypermap, path, output)  # first: nobody may read what is printed
    if as_json:
        say_json({"maps": rows, "objects": len(hypermap.objects())})
    else:
        for row in rows:
            _show(row)
    if backup is not None:
        note(f"the previous map is kept as {backup}")
    note(f"saved {output}")


def _merged(first: Hypermap, second: Hypermap, pose: Pose2D, path: Path, other: Path) -> Merged:
    from hypermap.mapping.merging import CannotMerge, merge_maps

    names = name_of(path), name_of(other)
    try:
        with working(f"merging {names[1]}"):
            return merge_maps(first, second, pose, names)
    except (CannotMerge, FrameError) as error:
        raise type(error)(f"{' and '.join(names)}: {error}") from None


def _described(merged: Merged, pose: Pose2D, other: Path) -> dict[str, Any]:
    return {
        "map": name_of(other),
        "x": pose.x,
        "y": pose.y,
        "yaw": pose.yaw,
        "both": merged.both,
        "first": merged.first,
        "second": merged.second,
        "gone": merged.gone,
        "left_out": merged.left_out,
        "deleted": [{"id": number, "name": name} for number, name in merged.deleted.items()],
        "conflicts": list(merged.conflicts),
        "renamed": merged.renamed,
        "settings": list(merged.settings),
    }


def _show(row: dict[str, Any]) -> None:
    name = row["map"]
    yaw_deg = math.degrees(row["yaw"])
    say(f"{name}: x {row['x']:.3f} m, y {row['y']:.3f} m, yaw {yaw_deg:.2f} degrees")
    left_out = f"; {row['left_out']} of {name} left out" if row["left_out"] else ""
    say(
        f"  {counted(row['both'], 'object')} in both, {row['first']} only before, "
        f"{row['second']} new, {row['gone']} gone{left_out}"
    )
    if settings := row["settings"]:
        note(
            f"{name} was made with other defaults, by another version; the result has "
            f"those of the first map ({'; '.join(settings)})"
        )
    if deleted := row["deleted"]:
        listed = ", ".join(f"{one['name']} {one['id']}" for one in deleted)
        count = counted(len(deleted), "object")
        note(f"left out, because deleted by hand in one of the maps: {count} ({listed})")
    for number in row["conflicts"]:
        note(f"object {number} was edited by hand in both maps: the edits of the first one stay")
    for old, new in row["renamed"].items():
        note(f"the layer {old!r} of {name} is called {new!r} in the result")
