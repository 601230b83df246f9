"""Measured values as a table, for spreadsheets."""

from __future__ import annotations

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.value_layer import ValueLayer
from hypermap.spreadsheet import as_csv


def to_csv(layer: ValueLayer) -> str:
    """Return the cells with a value as CSV: x, y [m], value, deviation, stamp [s] and unit.

    Deviation and stamp are empty where they are not known.

    Raises:
        HypermapError: If the layer is empty.
    """
    if layer.grid is None or layer.cells is None:
        raise HypermapError(f"layer {layer.name!r} is empty: there are no values to save")
    rows, cols = np.nonzero(~np.isnan(layer.cells))
    centers = layer.grid.centers(rows, cols)
    columns = zip(
        centers.round(6).tolist(),
        layer.cells[rows, cols],
        layer.deviation_at(centers),
        layer.stamp_at(centers).tolist(),
        strict=True,
    )
    cells = (
        [*place, *("" if np.isnan(number) else str(number) for number in numbers), layer.unit]
        for place, *numbers in columns
    )
    return as_csv(["x", "y", "value", "deviation", "stamp", "unit"], cells)
