"""Polygons with one ring (nearly all footprints): many at once, from text and binary.

If even one shape is not of this kind, the general readers read them all, so that only they
report errors.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray
from hypermap.core.shapes import can_be_corners
from hypermap.core.tangles import are_untangled
from hypermap.formats.columns.numbers import numbers_from_json

_NUMBER = b"-+0123456789.eE"
_DENSE = re.compile(rb"POLYGON\(\( (?:, )*\)\)")  # 0 0,1 0,1 1 without the numbers
_SPACED = re.compile(rb"POLYGON\(\( (?:,  )*\)\)")  # 0 0, 1 0, 1 1
# To JSON: a comma after each number, and blanks instead of everything else.
_DENSE_TO_JSON = bytes.maketrans(b"POLYGN() \n", b"        ,,")
_SPACED_TO_JSON = bytes.maketrans(b"POLYGN(), \n", b"         ,,")
_WKB_HEAD = np.dtype([("order", "u1"), ("kind", "<u4"), ("rings", "<u4"), ("corners", "<u4")])
_WKB_POINT = np.dtype("V16")
_LITTLE_ENDIAN = 1
_FEWEST_CORNERS = 4  # of a ring that ends where it begins


def outlines_from_wkt(lines: bytes) -> ObjectArray | None:
    """Return the polygons of lines of well-known text, (N,); None if one has not just one ring.

    None as well where a polygon is none that an object can have, or the text is not plain.
    """
    lines = lines.replace(b"POLYGON ((", b"POLYGON((") if b" ((" in lines[:10] else lines
    for end in (b" ", b",", b")"):  # as integers, these would lose their sign
        lines = lines.replace(b"-0" + end, b"-0.0" + end)
    is_spaced = b", " in lines
    skeletons = lines.translate(None, _NUMBER).split(b"\n")
    pattern, to_json = (_SPACED, _SPACED_TO_JSON) if is_spaced else (_DENSE, _DENSE_TO_JSON)
    known = {s: s.count(b",") + 1 if pattern.fullmatch(s) else 0 for s in set(skeletons)}
    corners = np.array([known[skeleton] for skeleton in skeletons])
    if not corners.all():
        return None
    letters = np.frombuffer(lines, np.uint8)
    if ((letters[:-1] == ord(" ")) & (letters[1:] == ord(","))).any():  # as in 0 0, 1 ,0 1 1
        return None
    try:
        values = numbers_from_json(lines.translate(to_json))
    except (ValueError, OverflowError):
        return None
    points, ends = values.reshape(-1, 2), np.cumsum(corners)
    is_open = _are_open(points, ends)
    if is_open.any():
        firsts = points[ends - corners]
        points = np.insert(points, ends[is_open], firsts[is_open], axis=0)
        ends = ends + np.cumsum(is_open)
    return _polygons(points, ends)


def outlines_from_wkb(data: NDArray[np.uint8], bounds: NDArray[np.int64]) -> ObjectArray | None:
    """Return polygons from well-known binary, one after the other.

    Args:
        data: the bytes.
        bounds: where each polygon begins, and where the last one ends, shape (N+1,).

    Returns:
        Shape (N,); None where one has not just one ring, or is none that an object can have.
    """
    starts, lengths = bounds[:-1], np.diff(bounds)
    if (lengths < _WKB_HEAD.itemsize + _WKB_POINT.itemsize).any():
        return None
    head = _at_any_byte(data, _WKB_HEAD)[starts]
    corners = head["corners"].astype(np.int64)
    is_outline = (head["order"] == _LITTLE_ENDIAN) & (head["rings"] == 1)
    is_outline &= head["kind"] == shapely.GeometryType.POLYGON
    is_outline &= lengths == _WKB_HEAD.itemsize + _WKB_POINT.itemsize * corners
    if not is_outline.all():
        return None
    ends = np.cumsum(corners)
    shifts = starts + _WKB_HEAD.itemsize - _WKB_POINT.itemsize * (ends - corners)
    places = np.repeat(shifts, corners) + _WKB_POINT.itemsize * np.arange(ends[-1])
    points = _at_any_byte(data, _WKB_POINT)[places].view("<f8").reshape(-1, 2)
    return None if _are_open(points, ends).any() else _polygons(points, ends)


def _at_any_byte(data: NDArray[np.uint8], kind: np.dtype[Any]) -> NDArray[Any]:
    """Return the value that begins at each byte."""
    return np.ndarray((len(data) - kind.itemsize + 1,), kind, data, strides=(1,))


def _are_open(points: NDArray[np.float64], ends: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which of the concatenated rings are not closed."""
    whole = points.view(np.complex128)[:, 0]  # points as single numbers
    return np.asarray(whole[np.append(0, ends[:-1])] != whole[ends - 1])


def _polygons(points: NDArray[np.float64], ends: NDArray[np.int64]) -> ObjectArray | None:
    """Return polygons of one closed ring each; None if one of them is not a valid footprint."""
    bounds = np.append(0, ends)
    if np.diff(bounds).min() < _FEWEST_CORNERS or not can_be_corners(points):
        return None
    polygons: ObjectArray = shapely.from_ragged_array(
        shapely.GeometryType.POLYGON, points, (bounds, np.arange(len(bounds)))
    )
    return polygons if are_untangled(polygons).all() else None
