"""Shapes of objects: well-known text in, and exact well-known text out."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
import pydantic_core
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, ObjectArray, as_objects

_RING = re.compile(r"\(([^()]*)\)")
_NUMBER = b"-+0123456789.eE"
_TO_COMMAS = bytes.maketrans(b" \n", b",,")
_AT_ONCE = 4096  # footprints
_EXPONENTS = 1e-4, 1e15  # between them, no number is written with an exponent


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


def footprints_from_wkt(texts: Sequence[str]) -> ObjectArray:
    """Return `footprint_from_wkt` of each text, shape (N,); polygons of one ring take far less.

    Raises:
        ValueError: As there, of one of the texts.
    """
    simple = _single_rings("\n".join(texts).encode()) if texts else None
    if simple is None or len(simple) != len(texts):
        return as_objects(map(footprint_from_wkt, texts))
    return simple


def footprints_to_wkt(footprints: ObjectArray) -> list[str]:
    """Return `footprint_to_wkt` of each footprint; polygons of one ring take far less."""
    texts: list[str] = []
    for start in range(0, len(footprints), _AT_ONCE):
        some = footprints[start : start + _AT_ONCE]
        simple = _are_simple(some)
        outlines = iter(_outlines_to_wkt(some[simple]))
        texts += [
            next(outlines) if is_simple else footprint_to_wkt(footprint)
            for footprint, is_simple in zip(some, simple.tolist(), strict=True)
        ]
    return texts


def _are_simple(footprints: ObjectArray) -> BoolArray:
    """Return which are polygons of one ring, whose numbers are written without an exponent."""
    simple = np.asarray(shapely.get_type_id(footprints) == shapely.GeometryType.POLYGON)
    simple &= shapely.get_num_interior_rings(footprints) == 0
    points, owners = shapely.get_coordinates(footprints, return_index=True)
    sizes = np.abs(points)
    has_exponent = (sizes != 0) & ~((sizes >= _EXPONENTS[0]) & (sizes < _EXPONENTS[1]))
    simple[owners[has_exponent.any(axis=1)]] = False
    return simple


def _outlines_to_wkt(polygons: ObjectArray) -> list[str]:
    """Return the texts of such polygons, from JSON, which is written several times as fast."""
    if not len(polygons):
        return []
    points, owners = shapely.get_coordinates(polygons, return_index=True)
    starts = np.flatnonzero(np.diff(owners, prepend=-1)).tolist()
    pairs = points.tolist()
    outlines = [pairs[a:b] for a, b in zip(starts, [*starts[1:], len(pairs)], strict=True)]
    text = pydantic_core.to_json(outlines).decode()[3:-3].replace(".0,", ",").replace(".0]", "]")
    text = text.removesuffix(".0").replace("]],[[", ";").replace("],[", "|").replace(",", " ")
    return [f"POLYGON(({ring}))" for ring in text.replace("|", ", ").split(";")]


def _single_rings(text: bytes) -> ObjectArray | None:
    """Return the polygons of lines of well-known text; None where one has not just one ring."""
    lines = text.count(b"\n") + 1
    if text.startswith(b"POLYGON (("):
        text = text.replace(b"POLYGON ((", b"POLYGON((")
    if not (text.startswith(b"POLYGON((") and text.count(b"\nPOLYGON((") == lines - 1):
        return None
    if not (text.endswith(b"))") and text.count(b"))\n") == lines - 1):
        return None
    numbers = text.translate(None, b"POLYGN()")
    if len(numbers) != len(text) - lines * len(b"POLYGON(())"):  # such letters elsewhere
        return None
    numbers = numbers.replace(b", ", b",")
    between = numbers.translate(None, _NUMBER) + b"\n"
    # x and y are parted by a blank, points by a comma, and rings by the end of the line.
    if between[0::2].strip(b" ") or between[1::2].translate(None, b",\n"):
        return None
    try:
        values = pydantic_core.from_json(b"[" + numbers.translate(_TO_COMMAS) + b"]")
        points = np.array(values, dtype=np.float64).reshape(-1, 2)
    except (ValueError, OverflowError):  # a number that JSON does not know
        return None
    ends = np.flatnonzero(np.frombuffer(between[1::2], np.uint8) == ord("\n")) + 1
    return _polygons(points, ends) if len(ends) == lines else None


def _polygons(points: NDArray[np.float64], ends: NDArray[np.int64]) -> ObjectArray | None:
    """Return polygons of one ring each, closing those that are open; None if one is too short."""
    starts = np.append(0, ends[:-1])
    is_open = (points[starts] != points[ends - 1]).any(axis=1)
    if (ends - starts + is_open).min() < 4:
        return None
    points = np.insert(points, ends[is_open], points[starts[is_open]], axis=0)
    offsets = np.append(0, ends + np.cumsum(is_open))
    polygons: ObjectArray = shapely.from_ragged_array(
        shapely.GeometryType.POLYGON, points, (offsets, np.arange(len(offsets)))
    )
    return polygons


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
