"""The occupancy layer from depth or laser with known poses.

Source: Moravec and Elfes, ICRA 1985, for the idea; log-odds with clamping as in Hornung et al.,
OctoMap, Autonomous Robots 2013.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray
from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.mapping.rays import Rays
from hypermap.mapping.seen_cells import SeenCells, cells_from
from hypermap.mapping.stages import OccupancyConfig
from hypermap.perception.frame import RgbdFrame

_BLOCK = 256  # cells; the grid grows by whole blocks, so it is seldom copied
_BAND = 1 << 16  # cells of a map that are computed at once, in a processor's cache


class OccupancyMapper:
    """A grid of log-odds that grows with the area seen.

    In each frame, a cell is hit if it contains enough points above the floor; otherwise it is free
    if a ray passes low over it; otherwise it is unobserved. Hits add to the cell's log-odds, misses
    subtract, and both are clamped.

    Attributes:
        config: the settings.
    """

    def __init__(self, config: OccupancyConfig) -> None:
        self.config = config
        self._world = GridGeometry(width=1, height=1, resolution=config.resolution)
        # Cell (0, 0) of the log-odds is this cell of the map frame; NaN if never seen.
        self._first = np.zeros(2, dtype=np.int64)
        self._log_odds = np.empty((0, 0), dtype=np.float32)

    def add_depth(self, frame: RgbdFrame) -> None:
        """Add a depth image, whose floor is at z = 0 of the map.

        Raises:
            HypermapError: If the map would grow beyond `max_cells`; it stays as it was.
        """
        self.change_by(self.seen_in(frame))()

    def seen_in(self, frame: RgbdFrame) -> SeenCells | None:
        """Return the cells that a depth image shows hit or free; None if there are none."""
        return self._seen_by(Rays.of_depth(frame, self.config), self.config.min_points)

    def change_by(self, seen: SeenCells | None) -> Callable[[], None]:
        """Return a function that adds the observed cells to the log-odds, and cannot fail.

        Call it before anything else is added.

        Raises:
            HypermapError: If the map would grow beyond `max_cells`; it stays as it was.
        """
        if seen is None:
            return _nothing
        height, width = seen.is_hit.shape
        row, col = (seen.first - self._first).tolist()
        rows, cols = self._log_odds.shape
        if row < 0 or col < 0 or row + height > rows or col + width > cols:
            self._cover(seen.first, np.add(seen.first, [height - 1, width - 1]))
            row, col = (seen.first - self._first).tolist()
        window = self._log_odds[row : row + height, col : col + width]
        changes = self.config.hit, -self.config.miss
        clamps = self.config.min_log_odds, self.config.max_log_odds
        return partial(_change, window, seen.is_hit, seen.is_free, changes, clamps)

    def add_scan(
        self,
        ranges: ArrayLike,
        angle_min: float,
        angle_increment: float,
        map_T_laser: NDArray[np.float64],
        range_max: float | None = None,
    ) -> None:
        """Add a scan of a level laser.

        Args:
            ranges: meters, shape (N,). A range of at least `range_max`, such as infinity, is a ray
                that hit nothing; NaN, zero and negative ranges are no measurements (REP 117).
            angle_min: angle of the first ray from the laser's x axis toward its y axis [rad].
            angle_increment: from one ray to the next [rad].
            map_T_laser: pose of the laser in the map, shape (4, 4).
            range_max: rays are used up to this range [m]; `max_range` if None.

        Raises:
            HypermapError: If the map would grow beyond `max_cells`; it stays as it was.
            ValueError: If `range_max` is not a positive number.
        """
        reach = self.config.max_range if range_max is None else range_max
        if not 0 < reach < np.inf:
            raise ValueError(f"range_max must be a positive number, got {range_max}")
        resolution = self.config.resolution
        rays = Rays.of_scan(ranges, angle_min, angle_increment, map_T_laser, reach, resolution)
        self.change_by(self._seen_by(rays, min_points=1))()

    def layer(self, name: str = "occupancy", frame_id: str = "map") -> OccupancyLayer:
        """Return the layer so far, cropped to the cells that were ever seen.

        Cells are -1 unknown, 0 free, 100 occupied, or between the thresholds the probability in
        percent. The layer is empty if nothing was seen.
        """
        first, seen = self._seen()
        if seen.size == 0:
            return OccupancyLayer(name, frame_id)
        grid = cells_from(first, seen.shape, self.config.resolution)
        cells = np.full(seen.shape, UNKNOWN, np.int8)
        rows = max(1, _BAND // seen.shape[1])
        for begin in range(0, len(seen), rows):
            band = seen[begin : begin + rows]
            known = ~np.isnan(band)
            cells[begin : begin + rows][known] = self._percent(band[known])
        return OccupancyLayer(name, frame_id, grid, cells)

    def log_odds(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Return the evidence so far, for `go_on_with`.

        Returns:
            Row and column of the first cell, counted from the origin of the map frame, int64, shape
            (2,); and the log-odds, NaN if never seen, float32, shape (H, W).
        """
        first, seen = self._seen()
        return first, seen.copy()

    def go_on_with(self, first: NDArray[np.int64], log_odds: NDArray[np.float32]) -> None:
        """Take over the evidence of a mapper with the same configuration; see `log_odds`."""
        self._first, self._log_odds = first, log_odds

    def make_room(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """Make room between two corners [m], shape (2,) each, so that the grid is not copied often.

        Where that is too much, the grid grows as it must.
        """
        first, last = self._world.cells_at(np.array([low, high]))
        with suppress(HypermapError):
            self._cover(first, last)

    def _percent(self, log_odds: NDArray[np.float32]) -> NDArray[np.int8]:
        """Return the cells for log-odds that are known, shape (N,)."""
        likelihood = 1 / (1 + np.exp(-log_odds.astype(np.float64)))
        cells = np.round(100 * likelihood).astype(np.int8)
        cells[likelihood < self.config.free_thresh] = FREE
        cells[likelihood >= self.config.occupied_thresh] = OCCUPIED
        return cells

    def _seen(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Return `log_odds` as a view."""
        known = ~np.isnan(self._log_odds)
        rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        if len(rows) == 0:
            return np.zeros(2, np.int64), np.empty((0, 0), np.float32)
        seen = self._log_odds[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        return np.add(self._first, [rows[0], cols[0]]), seen

    def _seen_by(self, rays: Rays, min_points: int) -> SeenCells | None:
        bounds = rays.bounds()
        if bounds is None:
            return None
        first, last = self._world.cells_at(bounds)
        grid = cells_from(first, tuple(last - first + 1), self.config.resolution)
        hits, is_free = rays.rasterize(grid)
        return SeenCells(first, hits >= min_points, is_free)

    def _cover(self, first: NDArray[np.int64], last: NDArray[np.int64]) -> None:
        """Grow the grid to cover the cells of the map frame from first to last."""
        (bottom, left), (height, width) = self._first.tolist(), self._log_odds.shape
        end = bottom + height, left + width
        if self._log_odds.size == 0:
            new_first, new_end = first, last + 1
        elif first[0] >= bottom and first[1] >= left and last[0] < end[0] and last[1] < end[1]:
            return
        else:
            new_first, new_end = np.minimum(first, self._first), np.maximum(last + 1, end)
        new_first, new_end = new_first // _BLOCK * _BLOCK, -(-new_end // _BLOCK) * _BLOCK
        height, width = (int(n) for n in new_end - new_first)
        if height * width > self.config.max_cells:
            side = self.config.resolution
            raise HypermapError(
                f"the occupancy map would grow to {width * side:.0f} m x {height * side:.0f} m, "
                f"more than its {self.config.max_cells} cells of {side:g} m allow; is a pose far "
                "off, or are the poses not in meters?"
            )
        grown = np.full((height, width), np.nan, dtype=np.float32)
        row, col = self._first - new_first
        old_height, old_width = self._log_odds.shape
        if self._log_odds.size:
            grown[row : row + old_height, col : col + old_width] = self._log_odds
        self._first, self._log_odds = new_first, grown


def _nothing() -> None:
    pass


@loop()
def _change(
    log_odds: NDArray[np.float32],
    is_hit: BoolArray,
    is_free: BoolArray,
    changes: tuple[float, float],
    clamps: tuple[float, float],
) -> None:
    """Update the log-odds, NaN if never seen, of cells that are hit or else free."""
    for row in range(log_odds.shape[0]):
        for col in range(log_odds.shape[1]):
            if is_hit[row, col] or is_free[row, col]:
                before = log_odds[row, col]
                after = 0.0 if np.isnan(before) else np.float64(before)
                after += changes[0] if is_hit[row, col] else changes[1]
                log_odds[row, col] = min(max(after, clamps[0]), clamps[1])
