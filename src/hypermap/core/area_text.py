"""Areas as well-known text, as people and programs send them."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.tangles import check_tangle, is_sound


def area_from_wkt(text: str) -> BaseGeometry:
    """Return the area that well-known text describes.

    Raises:
        ValueError: If it is none, is empty, crosses itself, or is more than GEOS can be given.

    >>> area_from_wkt("POLYGON((0 0, 2 0, 2 1, 0 0))").area
    1.0
    """
    if text.upper().count("COLLECTION") > 1:  # GEOS overflows the stack on deep nesting
        raise ValueError("a collection in a collection is not read")
    try:
        with np.errstate(all="ignore"):  # of numbers that are not finite
            area: BaseGeometry = shapely.from_wkt(text)
    except (shapely.GEOSException, NotImplementedError) as error:
        raise ValueError(f"this is not WKT: {error}") from None
    check_area(area)
    return area


def check_area(area: BaseGeometry) -> None:
    """Check an area that comes from outside; raises like `area_from_wkt`."""
    if not np.isfinite(shapely.get_coordinates(area)).all():
        raise ValueError("the numbers of an area must be finite")
    check_tangle(area)
    if area.area == 0 or not is_sound(area):
        raise ValueError("the area is empty, has an empty hole, or its outline crosses itself")
