"""Questions to grids: which cells an area covers, and where a value occurs.

A cell belongs to an area if the area covers its center. rasterio, shapely and scikit-image are
asked for the same mask, of the part of the grid around the area, which is all that we return; the
areas' corners lie on no cell's center, where their rules would differ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, Window
from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
from suite.race import (
    Disagreement,
    Figure,
    Growth,
    Race,
    Row,
    Settings,
    each_of,
    library,
    race,
    seconds_of,
)

SIDE, RESOLUTION = 2000, 0.05  # cells, meters
LIKE_RASTERIO, LIKE_SHAPELY = 3.0, 100.0  # the ratios asked
CELLS = 100_000_000
GIGABYTE = 1e9
_SPARSE = 0.02  # share of occupied cells, as in maps of buildings

Mask = NDArray[np.bool_]


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the rows of areas and values on grids."""
    yield from each_of(
        settings,
        {
            "areas, rasterio": partial(_fills, "rasterio"),
            "areas, shapely": partial(_fills, "shapely"),
            "areas, scikit-image": partial(_fills, "scikit-image"),
            "large grids": _large,
            "growth with cells": _growth,
        },
    )


def shapes() -> dict[str, BaseGeometry]:
    """Return areas over a grid of 100 m x 100 m, whose corners lie on no center of a cell."""
    turns = np.arange(40) * np.pi / 20
    radii = np.where(np.arange(40) % 2, 45.0, 20.0)
    star = np.column_stack([50.013 + radii * np.cos(turns), 50.017 + radii * np.sin(turns)])
    ring = shapely.Point(50.011, 50.007).buffer(45, 64) - shapely.Point(48.013, 51.009).buffer(20)
    return {
        "a box": shapely.box(0.001, 0.001, 99.999, 99.999),
        "a star of 40 corners": shapely.Polygon(star),
        "a ring of 320 corners": ring,
    }


# Areas


def _fills(peer: str, settings: Settings) -> Iterator[Race]:
    fill, version, asked = _peer(peer)
    grid = GridGeometry(SIDE, SIDE, RESOLUTION)
    for name, area in shapes().items():
        part = grid.window_in(area)
        _check_part(grid, part, area)
        height, width = part.inside.shape
        work = f"the mask of {name} on {width} x {height} cells"
        ours, theirs = partial(_inside, grid, area), partial(fill, area, part)
        yield race(work, version, ours, theirs, same_mask, settings, asked)


def _inside(grid: GridGeometry, area: BaseGeometry) -> Mask:
    return grid.window_in(area).inside


def _check_part(grid: GridGeometry, part: Window, area: BaseGeometry) -> None:
    """Make sure that no cell of an area lies beyond the part that we return.

    Raises:
        Disagreement: If its bounds tell of others.
    """
    rows, cols = part.slices
    corners = grid.centers([rows.start, rows.stop - 1], [cols.start, cols.stop - 1])
    gaps = np.abs(corners.ravel() - shapely.bounds(area))
    if (gaps > RESOLUTION).any():
        raise Disagreement(f"the part ends {gaps.max()} m from the area's bounds")


def _peer(name: str) -> tuple[Callable[[BaseGeometry, Window], Mask], str, float]:
    """Return how a peer makes the mask, its name with its version, and the ratio asked."""
    if name == "rasterio":
        rasterio, features = library("rasterio"), library("rasterio.features")

        def by_rasterio(area: BaseGeometry, part: Window) -> Mask:
            # Row 0 at the bottom, as in ours.
            lower_left = rasterio.Affine.translation(part.col * RESOLUTION, part.row * RESOLUTION)
            transform = lower_left * rasterio.Affine.scale(RESOLUTION)
            shape = part.inside.shape
            return np.asarray(features.geometry_mask([area], shape, transform, invert=True))

        return by_rasterio, f"rasterio {rasterio.__version__}", LIKE_RASTERIO
    if name == "shapely":

        def by_shapely(area: BaseGeometry, part: Window) -> Mask:
            shapely.prepare(area)
            height, width = part.inside.shape
            x = (part.col + np.arange(width) + 0.5) * RESOLUTION
            y = (part.row + np.arange(height) + 0.5) * RESOLUTION
            return np.asarray(shapely.contains_xy(area, *np.meshgrid(x, y)))

        return by_shapely, f"shapely {shapely.__version__}", LIKE_SHAPELY
    skimage, draw = library("skimage"), library("skimage.draw")

    def by_skimage(area: BaseGeometry, part: Window) -> Mask:
        outside, *holes = shapely.get_rings(area)
        mask = _rows_and_columns(draw, outside, part)
        for hole in holes:
            mask &= ~_rows_and_columns(draw, hole, part)
        return mask

    return by_skimage, f"scikit-image {skimage.__version__}", LIKE_SHAPELY


