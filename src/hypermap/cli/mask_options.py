"""Keepout and speed masks of `hypermap convert`: what to mark, and in which files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import check_output
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError, did_you_mean

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.masks import Zone

PANEL = "A mask for nav2's costmap filters, in place of the map"

KEEPOUT_METAVAR = '"CLASS MARGIN"'
KEEPOUT_HELP = "Keep out of these objects and a margin around them, in meters: may be repeated."
Keepout = Annotated[
    list[str] | None,
    typer.Option(metavar=KEEPOUT_METAVAR, rich_help_panel=PANEL, help=KEEPOUT_HELP),
]
Speed = Annotated[
    list[str] | None,
    typer.Option(
        metavar='"CLASS MARGIN LIMIT"',
        rich_help_panel=PANEL,
        help='Limit the speed near these objects, as "plant 0.5 50%" or "plant 0.5 '
        '0.3m/s": may be repeated.',
    ),
]
MaskResolution = Annotated[
    float | None,
    typer.Option(
        metavar="METERS",
        show_default="the grid of the first occupancy layer",
        rich_help_panel=PANEL,
        help="Cell size of a separate grid around the zones.",
    ),
]


def save_mask(
    hypermap: Hypermap,
    target: Path,
    keepout: list[str],
    speed: list[str],
    resolution: float | None,
    force: bool,
) -> None:
    """Save a mask as NAME.yaml, NAME.pgm and NAME_params.yaml.

    Raises:
        HypermapError: If not one mask is asked for, or it cannot be drawn or saved.
    """
    from hypermap.formats.atomic import write_files
    from hypermap.ros.server.mask_files import mask_files
    from hypermap.ros.server.zones import draw, keepout_filter, speed_filter

    if bool(keepout) == bool(speed):
        wrong = "one file holds one mask" if keepout else "--mask-resolution is about a mask"
        raise HypermapError(f"{wrong}; give either --keepout or --speed")
    if target.suffix not in (".yaml", ".pgm"):
        raise HypermapError(f"{target}: a mask is saved as .yaml, with its picture next to it")
    wanted = keepout_filter(keepout) if keepout else speed_filter(speed)
    try:
        mask = draw(hypermap, wanted, resolution)
    except ValueError as error:
        raise HypermapError(f"--mask-resolution: {error}") from None
    files = mask_files(mask, wanted, target.with_suffix(".yaml"))
    for name in files:
        check_output(target.parent / name, force)
    write_files(target.parent, files)
    note_strangers([hypermap], wanted.zones)
    note(f"{', '.join(files)}: what nav2 loads; the frame is {mask.frame_id!r}")


def note_strangers(hypermaps: Iterable[Hypermap], zones: Iterable[Zone]) -> None:
    """Name the classes of zones of which no map has an object; they may be misspelled."""
    from hypermap.core.semantic import SemanticLayer

    layers = [layer for each in hypermaps for layer in each if isinstance(layer, SemanticLayer)]
    known = sorted({str(name) for layer in layers for name in layer.table.names_in_use})
    for zone in zones:
        if zone.name not in known:
            note(f"no object is called {zone.name!r}; {did_you_mean(zone.name, known)}")
