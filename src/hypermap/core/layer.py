"""The queries that every layer answers."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, PointsLike, as_point_xy
from hypermap.core.grid import GridGeometry


class Store(Protocol):
    """The storage of a layer's files; a layer does not know whether it is a zip or a folder."""

    @property
    def folder(self) -> Path | None:
        """The folder in which the map is; None if it was not read from a file."""
        ...

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            FormatError: If there is no such file, or it is larger than the store's limit.
        """
        ...

    def write(self, name: str, content: bytes) -> None:
        """Write a file."""
        ...

    def path_of(self, name: str) -> str:
        """Return the name of a file for messages, such as "office.hmap/semantic"."""
        ...


@dataclass(frozen=True, eq=False)
class Hits:
    """The contents of an area: one value and one location per cell or object.

    Attributes:
        values: labels (str) or numbers, shape (M,).
        points_xy: locations [m], shape (M, 2).
    """

    values: NDArray[Any]
    points_xy: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.points_xy.shape != (len(self.values), 2):
            raise ValueError(
                f"expected points of shape ({len(self.values)}, 2), got {self.points_xy.shape}"
            )

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True, eq=False)
class RasterPicture:
    """A layer drawn as an image over a grid.

    Attributes:
        grid: the geometry of the pixels; row 0 is at the origin, as in the layer.
        rgba: uint8, shape (height, width, 4).
        legend: label -> (r, g, b), 0..255; may be empty.
    """

    grid: GridGeometry
    rgba: NDArray[np.uint8]
    legend: Mapping[str, tuple[int, int, int]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ShapesPicture:
    """A layer drawn as filled shapes, one color per name.

    Attributes:
        names: shape (N,), str.
        shapes: shapely geometries in the layer's frame, shape (N,).
    """

    names: ObjectArray
    shapes: ObjectArray


class Layer(ABC):
    """A store of values in one frame, with queries.

    Points and areas are given, and locations returned, in the layer's own frame [m];
    `Hypermap` turns other frames into it.

    Attributes:
        class_name: the name of this kind of layer in configuration files.
        name: unique within the map.
        frame_id: the frame of the layer's coordinates.
        settings: keys of the layer's configuration that the core does not interpret; they are
            written back unchanged.
    """

    class_name: ClassVar[str]

    def __init__(self, name: str, frame_id: str, settings: Mapping[str, Any] | None = None) -> None:
        if not name:
            raise ValueError("a layer needs a name")
        if not frame_id:
            raise ValueError(f"layer {name!r} needs a frame_id")
        self.name = name
        self.frame_id = frame_id
        self.settings: dict[str, Any] = dict(settings or {})

    def __repr__(self) -> str:
        held = self.summary()
        kind = type(self).__name__
        return f"<{kind} {self.name!r} in frame {self.frame_id!r}{held and ': ' + held}>"

    def summary(self) -> str:
        """Return a short summary of the layer, such as "2 objects (1 cup, 1 table)"."""
        return ""

    @abstractmethod
    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Return the label at each point, shape (N,)."""

    def labels_at(self, point_xy: PointsLike) -> ObjectArray:
        """Return all labels at one point, that of `label_at` first, shape (M,)."""
        return self.label_at(as_point_xy(point_xy))

    @abstractmethod
    def value_at(self, points_xy: PointsLike) -> NDArray[Any]:
        """Return the value at each point, shape (N,)."""

    @abstractmethod
    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return every hit in an area, as labels."""

    @abstractmethod
    def values_in(self, area: BaseGeometry) -> Hits:
        """Return every hit in an area, as values."""

    @abstractmethod
    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return where a label or value occurs, in the whole layer or in an area, shape (M, 2).

        The answer is that of `labels_in` (for a label) or `values_in` (for a value), reduced to
        the hits that are equal to `what`.
        """

    def nearest(
        self, what: str | float, point_xy: PointsLike, k: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the k occurrences of a label or value that are nearest to a point.

        Returns:
            Locations (K, 2) and distances (K,) [m], nearest first; K is at most `k`.

        Raises:
            ValueError: If `k` is below 1.
        """
        check_count(k)
        point = as_point_xy(point_xy)
        locations = self.find(what)
        distances = np.hypot(*(locations - point).T)
        order = np.argsort(distances, kind="stable")[:k]
        return locations[order], distances[order]

    @abstractmethod
    def extent(self) -> BaseGeometry:
        """Return an area that covers the whole layer; empty if the layer is empty."""

    def picture(self) -> RasterPicture | ShapesPicture | None:
        """Return how pictures of the map show this layer; None if they do not."""
        return None


def check_count(k: int) -> None:
    """Raise a ValueError if `k` is less than 1, and a TypeError if it is no integer."""
    if operator.index(k) < 1:
        raise ValueError(f"k must be at least 1, got {k}")