def _rows_and_columns(draw: Any, ring: BaseGeometry, part: Window) -> Mask:
    corners = shapely.get_coordinates(ring)[:, ::-1] / RESOLUTION - 0.5 - (part.row, part.col)
    return np.asarray(draw.polygon2mask(part.inside.shape, corners))


def same_mask(ours: Mask, theirs: Mask) -> str:
    """Say that two masks are the same.

    Raises:
        Disagreement: If they are not.
    """
    differing = int(np.count_nonzero(ours != theirs))
    if differing:
        raise Disagreement(f"{differing:,} of {ours.size:,} cells differ")
    return f"all {ours.size:,} cells"


# Values


def _large(settings: Settings) -> Iterator[Row]:
    """Yield the speed of searches in all cells of a large grid, and in most of them."""
    layer = floor(10**6 if settings.quick else CELLS)
    assert layer.grid is not None
    assert layer.cells is not None
    count = layer.cells.size
    named = f"{count:,} cells"
    expected = int(np.count_nonzero(layer.cells == OCCUPIED))
    yield _rate(
        f"find a value in {named}", lambda: layer.find("Occupied"), count, expected, settings
    )
    side = layer.grid.width * RESOLUTION
    area = shapely.Point(side / 2, side / 2).buffer(0.45 * side)
    window = layer.grid.window_in(area)
    inside = int(np.count_nonzero(window.inside))
    expected = int(np.count_nonzero(window.inside & (layer.cells[window.slices] == OCCUPIED)))
    work = f"find a value in a circle of {inside:,} cells"
    yield _rate(work, lambda: layer.find("Occupied", area), inside, expected, settings)
    held = layer.cells.nbytes / count
    yield Figure("memory of a grid", (held,), "bytes/cell", 1.0, less_is_better=True)


def _rate(
    work: str,
    ask: Callable[[], NDArray[np.float64]],
    cells: int,
    expected: int,
    settings: Settings,
) -> Figure:
    rates = []
    for _ in range(settings.repeat):
        seconds, found = seconds_of(ask)
        if len(found) != expected:
            raise Disagreement(f"{work}: {len(found):,} cells, where numpy counts {expected:,}")
        rates.append(cells / seconds / GIGABYTE)
    return Figure(work, tuple(rates), "GB/s", 1.0, note=f"{expected:,} found")


def floor(cells: int) -> OccupancyLayer:
    """Return a square grid of about so many cells, free with some occupied ones."""
    side = round(cells**0.5)
    rng = np.random.default_rng(7)
    values = np.full((side, side), FREE, dtype=np.int8)
    values[: side // 3] = UNKNOWN
    values[rng.random((side, side), dtype=np.float32) < _SPARSE] = OCCUPIED
    return OccupancyLayer(
        "occupancy", "map", GridGeometry(side, side, RESOLUTION, Pose2D()), values
    )


def _growth(settings: Settings) -> Iterator[Growth]:
    """Yield the time of a search and of a mask, with the memory of the grid and of the mask."""
    sizes = tuple(10**power for power in range(4, 7 if settings.quick else 9))
    searches, masks, of_grids, of_masks = [], [], [], []
    for size in sizes:
        layer = floor(size)
        assert layer.grid is not None
        assert layer.cells is not None
        grid, side = layer.grid, layer.grid.width * RESOLUTION
        ring = shapely.Point(side / 2, side / 2).buffer(0.45 * side)
        searches.append(_median(partial(layer.find, "Occupied"), settings))
        masks.append(_median(partial(_inside, grid, ring), settings))
        of_grids.append(layer.cells.nbytes)
        of_masks.append(_inside(grid, ring).nbytes)
    for work, seconds, held, what in (
        ("find a value", searches, of_grids, "the grid"),
        ("the mask of a circle", masks, of_masks, "the mask"),
    ):
        yield Growth(work, "cells", sizes, tuple(seconds), tuple(held), note=f"memory: {what}")


def _median(work: Callable[[], object], settings: Settings) -> float:
    return float(np.median([seconds_of(work)[0] for _ in range(settings.repeat)]))
