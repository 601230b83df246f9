"""Which known objects an observed shape belongs to: one small function per answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray, ObjectArray
from hypermap.mapping.stages import EvidenceConfig

Rows: TypeAlias = NDArray[np.int64]


class KnownShapes:
    """The shapes of all known objects as columns, so that most are ruled out by their boxes.

    Rows are in the order in which objects were added; removing one moves those behind it up.

    Attributes:
        classes: a number for the class of each object, int64, shape (N,).
        shapes: shapely geometries in the map frame, shape (N,).
        boxes: (xmin, ymin, xmax, ymax) of each shape [m], shape (N, 4).
        areas: of each shape [m²], shape (N,).
        heights: lowest and highest point of each object [m], shape (N, 2).
    """

    def __init__(self) -> None:
        self.classes: IntArray = np.empty(0, dtype=np.int64)
        self.shapes: ObjectArray = np.empty(0, dtype=object)
        self.boxes = np.empty((0, 4))
        self.areas = np.empty(0)
        self.heights = np.empty((0, 2))

    def __len__(self) -> int:
        return len(self.classes)

    def append(
        self, class_: int, shape: BaseGeometry, heights: tuple[float, float] = (0.0, 0.0)
    ) -> int:
        """Add a shape and return its row."""
        self.classes = np.append(self.classes, class_)
        self.shapes = np.append(self.shapes, np.array([shape], dtype=object))
        self.boxes = np.vstack([self.boxes, shapely.bounds(shape)])
        self.areas = np.append(self.areas, shapely.area(shape))
        self.heights = np.vstack([self.heights, heights])
        return len(self) - 1

    def replace(self, row: int, shape: BaseGeometry) -> None:
        """Give the object in a row another shape."""
        self.shapes[row] = shape
        self.boxes[row] = shapely.bounds(shape)
        self.areas[row] = shapely.area(shape)

    def remove(self, rows: Rows) -> None:
        """Remove some rows."""
        self.classes = np.delete(self.classes, rows)
        self.shapes = np.delete(self.shapes, rows)
        self.boxes = np.delete(self.boxes, rows, axis=0)
        self.areas = np.delete(self.areas, rows)
        self.heights = np.delete(self.heights, rows, axis=0)

    def near(self, class_: int | None, box: NDArray[np.float64]) -> Rows:
        """Return the rows of a class, or of all classes, whose boxes meet a box."""
        boxes = self.boxes
        return np.flatnonzero(
            (class_ is None or self.classes == class_)
            & (boxes[:, 0] <= box[2])
            & (boxes[:, 1] <= box[3])
            & (boxes[:, 2] >= box[0])
            & (boxes[:, 3] >= box[1])
        )


def jaccard(shape: BaseGeometry, class_: int, known: KnownShapes, config: EvidenceConfig) -> Rows:
    """Match by shared area over the area of both together, at least `min_jaccard`."""
    rows, shared = _shared_area(shape, class_, known)
    together = shapely.area(shape) + known.areas[rows] - shared
    return _best_first(rows, shared / together, config.min_jaccard)


def overlap(shape: BaseGeometry, class_: int, known: KnownShapes, config: EvidenceConfig) -> Rows:
    """Match by shared area over the smaller one's area, at least `min_overlap`.

    Unlike the Jaccard index it also finds the table of which a frame shows one corner. The larger
    shape is widened by `slack`, so that a thin thing meets itself when poses are a little off.
    """
    if config.slack == 0:
        rows, shared = _shared_area(shape, class_, known)
    else:
        rows, shared = _shared_with_slack(shape, class_, known, config.slack)
    smaller = np.minimum(shapely.area(shape), known.areas[rows])
    return _best_first(rows, shared / smaller, config.min_overlap)


def radius(shape: BaseGeometry, class_: int, known: KnownShapes, config: EvidenceConfig) -> Rows:
    """Match what reaches into a box of half side `radius` about the shape's centroid."""
    center = shapely.get_coordinates(shapely.centroid(shape))[0]
    box = shapely.box(*(center - config.radius), *(center + config.radius))
    rows = known.near(class_, shapely.bounds(box))
    rows = rows[shapely.intersects(box, known.shapes[rows])]
    distances = shapely.distance(shapely.Point(center), known.shapes[rows])
    return np.asarray(rows[np.argsort(distances, kind="stable")])


Association: TypeAlias = Callable[[BaseGeometry, int, KnownShapes, EvidenceConfig], Rows]

ASSOCIATIONS: Mapping[str, Association] = {
    "jaccard": jaccard,
    "overlap": overlap,
    "radius": radius,
}


def _shared_area(
    shape: BaseGeometry, class_: int, known: KnownShapes
) -> tuple[Rows, NDArray[np.float64]]:
    """Return the rows that may match, and the area that each shares with the shape [m²]."""
    rows = known.near(class_, shapely.bounds(shape))
    return rows, shapely.area(shapely.intersection(shape, known.shapes[rows]))


def _shared_with_slack(
    shape: BaseGeometry, class_: int, known: KnownShapes, slack: float
) -> tuple[Rows, NDArray[np.float64]]:
    """Return the same, where the larger shape of each pair is widened.

    By a quarter of its size at most: two cups that stand close together stay two.
    """
    wide = _widened(shape, shapely.area(shape), slack)
    rows = known.near(class_, shapely.bounds(wide))
    smaller, larger = known.shapes[rows], np.full(len(rows), wide, dtype=object)
    is_larger = known.areas[rows] > shapely.area(shape)
    larger[is_larger] = _widened(smaller[is_larger], known.areas[rows][is_larger], slack)
    smaller[is_larger] = shape
    return rows, shapely.area(shapely.intersection(smaller, larger))


def _widened(shapes: Any, areas: Any, slack: float) -> Any:
    return shapely.buffer(shapes, np.minimum(slack, np.sqrt(areas) / 4), join_style="mitre")


def _best_first(rows: Rows, strengths: NDArray[np.float64], least: float) -> Rows:
    """Return the rows that match well enough; of equal ones the oldest object first."""
    enough = (strengths >= least) & (strengths > 0)
    return np.asarray(rows[enough][np.argsort(-strengths[enough], kind="stable")])
