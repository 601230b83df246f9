"""The occupancy layer: how likely each cell of a grid is to be blocked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Layer

UNKNOWN, FREE, OCCUPIED = -1, 0, 100


class OccupancyLayer(Layer):
    """Occupancy on a grid; row 0 lies at the origin and rows grow along y.

    Attributes:
        grid: where the cells lie; None while the layer is empty.
        cells: shape (height, width); int8 with -1 unknown, 0 free .. 100 occupied, or int16 where
            a raw map holds values up to 255. None while the layer is empty.
    """

    class_name: ClassVar[str] = "OccupancyGridLayer"

    def __init__(
        self,
        name: str,
        frame_id: str,
        grid: GridGeometry | None = None,
        cells: NDArray[np.int8] | NDArray[np.int16] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.grid = grid
        self.cells = cells
