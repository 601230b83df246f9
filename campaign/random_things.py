"""Random grids, objects and poses, of which `differential` makes its worlds."""

from __future__ import annotations

import math
import random

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from campaign.oracle import Grid, Pose, Thing

NAMES = ("cup", "chair", "Tür", "table")
EXTENT = 12.0  # meters


class RandomThings:
    """Draws what a world consists of.

    Attributes:
        is_lattice: whether all lies on a lattice, where shapes touch and coincide, and nothing is
            rotated.
    """

    def __init__(self, draw: random.Random, *, is_lattice: bool) -> None:
        self.is_lattice = is_lattice
        self._draw = draw

    def pose(self) -> Pose:
        """Return the pose of a frame in its parent."""
        draw = self._draw
        if self.is_lattice:
            return float(draw.randrange(-3, 4)), float(draw.randrange(-3, 4)), 0.0
        return draw.uniform(-5, 5), draw.uniform(-5, 5), draw.uniform(-math.pi, math.pi)

    def grid(self, name: str, frame: str) -> Grid:
        """Return an occupancy grid of at most 40 x 40 cells."""
        draw = self._draw
        resolution = draw.choice([0.25, 0.5, 1.0] if self.is_lattice else [0.05, 0.3, 1.0, 2.7])
        most = min(40, int(EXTENT / resolution) + 1)
        shape = draw.randrange(1, most + 1), draw.randrange(1, most + 1)
        random = np.random.default_rng(draw.randrange(2**31))
        cells = random.choice(np.array([-1, 0, 57, 100], np.int8), shape)
        return Grid(name, frame, resolution, self.pose(), cells)

    def thing(self, number: int) -> Thing:
        """Return an object with an id."""
        draw = self._draw
        tags = tuple(draw.sample(["red", "big"], draw.randrange(3)))
        return Thing(number, draw.choice(NAMES), self.shape(), tags)

    def shape(self, most: float = 2.0) -> BaseGeometry:
        """Return a polygon, perhaps with a hole, or two polygons."""
        draw = self._draw
        x, y = self.place()
        if self.is_lattice:
            w, h = draw.randrange(1, 9) / 4, draw.randrange(1, 9) / 4
            return shapely.box(x, y, x + w, y + h)
        if draw.random() < 0.15:
            parts = [self._star(x, y, most / 2), self._star(x + 3 * most, y, most / 2)]
            return shapely.MultiPolygon(parts)
        return self._star(x, y, most * draw.uniform(0.05, 1.0))

    def _star(self, x: float, y: float, most: float) -> shapely.Polygon:
        """Return a polygon that is seen whole from its middle, so that it cannot cross itself."""
        draw = self._draw
        count = draw.choice([3, 4, 5, 12, 40])
        angles = 2 * math.pi * (np.arange(count) + draw.random() * 0.9) / count
        reach = np.array([draw.uniform(0.3, 1.0) for _ in range(count)]) * most
        corners = np.column_stack([np.cos(angles), np.sin(angles)]) * reach[:, np.newaxis]
        middle = np.array([x, y])
        hole = [corners * 0.3 + middle] if count > 4 and draw.random() < 0.3 else []
        polygon = shapely.Polygon(corners + middle, hole)
        return polygon if polygon.is_valid else shapely.Polygon(corners + middle)

    def place(self) -> tuple[float, float]:
        """Return x and y of a place [m]."""
        draw = self._draw
        if self.is_lattice:
            return draw.randrange(-20, 21) / 4, draw.randrange(-20, 21) / 4
        return draw.uniform(-EXTENT / 2, EXTENT / 2), draw.uniform(-EXTENT / 2, EXTENT / 2)
