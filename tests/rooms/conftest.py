"""Drawn plans, whose rooms can be counted by eye."""

from __future__ import annotations

import numpy as np

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer

SIDE = 0.05  # [m] of a cell


class Plan:
    """A plan in meters: all is wall until something is cleared."""

    def __init__(self, width: float, height: float) -> None:
        self.cells = np.full((round(height / SIDE), round(width / SIDE)), 100, dtype=np.int8)

    def clear(self, x0: float, y0: float, x1: float, y1: float) -> Plan:
        self.cells[self._part(x0, y0, x1, y1)] = 0
        return self

    def fill(self, x0: float, y0: float, x1: float, y1: float, value: int = 100) -> Plan:
        self.cells[self._part(x0, y0, x1, y1)] = value
        return self

    def layer(self, origin: Pose2D | None = None) -> OccupancyLayer:
        return layer_of(self.cells, origin)

    @staticmethod
    def _part(*corners: float) -> tuple[slice, slice]:
        x0, y0, x1, y1 = (round(value / SIDE) for value in corners)
        return slice(y0, y1), slice(x0, x1)


def layer_of(cells: np.ndarray, origin: Pose2D | None = None) -> OccupancyLayer:
    height, width = cells.shape
    grid = GridGeometry(width, height, SIDE, Pose2D() if origin is None else origin)
    return OccupancyLayer("occupancy", "map", grid, cells)


def two_rooms(door: float = 0.9) -> Plan:
    """Two rooms of 4 x 4 m side by side, with a door in the middle of the wall between them."""
    plan = Plan(9, 5).clear(0.4, 0.5, 4.4, 4.5).clear(4.6, 0.5, 8.6, 4.5)
    return plan.clear(4.4, 2.5 - door / 2, 4.6, 2.5 + door / 2)


def along_a_corridor() -> Plan:
    """Three rooms of 4 x 4 m on either side of a corridor of 2 x 13 m, doors face each other."""
    plan = Plan(14, 12).clear(0.5, 5, 13.5, 7)
    for left in (0.5, 5.0, 9.5):
        for low, door in ((0.8, 4.8), (7.2, 7.0)):
            plan.clear(left, low, left + 4, low + 4)
            plan.clear(left + 1.5, door, left + 2.4, door + 0.2)
    return plan


def cubicles_along_a_narrow_corridor() -> Plan:
    """Four cubicles of 2.2 x 2.2 m on either side of a corridor of 1.2 m, open along 1.9 m each."""
    plan = Plan(13.6, 8).clear(0.5, 3.4, 13.1, 4.6)
    for left in (2.1, 4.5, 6.9, 9.3):
        plan.clear(left, 1.0, left + 2.2, 3.2).clear(left, 4.8, left + 2.2, 7.0)
        plan.clear(left, 3.2, left + 1.9, 3.4).clear(left + 0.3, 4.6, left + 2.2, 4.8)
    return plan
