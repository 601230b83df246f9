"""Options for the size of a robot and where it may drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.mask_options import KEEPOUT_HELP, KEEPOUT_METAVAR
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.paths import PathSettings

RobotRadius = Annotated[
    float | None,
    typer.Option(
        "--robot-radius",
        metavar="METERS",
        min=0,
        show_default=False,
        help="Radius of the robot.",
    ),
]
InflationRadius = Annotated[
    float | None,
    typer.Option(
        "--inflation-radius",
        metavar="METERS",
        show_default=False,
        help="Prefer paths at least this far from walls, like Nav2; 0: the shortest path.",
    ),
]
Keepout = Annotated[list[str] | None, typer.Option(metavar=KEEPOUT_METAVAR, help=KEEPOUT_HELP)]
ThroughUnknown = Annotated[
    bool, typer.Option("--through-unknown", help="Treat unknown cells as free.")
]
OccupancyName = Annotated[
    str | None,
    typer.Option(
        "--occupancy",
        metavar="NAME",
        show_default="the only one",
        help="Name of the occupancy layer.",
    ),
]


def path_settings(
    robot_radius: float | None,
    inflation_radius: float | None = None,
    cost_scaling: float | None = None,
    through_unknown: bool = False,
) -> PathSettings:
    """Return the path settings of the options; None stands for an option that was not given.

    Raises:
        HypermapError: If one is negative or not finite; it names the option.
    """
    from hypermap.paths.settings import PathSettings

    scaling = PathSettings.cost_scaling if cost_scaling is None else cost_scaling
    try:
        return PathSettings(robot_radius or 0.0, inflation_radius or 0.0, scaling, through_unknown)
    except ValueError as error:
        name, _, rest = str(error).partition(" ")
        raise HypermapError(f"--{name.replace('_', '-')} {rest}") from None
