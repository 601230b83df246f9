"""Points and areas as people write them."""

from __future__ import annotations

import math
import re

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import HypermapError
from hypermap.core.tangles import check_tangle


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
    if text.strip()[:1].isalpha():
        return _area_from_wkt(text, option)
    numbers = _numbers(text)
    if len(numbers) == 4 and len(text.split()) == 1:
        x0, y0, x1, y1 = numbers
        area = shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    elif len(numbers) >= 6 and len(numbers) % 2 == 0:
        area = shapely.Polygon(list(zip(numbers[::2], numbers[1::2], strict=True)))
    else:
        raise HypermapError(
            f"{option} {text!r}: an area is a rectangle X0,Y0,X1,Y1, at least three corners "
            "X,Y X,Y X,Y, or WKT, in meters"
        )
    return _checked(area, text, option)


def names_rooms(text: str) -> bool:
    """Return whether a text is neither numbers nor WKT, so that it names rooms."""
    shapes = "(MULTI)?(POINT|LINESTRING|LINEARRING|POLYGON)|GEOMETRYCOLLECTION"
    return re.match(rf"\s*([-+.\d]|({shapes})\b)", text, re.IGNORECASE) is None


def _area_from_wkt(text: str, option: str) -> BaseGeometry:
    if text.upper().count("COLLECTION") > 1:  # GEOS overflows the stack on deep nesting
        raise HypermapError(f"{option}: a collection in a collection is not read")
    try:
        with np.errstate(all="ignore"):  # of numbers that are not finite
            area = shapely.from_wkt(text)
    except (shapely.GEOSException, NotImplementedError) as error:
        raise HypermapError(f"{option} {text!r}: this is not WKT: {error}") from None
    return _checked(area, text, option)


def _checked(area: BaseGeometry, text: str, option: str) -> BaseGeometry:
    if not np.isfinite(shapely.get_coordinates(area)).all():
        raise HypermapError(f"{option}: the numbers of an area must be finite")
    try:
        check_tangle(area)
    except ValueError as error:
        raise HypermapError(f"{option}: {error}") from None
    if area.area == 0 or not area.is_valid:
        raise HypermapError(f"{option} {text!r}: the area is empty, or its outline crosses itself")
    return area


def _numbers(text: str) -> list[float]:
    """Return finite numbers separated by commas or blanks; nothing if one is none."""
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []
