"""Shapes of objects: well-known text in, and exact well-known text out."""

from __future__ import annotations

import math
import re

import shapely
from shapely.geometry.base import BaseGeometry

_RING = re.compile(r"\(([^()]*)\)")


def footprint_from_wkt(text: str) -> BaseGeometry:
    """Return the geometry; rings of polygons may be left open, and wind either way.

    Raises:
        ValueError: Saying what is wrong with the text. Whether an object can have the shape is
            not looked at.

    >>> print(footprint_from_wkt("POLYGON((0 0, 2 0, 2 1))"))
    POLYGON ((0 0, 2 0, 2 1, 0 0))
    """
    try:
        return shapely.from_wkt(text)
    except (shapely.errors.GEOSException, NotImplementedError):  # the latter for curves
        closed = _RING.sub(_close_ring, text)
    try:
        return shapely.from_wkt(closed)
    except (shapely.errors.GEOSException, NotImplementedError) as error:
        reason = str(error).partition("Exception: ")[2] or str(error)
        raise ValueError(f"its shape is not well-known text: {reason}") from None


def footprint_to_wkt(footprint: BaseGeometry) -> str:
    """Return text that gives exactly the same coordinates again (GEOS' own text does not).

    >>> footprint_to_wkt(shapely.Polygon([(0, 0), (0.1 + 0.2, 0), (1, 1)]))
    'POLYGON((0 0, 0.30000000000000004 0, 1 1, 0 0))'
    """
    if isinstance(footprint, shapely.Polygon):
        return f"POLYGON{_rings_text(footprint)}"
    if isinstance(footprint, shapely.MultiPolygon):
        return f"MULTIPOLYGON({', '.join(_rings_text(part) for part in footprint.geoms)})"
    raise TypeError(f"a footprint is a polygon or multipolygon, not a {footprint.geom_type}")


def _close_ring(match: re.Match[str]) -> str:
    """Return a ring's text with its first point again at its end.

    Raises:
        ValueError: If there are too few points, or one has not two finite numbers.
    """
    points = match[1].split(",")
    for position, point in enumerate(points):
        numbers = point.split()
        if len(numbers) != 2:
            hint = "; is a comma missing?" if len(numbers) > 2 else ""
            raise ValueError(
                f"point {position} of its shape has {len(numbers)} numbers, not 2{hint}"
            )
        if any(number is not None and not math.isfinite(number) for number in map(_float, numbers)):
            raise ValueError("its shape has a coordinate that is not finite")
    if len(points) < 3:
        raise ValueError(f"its shape has an outline of {len(points)} points; three are needed")
    closed = points if points[0].split() == points[-1].split() else [*points, points[0]]
    return f"({','.join(closed)})"


def _float(text: str) -> float | None:
    """Return a number; None for other text, which the parser of the whole complains about."""
    try:
        return float(text)
    except ValueError:
        return None


def _rings_text(polygon: shapely.Polygon) -> str:
    rings = [polygon.exterior, *polygon.interiors]
    return f"({', '.join(_ring_text(ring) for ring in rings)})"


def _ring_text(ring: shapely.LinearRing) -> str:
    points = shapely.get_coordinates(ring).tolist()
    return f"({', '.join(f'{_number_text(x)} {_number_text(y)}' for x, y in points)})"


def _number_text(number: float) -> str:
    return repr(number).removesuffix(".0")
