"""How one map is aligned with another, for commands that take two."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import name_of
from hypermap.cli.progress import working

if TYPE_CHECKING:
    from hypermap.core.frames import Pose2D
    from hypermap.core.hypermap import Hypermap

SameFrame = Annotated[
    bool, typer.Option("--same-frame", help="Do not align: all maps are in the frame of MAP.")
]

InitialPose = Annotated[
    str | None,
    typer.Option(
        "--initial",
        metavar="X,Y,YAW",
        show_default="anywhere",
        help="Approximate pose of OTHER's origin on MAP, in meters and degrees.",
    ),
]
ComparisonPicture = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        show_default=False,
        help="Draw the result: both maps on top of each other, as .png or .svg.",
    ),
]


def pose_on(
    first: Hypermap, second: Hypermap, about: Pose2D | None, same_frame: bool, name: Path
) -> Pose2D:
    """Return the pose of the second map's base frame in that of the first.

    A map and its continuation are in one frame. `hypermap align -o` leaves the pose in the map.
    Otherwise the maps are aligned now.

    Args:
        first: a map.
        second: another map of the place.
        about: where it is about; None for anywhere.
        same_frame: whether both are in one frame.
        name: the second map in messages.

    Raises:
        NotAligned: If they do not fit together.
    """
    from hypermap.alignment import NotAligned, align
    from hypermap.core.frames import Pose2D
    from hypermap.core.history import MAP_ID
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.formats.backup import ALIGNED_TO

    known = first.metadata.get(MAP_ID)
    is_one = known is not None and second.metadata.get(MAP_ID) == known
    if same_frame or (is_one and second.base_frame == first.base_frame):
        return Pose2D()
    if about is None and known is not None and second.metadata.get(ALIGNED_TO) == known:
        return second.frames.lookup(first.base_frame, second.base_frame)
    if not all(any(isinstance(one, OccupancyLayer) for one in m) for m in (first, second)):
        raise NotAligned(
            f"{name_of(name)}: maps are aligned by walls, and one of the two has no occupancy "
            "layer; if both are in one frame, give --same-frame"
        )
    try:
        with working(f"aligning {name_of(name)}"):
            return align(first, second, initial=about).a_T_b
    except NotAligned as error:
        raise NotAligned(f"{name_of(name)}: {error}; --same-frame skips this") from None
