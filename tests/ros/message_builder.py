"""Messages as clients send them."""

from __future__ import annotations

import math
from typing import Any

NAN = math.nan

SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]
BOW_TIE = [(0, 0), (2, 2), (2, 0), (0, 2)]
MALFORMED = [
    ([], "0 different points; three are needed"),
    ([(1, 2)], "1 different point"),
    ([(0, 0), (1, 0)], "2 different points"),
    ([(0, 0), (1, 0), (0, 0)], "2 different points"),
    ([(0, 0), (1, 0), (0, 0), (1, 0)], "2 different points"),
    ([(1, 1), (1, 1), (1, 1), (1, 1)], "1 different point"),
    ([(0, 0), (1, 0), (NAN, 1)], "not finite"),
    ([(0, 0), (1, 0), (1, math.inf)], "not finite"),
]


def polygon(types: Any, points: Any) -> Any:
    point = types.message("geometry_msgs/Point32")
    return types.message("geometry_msgs/Polygon")(
        points=[point(x=float(x), y=float(y), z=7.0) for x, y in points]
    )


def area(types: Any, points: Any, frame: str = "map") -> Any:
    message = types.message("geometry_msgs/PolygonStamped")(polygon=polygon(types, points))
    message.header.frame_id = frame
    return types.sent(message)


def item(types: Any, name: str, points: Any, number: int = 0, **others: Any) -> Any:
    return types.message("hypermap_msgs/SemanticObject")(
        id=number, name=name, shape=polygon(types, points), **others
    )


def semantic(types: Any, *items: Any) -> Any:
    return types.sent(types.message("hypermap_msgs/SemanticMap")(objects=list(items)))


def update(types: Any, **fields: Any) -> Any:
    return types.sent(types.message("hypermap_msgs/SemanticMapUpdate")(**fields))
