"""Areas that a camera is to cover, chosen on the page where a node serves the map."""

from __future__ import annotations

from typing import Any, Protocol

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.frames import Pose2D
from hypermap.exploration.coverage import Coverage
from hypermap.viewer.live.shapes import polygons_in_base

_DECIMALS = 3  # of meters


class AreaMapping(Protocol):
    """Lets a camera cover an area, as `automap` of the map server does."""

    def begin(self, area: BaseGeometry) -> None:
        """Begin with an area of the base frame.

        Raises:
            HypermapError: If that is not possible.
        """

    def coverage(self) -> Coverage | None:
        """Return what is covered by now; None while there is no area."""


def describe_coverage(coverage: Coverage | None) -> dict[str, Any] | None:
    """Return what the page shows of a coverage: areas [m2] and polygons in the base frame."""
    if coverage is None:
        return None
    shapes = as_objects([coverage.area, coverage.rest])
    area, rest = polygons_in_base(shapes, Pose2D(), _DECIMALS)
    return {
        "area": area,
        "size": round(float(shapely.area(coverage.area)), _DECIMALS),
        "share": coverage.share,
        "rest": rest,
        "rest_size": round(float(shapely.area(coverage.rest)), _DECIMALS),
    }
