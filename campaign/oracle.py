"""A slow second opinion: every question answered by looking at every cell and every object.

Nothing of the program's code for questions is used: numpy, shapely, and the meaning of the
questions as the interfaces describe it. Where frames are turned, and so numbers rounded, places are
decided with a margin: what lies nearer to a border may be answered either way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import affine_transform
from shapely.geometry.base import BaseGeometry

EPSILON = 1e-7  # meters
Pose: TypeAlias = "tuple[float, float, float]"  # x, y [m], yaw [rad]


@dataclass
class Thing:
    """An object of a layer, its shape in the layer's frame [m]."""

    number: int
    name: str
    shape: BaseGeometry
    tags: tuple[str, ...] = ()


@dataclass
class Grid:
    """A layer of cells; the origin is the pose of its corner in the layer's frame."""

    name: str
    frame: str
    resolution: float
    origin: Pose
    cells: NDArray[np.int8]


@dataclass
class Things:
    """A layer of objects."""

    name: str
    frame: str
    things: list[Thing]


@dataclass(frozen=True)
class Bracket:
    """An answer that is a set: what must be in it, and what may be."""

    sure: frozenset[int]
    possible: frozenset[int]

    def holds(self, answer: Iterable[int]) -> bool:
        """Return whether an answer is right; nothing may be in it twice."""
        given = list(answer)
        return len(set(given)) == len(given) and self.sure <= set(given) <= self.possible


