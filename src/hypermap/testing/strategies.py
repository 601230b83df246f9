"""Hypothesis strategies for what maps are made of; coordinates reach some 50 m."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer

NAMES = ("chair", "table", "cup", "potted plant", "Tür")

coordinates = st.floats(-50, 50, allow_nan=False, width=32)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(Pose2D, coordinates, coordinates, angles)
grids = st.builds(
    GridGeometry,
    width=st.integers(1, 12),
    height=st.integers(1, 12),
    resolution=st.sampled_from([0.05, 0.1, 0.25, 1.0, 3.0]),
    origin=poses,
)


def points(min_size: int = 0, max_size: int = 20) -> SearchStrategy[NDArray[np.float64]]:
    """Return arrays of points, shape (N, 2)."""
    pairs = st.lists(st.tuples(coordinates, coordinates), min_size=min_size, max_size=max_size)
    return pairs.map(lambda items: np.array(items, dtype=np.float64).reshape(-1, 2))


@st.composite
def polygons(draw: st.DrawFn, around: BaseGeometry | None = None) -> shapely.Polygon:
    """Return simple polygons, convex or not, some with a hole, most of which meet `around`."""
    x0, y0, x1, y1 = (-50, -50, 50, 50) if around is None else around.bounds
    center = np.array([draw(st.floats(x0, x1)), draw(st.floats(y0, y1))])
    size = draw(st.floats(0.05, 1.0)) * max(x1 - x0, y1 - y0)
    corners = draw(st.integers(3, 8))
    turn = draw(angles)
    # A star around its center: the angles grow, so the outline cannot cross itself.
    radii = np.array([draw(st.floats(0.2, 1.0)) for _ in range(corners)]) * size
    directions = turn + 2 * math.pi * np.arange(corners) / corners
    offsets = radii[:, np.newaxis] * np.column_stack([np.cos(directions), np.sin(directions)])
    holes = [center + 0.3 * offsets] if draw(st.booleans()) else []
    return shapely.Polygon(center + offsets, holes)


def areas(around: BaseGeometry | None = None) -> SearchStrategy[BaseGeometry]:
    """Return polygons and multipolygons."""
    single: SearchStrategy[Any] = polygons(around)
    several = st.lists(single, min_size=2, max_size=3).map(_united)
    return st.one_of(single, several)


@st.composite
def occupancy_layers(draw: st.DrawFn) -> OccupancyLayer:
    """Return occupancy layers with free, occupied, unknown and other cells."""
    grid = draw(grids)
    values = st.sampled_from([-1, 0, 1, 57, 100])
    count = grid.width * grid.height
    cells = draw(st.lists(values, min_size=count, max_size=count))
    return OccupancyLayer(
        "occupancy", "map", grid, np.array(cells, dtype=np.int8).reshape(grid.shape)
    )


def semantic_objects() -> SearchStrategy[SemanticObject]:
    """Return objects without ids."""
    known = st.none() | st.floats(-100, 100)
    return st.builds(
        SemanticObject,
        name=st.sampled_from(NAMES),
        footprint=areas(),
        tags=st.lists(st.sampled_from(NAMES), max_size=2).map(tuple),
        existence=known,
        first_seen=known,
    )


def semantic_layers(max_size: int = 8) -> SearchStrategy[SemanticLayer]:
    """Return semantic layers."""
    objects = st.lists(semantic_objects(), max_size=max_size)
    return st.builds(SemanticLayer, st.just("semantic"), st.just("map"), objects)


def _united(parts: list[Any]) -> BaseGeometry:
    united: BaseGeometry = shapely.union_all(parts)
    return united
