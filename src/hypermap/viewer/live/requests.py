"""Parsing and checking of requests: bodies, numbers, points, polygons."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry
from starlette.datastructures import QueryParams
from starlette.requests import Request

from hypermap.core.tangles import check_tangle
from hypermap.viewer.live.request_errors import Refused

MOST_BYTES = 8_000_000
"""Size of the largest request body."""
MOST_CORNERS = 10_000
"""Corners of the largest shape of an object."""
MOST_METRES = 100_000
"""Width and height of the largest shape of an object; the page cannot show more at once."""
MOST_ASKED_CORNERS = 2_000
"""Corners of the largest area that is asked about; each costs time on a large grid."""

_FAR = 1e9  # meters


async def read_body(request: Request) -> dict[str, Any]:
    """Return the JSON object that a request carries.

    Raises:
        Refused: If it is too large or no JSON object.
    """
    content = bytearray()
    async for part in request.stream():
        content += part
        if len(content) > MOST_BYTES:
            raise Refused(f"the request is larger than {MOST_BYTES // 1_000_000} MB", 413)
    try:
        body = json.loads(content)
    except (ValueError, RecursionError):
        raise Refused("the request's body is not valid JSON") from None
    if not isinstance(body, dict):
        raise Refused("the request's body must be a JSON object")
    return body


def number_in(values: Mapping[str, Any], key: str) -> float:
    """Return a finite number of a request.

    Raises:
        Refused: If it is missing or none.
    """
    return _number(values.get(key), key)


def whole_number_in(values: Mapping[str, Any], key: str) -> int:
    """Return an integer of a request; raises like `number_in`."""
    value = values.get(key)
    try:
        if isinstance(value, bool) or not isinstance(value, int | str):
            raise ValueError
        return int(value)
    except ValueError:
        raise Refused(f"{key}: a whole number is expected, got {_shown(value)}") from None


def numbers_in(values: QueryParams, key: str) -> list[float]:
    """Return finite numbers separated by commas; raises like `number_in`."""
    words = values.get(key, "").split(",")
    if len(words) > 2 * MOST_CORNERS:
        _refuse_corners(len(words) // 2)
    return [_number(word, key) for word in words]


def point_in(values: Mapping[str, Any], key: str) -> tuple[float, float]:
    """Return a point "x,y"; raises like `number_in`."""
    words = str(values.get(key, "")).split(",")
    if len(words) != 2:
        raise Refused(f"{key}: expected x,y, got {_shown(values.get(key))}")
    return _number(words[0], key), _number(words[1], key)


def box_in(values: QueryParams, key: str) -> tuple[float, float, float, float]:
    """Return a rectangle "xmin,ymin,xmax,ymax"; raises like `number_in`."""
    numbers = numbers_in(values, key)
    if len(numbers) != 4 or numbers[0] > numbers[2] or numbers[1] > numbers[3]:
        raise Refused(f"{key}: expected xmin,ymin,xmax,ymax, got {_shown(values.get(key))}")
    return numbers[0], numbers[1], numbers[2], numbers[3]


def text_in(values: Mapping[str, Any], key: str) -> str | None:
    """Return a text of a request; None where it is missing or empty.

    Raises:
        Refused: If it is something else.
    """
    value = values.get(key)
    if value is not None and not isinstance(value, str):
        raise Refused(f"{key}: a text is expected, got {_shown(value)}")
    return value or None


def corners_in(values: Mapping[str, Any], key: str) -> list[list[float]]:
    """Return the corners of a polygon, given as a list of points, or as "x,y,x,y,...".

    Raises:
        Refused: If it is none, has too many corners, no area, or its outline crosses itself.
    """
    if isinstance(values, QueryParams):
        numbers = numbers_in(values, key)
        given: Any = [numbers[i : i + 2] for i in range(0, len(numbers), 2)]
    else:
        given = values.get(key)
    corners = _ring(given, key, MOST_ASKED_CORNERS)
    _polygon([corners], key)
    return corners


def line_in(values: Mapping[str, Any], key: str) -> LineString:
    """Return a line, given as a list of at least two points.

    Raises:
        Refused: If it is none, has too many points, or no length.
    """
    points = _points(values.get(key), key, MOST_ASKED_CORNERS)
    if len(points) < 2 or all(point == points[0] for point in points):
        raise Refused(f"{key}: a line needs at least two different points")
    return LineString(points)


def footprint_in(values: Mapping[str, Any]) -> BaseGeometry | None:
    """Return the shape that an operation gives an object; None where it gives none.

    It stands under `polygon`, a list of corners, or under `polygons`, where each polygon is a list
    of rings, the outline first.

    Raises:
        Refused: If it is not a shape, has too many corners, no area, is larger than a city, or its
            outline crosses itself.
    """
    if values.get("polygon") is not None:
        return _of_size(_polygon([_ring(values["polygon"], "polygon")], "polygon"), "polygon")
    if values.get("polygons") is None:
        return None
    return _of_size(_polygons(values["polygons"]), "polygons")


def _polygons(given: Any) -> BaseGeometry:
    if not isinstance(given, list) or not given or not all(isinstance(p, list) for p in given):
        raise Refused("polygons: a list of polygons is expected, each a list of rings")
    count = sum(len(ring) for part in given for ring in part if isinstance(ring, list))
    if count > MOST_CORNERS:
        _refuse_corners(count)
    parts = [
        _polygon([_ring(ring, "polygons") for ring in rings] or [[]], "polygons") for rings in given
    ]
    shape: BaseGeometry = parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)
    _check_tangle(shape, "polygons")
    if not shape.is_valid:
        raise Refused("polygons: the parts of the shape overlap")
    return shape


def _of_size(shape: BaseGeometry, key: str) -> BaseGeometry:
    x0, y0, x1, y1 = shape.bounds
    side = max(x1 - x0, y1 - y0)
    if side > MOST_METRES:
        raise Refused(
            f"{key}: the shape is {side / 1000:.0f} km long, more than {MOST_METRES // 1000} km; "
            "corners are given in meters"
        )
    return shape


def _points(given: Any, key: str, most: int) -> list[list[float]]:
    if not isinstance(given, list):
        raise Refused(f"{key}: a list of corners [x, y] is expected, got {_shown(given)}")
    if len(given) > most:
        _refuse_corners(len(given), most)
    if any(not isinstance(corner, list) or len(corner) != 2 for corner in given):
        raise Refused(f"{key}: each corner must be a point [x, y]")
    return [[_number(x, key), _number(y, key)] for x, y in given]


def _ring(given: Any, key: str, most: int = MOST_CORNERS) -> list[list[float]]:
    corners = _points(given, key, most)
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if len(corners) < 3:
        raise Refused(f"{key}: a polygon needs at least three corners, got {len(corners)}")
    return corners


def _polygon(rings: list[list[list[float]]], key: str) -> shapely.Polygon:
    if not rings[0]:
        raise Refused(f"{key}: a polygon needs an outline")
    polygon = shapely.Polygon(rings[0], rings[1:])
    _check_tangle(polygon, key)
    if not polygon.is_valid:
        raise Refused(f"{key}: {_fault(polygon)}")
    if polygon.area == 0:
        raise Refused(f"{key}: the polygon has no area")
    return polygon


def _check_tangle(shape: BaseGeometry, key: str) -> None:
    try:
        check_tangle(shape)
    except ValueError as error:
        raise Refused(f"{key}: {error}") from None


def _fault(polygon: shapely.Polygon) -> str:
    """Return what is wrong with an invalid polygon, and where, as GEOS finds it."""
    reason, _, place = shapely.is_valid_reason(polygon).rstrip("]").partition("[")
    if "Self-intersection" in reason:
        what = "the outline crosses itself"
    elif "Too few points" in reason:
        what = "fewer than three corners differ"
    else:
        what = "a hole is not inside the outline, or touches another"
    x, y = map(float, place.split()[:2])
    return f"{what}, near ({x:.2f}, {y:.2f})"


def _number(value: Any, key: str) -> float:
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        number = float(value)
        if not abs(number) <= _FAR:
            raise ValueError
    except (ValueError, OverflowError):
        raise Refused(
            f"{key}: a number within {_FAR:g} m is expected, got {_shown(value)}"
        ) from None
    return number


def _refuse_corners(count: int, most: int = MOST_CORNERS) -> None:
    raise Refused(f"the polygon has {count} corners, more than {most}; draw it coarser")


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
