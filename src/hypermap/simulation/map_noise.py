"""Occupancy maps with the errors of real ones: distorted, and limited to what a laser sees."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hypermap.core.occupancy import OccupancyLayer
from hypermap.simulation.laser_map import laser_map
from hypermap.simulation.ranges import check_not_negative
from hypermap.simulation.truth import true_occupancy
from hypermap.simulation.world import World

_WAVES = 8  # whose sum is a distortion


@dataclass(frozen=True)
class MapNoise:
    """The errors of a recording's occupancy map. None by default.

    Attributes:
        source: "exact", the true map of walls and things; or "laser", a map by scan matching of a
            planar laser on the drive, which sees only the legs of a table.
        bend: standard deviation in x and in y of a smooth distortion of the map, as from slightly
            wrong scan matching [m].
        bend_length: correlation length of the distortion [m].
    """

    source: Literal["exact", "laser"] = "exact"
    bend: float = 0.0
    bend_length: float = 4.0

    def __post_init__(self) -> None:
        check_not_negative(self, "bend", "bend_length")
        if self.bend_length == 0:
            raise ValueError("bend_length must be positive")

    def make(self, world: World, rng: np.random.Generator) -> OccupancyLayer:
        """Return the map of a world; for a laser, the world must have a drive."""
        bend = self._bend(rng) if self.bend else None
        if self.source == "laser":
            return laser_map(world, rng, bend)
        return true_occupancy(world, bend=bend)

    def _bend(
        self, rng: np.random.Generator
    ) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
        """Return a smooth function that moves points, shape (N, 2)."""
        angles, phases = rng.uniform(0, math.tau, (2, 2, _WAVES))
        numbers = math.tau / (self.bend_length * rng.uniform(1, 3, (2, _WAVES)))
        along = np.stack([np.cos(angles), np.sin(angles)]) * numbers

        def bend(points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
            waves = np.sin(np.einsum("ni,iak->nak", points_xy, along) + phases)
            scale = self.bend * math.sqrt(2 / _WAVES)
            return np.asarray(points_xy + scale * waves.sum(axis=2))

        return bend