@dataclass
class Oracle:
    """A map, and its answers.

    Attributes:
        layers: its layers; the frame of the first is the base frame.
        poses: of each frame in the base frame.
        margin: within which a border may be seen on either side [m]; 0 where nothing is rounded,
            and borders belong to what they enclose.
    """

    layers: list[Grid | Things]
    poses: dict[str, Pose] = field(default_factory=dict)
    margin: float = EPSILON
    _kept: dict[str, Any] = field(default_factory=dict)

    def changed(self) -> None:
        """Forget what was computed; to be called after each change."""
        self._kept.clear()

    def in_base(self, shape: BaseGeometry, frame: str) -> BaseGeometry:
        """Return a shape of a frame in the base frame."""
        return _moved(shape, self.poses.get(frame, (0.0, 0.0, 0.0)))

    def point_in_base(self, point: Sequence[float], frame: str) -> shapely.Point:
        """Return a point of a frame in the base frame."""
        (moved,) = _apply(self.poses.get(frame, (0.0, 0.0, 0.0)), np.array([point]))
        return shapely.Point(moved)

    def shapes(self, layer: Things) -> NDArray[Any]:
        """Return the shapes of a layer in the base frame, shape (N,)."""
        if layer.name not in self._kept:
            shapes = np.empty(len(layer.things), dtype=object)
            shapes[:] = [self.in_base(thing.shape, layer.frame) for thing in layer.things]
            self._kept[layer.name] = shapes
        kept: NDArray[Any] = self._kept[layer.name]
        return kept

    def centers(self, layer: Grid) -> NDArray[np.float64]:
        """Return the centers of all cells in the base frame, by rows, shape (N, 2)."""
        if layer.name not in self._kept:
            self._kept[layer.name] = self._centers(layer)
        kept: NDArray[np.float64] = self._kept[layer.name]
        return kept

    def cells_at(self, layer: Grid, points_xy: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the rows and columns under points of the base frame, shape (N, 2)."""
        in_layer = _back(self.poses.get(layer.frame, (0, 0, 0)), points_xy)
        places = np.floor(_back(layer.origin, in_layer) / layer.resolution)
        return places[:, ::-1].astype(np.int64)

    def _centers(self, layer: Grid) -> NDArray[np.float64]:
        rows, cols = np.indices(layer.cells.shape)
        places = np.column_stack([cols.ravel() + 0.5, rows.ravel() + 0.5]) * layer.resolution
        return _apply(self.poses.get(layer.frame, (0, 0, 0)), _apply(layer.origin, places))

    # At a point

    def values_at(self, layer: Grid | Things, x: float, y: float) -> set[int]:
        """Return the numbers that a layer may give at a point of the base frame."""
        if isinstance(layer, Things):
            at = shapely.Point(x, y)
            shapes = self.shapes(layer)
            near, sure = self.around(shapes, at)
            # The smallest that is there for sure, or any smaller that may be there.
            areas = [shape.area for shape in shapes]
            least = min((areas[i] for i in sure), default=math.inf)
            may = {layer.things[i].number for i in near if areas[i] <= least * (1 + 1e-9)}
            return may if sure else may | {-1}
        found = set()
        for dx, dy in ((0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            place = np.array([[x + dx * self.margin, y + dy * self.margin]])
            row, col = self.cells_at(layer, place)[0]
            height, width = layer.cells.shape
            on_grid = 0 <= row < height and 0 <= col < width
            found.add(int(layer.cells[row, col]) if on_grid else -1)
        return found

    def around(self, shapes: NDArray[Any], at: shapely.Point) -> tuple[list[int], list[int]]:
        """Return which shapes may hold a point, and which of them do for sure."""
        near = np.flatnonzero(shapely.distance(shapes, at) <= self.margin).tolist()
        inner = [_grown(shapes[i], -self.margin) for i in near]
        return near, [i for i, shape in zip(near, inner, strict=True) if shape.intersects(at)]

    # In an area

    def inside(self, layer: Grid | Things, area: BaseGeometry) -> Bracket:
        """Return which cells (by rows) or objects (by place in the layer) an area meets."""
        smaller, larger = _grown(area, -self.margin), _grown(area, self.margin)
        if isinstance(layer, Things):
            shapes = self.shapes(layer)
            sure = np.flatnonzero(shapely.intersects(shapes, smaller)).tolist()
            may = np.flatnonzero(shapely.intersects(shapes, larger)).tolist()
            return Bracket(frozenset(sure), frozenset(may))
        points = shapely.points(self.centers(layer))
        return Bracket(
            frozenset(np.flatnonzero(shapely.intersects(points, smaller)).tolist()),
            frozenset(np.flatnonzero(shapely.intersects(points, larger)).tolist()),
        )

    def called(self, layer: Grid | Things, what: str | int) -> set[int]:
        """Return which cells or objects have a name, or a number."""
        if isinstance(layer, Things):
            return {
                i
                for i, thing in enumerate(layer.things)
                if (thing.name if isinstance(what, str) else thing.number) == what
            }
        values = layer.cells.ravel().tolist()
        return {i for i, value in enumerate(values) if what in (value, label(value))}

    # Near something

    def distances(
        self, layer: Grid | Things, what: str | int, x: float, y: float
    ) -> list[tuple[float, int]]:
        """Return how far all of a name are from a point, nearest first, and which they are."""
        rows = self.called(layer, what)
        at = shapely.Point(x, y)
        if isinstance(layer, Things):
            shapes = self.shapes(layer)
            return sorted((float(shapely.distance(shapes[i], at)), i) for i in rows)
        centers = self.centers(layer)
        return sorted((float(np.hypot(*(centers[i] - (x, y)))), i) for i in rows)

    def objects(self) -> list[tuple[Things, Thing, BaseGeometry]]:
        """Return all objects of all layers with their shapes in the base frame."""
        layers = [layer for layer in self.layers if isinstance(layer, Things)]
        return [
            (layer, thing, shape)
            for layer in layers
            for thing, shape in zip(layer.things, self.shapes(layer), strict=True)
        ]


def _grown(shape: BaseGeometry, by: float) -> BaseGeometry:
    return shape.buffer(by) if by else shape


def label(value: int) -> str:
    """Return what a cell is called."""
    return {0: "Free", 100: "Occupied"}.get(value, "Unknown")


def _matrix(pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return turn, np.array([x, y])


def _apply(pose: Pose, points: NDArray[np.float64]) -> NDArray[np.float64]:
    turn, shift = _matrix(pose)
    moved: NDArray[np.float64] = points @ turn.T + shift
    return moved


def _back(pose: Pose, points: NDArray[np.float64]) -> NDArray[np.float64]:
    turn, shift = _matrix(pose)
    moved: NDArray[np.float64] = (points - shift) @ turn
    return moved


def _moved(shape: BaseGeometry, pose: Pose) -> BaseGeometry:
    (a, b), (d, e) = _matrix(pose)[0]
    moved: BaseGeometry = affine_transform(shape, [a, b, d, e, pose[0], pose[1]])
    return moved
