"""Make a map layer from samples, or again from the samples that a layer keeps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer, decimals_for
from hypermap.values.interpolation import Interpolation, grid_around, interpolate
from hypermap.values.methods import Method
from hypermap.values.random_field import FieldSettings
from hypermap.values.units import is_signal


def value_layer_of(
    name: str,
    samples: Samples,
    occupancy: OccupancyLayer | None = None,
    *,
    frame_id: str | None = None,
    quantity: str = "",
    unit: str = "",
    method: Method = "gmrf",
    settings: FieldSettings | None = None,
    resolution: float | None = None,
    half_life: float | None = None,
) -> ValueLayer:
    """Return a layer with the most probable values between samples.

    Args:
        name: of the layer.
        samples: in the frame of the occupancy layer, or in `frame_id`. The layer keeps them.
        occupancy: walls, and where the floor is; samples off its grid are left out.
        frame_id: of the samples; None for that of the occupancy layer, or "map".
        quantity: what was measured; the layer's name where nothing is said.
        unit: of the values; in dBm they may be the signal of one sender.
        method: as in `interpolate`, like the last three.
        settings: as there.
        resolution: as there.
        half_life: as there.

    Raises:
        HypermapError: If there are too few samples, all are off the map, the resolution is too
            fine, or samples without stamps are to count less with time.
    """
    inside = on_map(samples, occupancy)
    found = interpolate(
        inside,
        occupancy,
        method=method,
        settings=settings,
        resolution=resolution,
        half_life=half_life,
        may_have_source=is_signal(unit),
    )
    frame = frame_id or ("map" if occupancy is None else occupancy.frame_id)
    return layer_of(found, name, inside, occupancy, frame, quantity=quantity, unit=unit)


def layer_of(
    found: Interpolation,
    name: str,
    samples: Samples,
    occupancy: OccupancyLayer | None,
    frame_id: str,
    *,
    quantity: str = "",
    unit: str = "",
) -> ValueLayer:
    """Return a layer of what samples were interpolated to; see `value_layer_of`."""
    made_by: dict[str, str | float] = {
        "method": found.method,
        **found.settings,
        "noise": found.noise,
    }
    if occupancy is not None:
        made_by["occupancy"] = occupancy.name
    return ValueLayer(
        name,
        frame_id,
        found.grid,
        found.values,
        unit,
        decimals_for(found.values),
        quantity=quantity,
        deviations=found.deviations,
        stamps=_newest(found.grid, samples),
        samples=samples,
        made_by={key: value for key, value in made_by.items() if value == value},  # no NaN
    )


def unknown_layer_of(
    name: str, samples: Samples, frame_id: str, *, quantity: str = "", unit: str = ""
) -> ValueLayer:
    """Return a layer that keeps samples of which no field can be made: its cells are unknown.

    Args:
        name: of the layer.
        samples: at least one, in its frame.
        frame_id: of both.
        quantity: as in `value_layer_of`, like the unit.
        unit: as there.

    Raises:
        HypermapError: If the samples are too far apart, or a value is absurdly large.
    """
    grid = grid_around(samples)
    unknown = np.full(grid.shape, np.nan)
    stamps = _newest(grid, samples)
    return ValueLayer(
        name, frame_id, grid, unknown, unit, quantity=quantity, stamps=stamps, samples=samples
    )


def on_map(samples: Samples, occupancy: OccupancyLayer | None) -> Samples:
    """Return the samples on the grid of an occupancy layer; all without one.

    Raises:
        HypermapError: If there is none on it.
    """
    if occupancy is None or occupancy.grid is None:
        return samples
    grid = occupancy.grid
    on_grid = grid.contains(*grid.cells_at(samples.points_xy).T)
    if len(samples) and not on_grid.any():
        x, y = samples.points_xy[0]
        x0, y0, x1, y1 = occupancy.extent().bounds
        raise HypermapError(
            f"no sample of {len(samples)} is on the map, which reaches from ({x0:g}, {y0:g}) to "
            f"({x1:g}, {y1:g}); the first one is at ({x:g}, {y:g}); are they in frame "
            f"{occupancy.frame_id!r}, in meters?"
        )
    return samples if on_grid.all() else samples.chosen(on_grid)


def _newest(grid: GridGeometry, samples: Samples) -> NDArray[np.float64] | None:
    """Return when the newest sample in each cell was taken; None where no sample says when."""
    if np.isnan(samples.stamps).all():
        return None
    newest = np.full(grid.shape, np.nan)
    rows, cols = grid.cells_at(samples.points_xy).T
    np.fmax.at(newest, (rows, cols), samples.stamps)
    return newest
