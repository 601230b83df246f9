"""Shapes of objects as well-known text, without loss."""

from __future__ import annotations

import contextlib
import math
import re
import struct

import numpy as np
import pydantic_core
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, ObjectArray
from hypermap.text import counted

_RING = re.compile(r"\(([^()]*)\)")
_AT_ONCE = 4096  # footprints
_EXPONENTS = 1e-4, 1e15  # between them, no number is written with an exponent
_SMALL_WKB = 4096  # bytes; too small for harmfully deep nesting
_WITH_SRID = 0x20000000


def footprint_from_wkt(text: str) -> BaseGeometry:
    """Return the geometry; rings of polygons may be left open, and wind either way.

    Raises:
        ValueError: Saying what is wrong with the text. Whether an object can have the shape is
            not looked at.

    >>> print(footprint_from_wkt("POLYGON((0 0, 2 0, 2 1))"))
    POLYGON ((0 0, 2 0, 2 1, 0 0))
    """
    if "COLLECTION" in text.upper():  # of collections: GEOS overflows the stack on deep nesting
        raise ValueError("its shape must be a polygon or multipolygon, not a collection")
    try:
        return _from_wkt(text)
    except (shapely.errors.GEOSException, NotImplementedError):  # the latter for curves
        closed = _RING.sub(_close_ring, text)
    try:
        return _from_wkt(closed)
    except (shapely.errors.GEOSException, NotImplementedError) as error:
        reason = str(error).partition("Exception: ")[2] or str(error)
        raise ValueError(f"its shape is not well-known text: {reason}") from None


def footprints_from_wkb(binaries: ObjectArray) -> ObjectArray:
    """Return the geometries of well-known binary, shape (N,).

    Raises:
        ValueError: If one is none, or large and no polygon or multipolygon in the plane. Whether
            objects can have the others is not looked at.
        TypeError: If one is not of bytes.
    """
    for binary in binaries:
        if not isinstance(binary, bytes):
            raise TypeError(f"well-known binary must be bytes, got {type(binary).__name__}")
        if len(binary) > _SMALL_WKB and not _is_flat(binary):
            raise ValueError("a footprint must be a polygon or multipolygon in the plane")
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # of coordinates that are not finite
            shapes: ObjectArray = shapely.from_wkb(binaries)
    except shapely.errors.ShapelyError as error:
        raise ValueError(f"is not well-known binary: {error}") from None
    return shapes


def footprint_to_wkt(footprint: BaseGeometry) -> str:
    """Return text from which exactly the same coordinates are read (unlike from GEOS' own text).

    >>> footprint_to_wkt(shapely.Polygon([(0, 0), (0.1 + 0.2, 0), (1, 1)]))
    'POLYGON((0 0, 0.30000000000000004 0, 1 1, 0 0))'
    """
    if isinstance(footprint, shapely.Polygon):
        return f"POLYGON{_rings_text(footprint)}"
    if isinstance(footprint, shapely.MultiPolygon):
        return f"MULTIPOLYGON({', '.join(_rings_text(part) for part in footprint.geoms)})"
    raise TypeError(f"a footprint is a polygon or multipolygon, not a {footprint.geom_type}")


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
    """Return which shapes are polygons of one ring whose numbers need no exponent."""
    simple = np.asarray(shapely.get_type_id(footprints) == shapely.GeometryType.POLYGON)
    simple &= shapely.get_num_interior_rings(footprints) == 0
    points, owners = shapely.get_coordinates(footprints, return_index=True)
    sizes = np.abs(points)
    has_exponent = (sizes != 0) & ~((sizes >= _EXPONENTS[0]) & (sizes < _EXPONENTS[1]))
    simple[owners[has_exponent.any(axis=1)]] = False
    return simple


def _outlines_to_wkt(polygons: ObjectArray) -> list[str]:
    """Return the texts of such polygons, by way of JSON, which is several times as fast."""
    if not len(polygons):
        return []
    points, owners = shapely.get_coordinates(polygons, return_index=True)
    starts = np.flatnonzero(np.diff(owners, prepend=-1)).tolist()
    pairs = points.tolist()
    outlines = [pairs[a:b] for a, b in zip(starts, [*starts[1:], len(pairs)], strict=True)]
    text = pydantic_core.to_json(outlines).decode()[3:-3].replace(".0,", ",").replace(".0]", "]")
    text = text.removesuffix(".0").replace("]],[[", ";").replace("],[", "|").replace(",", " ")
    return [f"POLYGON(({ring}))" for ring in text.replace("|", ", ").split(";")]


def _from_wkt(text: str) -> BaseGeometry:
    with np.errstate(invalid="ignore", over="ignore"):  # of coordinates that are not finite
        return shapely.from_wkt(text)


def _is_flat(wkb: bytes) -> bool:
    """Return whether well-known binary contains a polygon, or only polygons.

    Of collections within collections, many deep, GEOS would overflow the stack.
    """
    with contextlib.suppress(struct.error):  # truncated; GEOS reports that
        kind, order, at = _wkb_head(wkb, 0)
        if kind == shapely.GeometryType.POLYGON:
            return True
        if kind != shapely.GeometryType.MULTIPOLYGON:
            return False
        (parts,) = struct.unpack_from(f"{order}I", wkb, at)
        at += 4
        for _ in range(parts):
            kind, order, at = _wkb_head(wkb, at)
            if kind != shapely.GeometryType.POLYGON:
                return False
            (rings,) = struct.unpack_from(f"{order}I", wkb, at)
            at += 4
            for _ in range(rings):
                (points,) = struct.unpack_from(f"{order}I", wkb, at)
                at += 4 + 16 * points
    return True


def _wkb_head(wkb: bytes, at: int) -> tuple[int, str, int]:
    """Return a geometry's kind, its byte order, and the offset of its contents."""
    order = "<" if struct.unpack_from("B", wkb, at)[0] else ">"
    (kind,) = struct.unpack_from(f"{order}I", wkb, at + 1)
    return kind & ~_WITH_SRID, order, at + (9 if kind & _WITH_SRID else 5)


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
        few = counted(len(points), "point")
        raise ValueError(f"its shape has an outline of {few}; three are needed")
    closed = points if points[0].split() == points[-1].split() else [*points, points[0]]
    return f"({','.join(closed)})"


def _float(text: str) -> float | None:
    """Return a number; None for other text, which the full parser reports."""
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
