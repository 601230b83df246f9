"""How large things are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.objects import SemanticObject


@dataclass(frozen=True)
class Size:
    """The size of an object or a room.

    Attributes:
        length: of the smallest rectangle around its shape, the longer side [m].
        width: the shorter side [m].
        area: of its shape [m^2].
        z_min: height of its lowest point above the floor [m]; None if the map does not have it.
        z_max: of its highest point.
    """

    length: float
    width: float
    area: float
    z_min: float | None = None
    z_max: float | None = None

    def __str__(self) -> str:
        """Return it as a person reads it."""
        text = f"{self.length:.2f} x {self.width:.2f} m, {_area(self.area)}"
        if self.z_min is None or self.z_max is None:
            return text
        return f"{text}, from {max(self.z_min, 0.0):.2f} to {self.z_max:.2f} m high"


def size_of(shape: BaseGeometry, heights: tuple[Any, Any] = (None, None)) -> Size:
    """Return the size of a shape, with the heights of its lowest and highest point.

    >>> str(size_of(shapely.box(0, 0, 1.2, 0.6), (0.0, 0.74)))
    '1.20 x 0.60 m, 0.72 m², from 0.00 to 0.74 m high'
    """
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape))
    sides = [0.0, float(shape.length)]  # of a point or a line
    if len(corners) > 2:
        sides = np.hypot(*np.diff(corners[:3], axis=0).T).tolist()
    low, high = map(height_of, heights)
    return Size(max(sides), min(sides), float(shape.area), low, high)


def size_of_object(thing: SemanticObject) -> Size:
    """Return the size of an object, with the heights that were measured."""
    return size_of(thing.footprint, (thing.attributes.get("z_min"), thing.attributes.get("z_max")))


def height_of(value: Any) -> float | None:
    """Return a height as a file has it [m]; None if it is no number, or larger than any float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:  # an integer of 400 digits
        return None


def _area(square_meters: float) -> str:
    if square_meters < 0.1:
        return f"{square_meters * 1e4:.0f} cm²"
    return f"{square_meters:.2f} m²" if square_meters < 10 else f"{square_meters:.1f} m²"
