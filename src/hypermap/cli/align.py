"""`hypermap align`: find how one map lies on another."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.options import AsJson, Force, MapPath, OptionalMapOutput, check_new_map, name_of
from hypermap.cli.progress import working
from hypermap.cli.saving import replace_from
from hypermap.cli.terminal import note, say, say_json
from hypermap.cli.two_maps import InitialPose
from hypermap.text import counted, decimal

if TYPE_CHECKING:
    from hypermap.alignment import Alignment, Bend

COMMAND_CLASS = PointsCommand


def command(
    path: MapPath,
    other: Annotated[
        Path,
        typer.Argument(
            metavar="OTHER",
            readable=False,
            show_default=False,
            help="The map of another day, or of another robot.",
        ),
    ],
    output: OptionalMapOutput = None,
    initial: InitialPose = None,
    new_frame: Annotated[
        str | None,
        typer.Option(
            "--new-frame",
            metavar="NAME",
            show_default="with a number",
            help="Name of OTHER's frame in OUT, if both maps use the same name.",
        ),
    ] = None,
    local: Annotated[
        bool,
        typer.Option(
            "--local",
            help="OTHER is bent, as by poses that drifted: find a shift for each place, and save "
            "its objects, zones, notes and values on the occupancy layer of MAP.",
        ),
    ] = False,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Align OTHER to MAP, by walls and objects.

    The maps must show the same floor and overlap. This prints the pose of OTHER's origin on MAP.
    With -o, it saves OTHER with this transform, so that you can query it in the frame of MAP. If
    no pose matches, or several do, it says so and saves nothing.

    --local moves the layers of a bent map onto a better occupancy map. Mapping cannot continue the
    result.

    Examples:
        hypermap align monday.hmap tuesday.hmap
        hypermap align monday.hmap tuesday.hmap -o tuesday-aligned.hmap
        hypermap align monday.hmap tuesday.hmap --initial 2,-1,90
        hypermap align laser.hmap office.hmap --local -o office-on-laser.hmap
    """
    from hypermap.alignment import align, bend_of, in_frame_of
    from hypermap.core.errors import HypermapError
    from hypermap.core.history import MAP_ID
    from hypermap.formats import open_map
    from hypermap.formats.backup import ALIGNED_TO
    from hypermap.mapping.bent_map import bent_onto
    from hypermap.questions.asking import parse_pose

    if output is not None:
        check_new_map(output, force)
    elif new_frame is not None or force or local:
        raise HypermapError("--new-frame, --local and --force need -o OUT")
    if local and new_frame is not None:
        raise HypermapError("--new-frame: the result of --local is in the frame of MAP")
    about = None if initial is None else parse_pose(initial, "--initial")
    first, second = open_map(path), open_map(other)
    with working(f"aligning {name_of(other)}"):
        found = align(first, second, initial=about, is_bent=local)
        pose = found.a_T_b
        bend = bend_of(first, second, pose) if local else None
    backup = None
    if output is not None:
        if bend is not None:
            moved = bent_onto(first, second, pose, bend)
        else:
            moved = in_frame_of(first, second, pose, new_frame)
            if MAP_ID in first.metadata:
                moved.metadata[ALIGNED_TO] = first.metadata[MAP_ID]
        backup = replace_from(moved, other, output)
    _tell(found, bend, first.base_frame, as_json)
    if backup is not None:
        note(f"the previous map is kept as {backup}")
    if bend is not None:
        note(f"saved {output}")
    elif output is not None:
        note(f"saved {output}; its frame {moved.base_frame!r} lies in {first.base_frame!r}")


def _tell(found: Alignment, bend: Bend | None, frame_id: str, as_json: bool) -> None:
    pose = found.a_T_b
    if as_json:
        document = {"x": pose.x, "y": pose.y, "yaw": pose.yaw, "frame_id": frame_id}
        document |= {"agreement": found.agreement, "overlap": found.overlap}
        if bend is not None:
            document |= {"agreement_bent": bend.after, "largest_shift": bend.largest}
        say_json({**document, "objects": found.objects, "certainty": found.certainty})
    else:
        x, y, yaw = decimal(pose.x, 3), decimal(pose.y, 3), decimal(math.degrees(pose.yaw))
        say(f"x {x} m, y {y} m, yaw {yaw} degrees")
        say(
            f"{found.agreement:.0%} of the walls agree, {found.overlap:.0%} of the smaller map "
            f"overlap, {counted(found.objects, 'object')} fit; the next best place fits "
            f"{found.certainty:.0%} worse"
        )
        if bend is not None:
            say(
                f"bent by up to {bend.largest:.2f} m: {bend.after:.0%} of the borders of walls "
                f"agree, {bend.before:.0%} before"
            )
