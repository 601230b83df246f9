"""Points and areas as people write them."""

from __future__ import annotations

import math
import re

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.area_text import area_from_wkt, check_area
from hypermap.core.errors import HypermapError

_LONGEST_SHOWN = 200  # letters of what is refused


def parse_point(text: str, option: str) -> tuple[float, float]:
    """Return x and y from "X,Y".

    Raises:
        HypermapError: If the text is anything else.
    """
    numbers = _numbers(text)
    if len(numbers) != 2:
        raise HypermapError(f"{option} {text!r}: a point is X,Y in meters, such as 1.5,-2")
    return numbers[0], numbers[1]


def parse_area(text: str, option: str) -> BaseGeometry:
    """Return the area that a rectangle "X0,Y0,X1,Y1", corners "X,Y X,Y X,Y ..." or WKT describe.

    Raises:
        HypermapError: If the text is none of these, or the area is empty.
    """
    try:
        if text.strip()[:1].isalpha():
            return area_from_wkt(text)
        area = _area_of_numbers(text)
        check_area(area)
    except ValueError as error:
        raise HypermapError(f"{option} {_shown(text)}: {error}") from None
    return area


def _area_of_numbers(text: str) -> BaseGeometry:
    numbers = _numbers(text)
    if len(numbers) == 4 and len(text.split()) == 1:
        x0, y0, x1, y1 = numbers
        return shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    if len(numbers) >= 6 and len(numbers) % 2 == 0:
        return shapely.Polygon(list(zip(numbers[::2], numbers[1::2], strict=True)))
    raise ValueError(
        "an area is a rectangle X0,Y0,X1,Y1, at least three corners X,Y X,Y X,Y, or WKT, in meters"
    )


def names_rooms(text: str) -> bool:
    """Return whether a text is neither numbers nor WKT, so that it names rooms."""
    shapes = "(MULTI)?(POINT|LINESTRING|LINEARRING|POLYGON)|GEOMETRYCOLLECTION"
    return re.match(rf"\s*([-+.\d]|({shapes})\b)", text, re.IGNORECASE) is None


def _numbers(text: str) -> list[float]:
    """Return finite numbers separated by commas or blanks; nothing if one is none."""
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


def _shown(text: str) -> str:
    return repr(text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]} ...")
