"""Answers with thousands of hits, built from arrays rather than from objects.

On ROS 1 the arrays are written as they are, see `ros1_arrays`. Other middlewares get objects.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.found import Found
from hypermap.core.layer import Hits
from hypermap.core.occupancy import OccupancyLayer
from hypermap.ros.messages.geometry_messages import (
    Message,
    Types,
    header,
    numbers,
    point,
    points,
    quaternion,
)
from hypermap.ros.messages.to_messages import occupancy_grid, semantic_objects
from hypermap.ros.ros1.arrays import takes_arrays, writing_arrays

_NO_NUMBER = -1


class ReplyTypes(Types, Protocol):
    """The classes of messages and of services' responses."""

    def response(self, type_name: str) -> type[Any]:
        """Return the class of a service's response, as of "nav_msgs/GetMap"."""
        ...


def strings_reply(types: ReplyTypes, hits: Hits) -> Message:
    """Return the response of `hypermap_msgs/GetStringsByArea`.

    Args:
        types: the middleware's classes.
        hits: labels, and their locations in the base frame.
    """
    response = writing_arrays(types.response("hypermap_msgs/GetStringsByArea"))
    return response(
        names=_texts(response, hits), locations=_points(response, hits.points_xy, types)
    )


def ints_reply(types: ReplyTypes, hits: Hits) -> Message:
    """Return the response of `hypermap_msgs/GetIntsByArea`, like `strings_reply`."""
    response = writing_arrays(types.response("hypermap_msgs/GetIntsByArea"))
    return response(
        values=numbers(response, as_int32(hits.values)),
        locations=_points(response, hits.points_xy, types),
    )


def locations_reply(types: ReplyTypes, service: str, points_xy: NDArray[np.float64]) -> Message:
    """Return the response of a service that answers with locations alone.

    Args:
        types: the middleware's classes.
        service: "hypermap_msgs/GetLocationsByString" or "hypermap_msgs/GetLocationsByInt".
        points_xy: locations in the base frame, shape (M, 2).
    """
    response = writing_arrays(types.response(service))
    return response(locations=_points(response, points_xy, types))


def objects_reply(types: ReplyTypes, service: str, found: Iterable[Found]) -> Message:
    """Return the response of a service that answers with `hypermap_msgs/SemanticObject`.

    Args:
        types: the middleware's classes.
        service: "hypermap_msgs/GetSemanticByArea" or "hypermap_msgs/GetSemanticByString".
        found: the objects; hits without one are left out.
    """
    response = writing_arrays(types.response(service))
    return response(objects=semantic_objects(found, types))


def area_hits(types: ReplyTypes, labels: Hits, values: Hits) -> Message:
    """Return a `hypermap_msgs/AreaHits`: labels and numbers at the same locations."""
    message = writing_arrays(types.message("hypermap_msgs/AreaHits"))
    return message(
        labels=_texts(message, labels),
        values=numbers(message, as_int32(values.values)),
        locations=_points(message, labels.points_xy, types),
    )


def hits_reply(types: ReplyTypes, frame_id: str, hits: list[Message]) -> Message:
    """Return the response of `hypermap_msgs/GetHitsInAreas` with an `area_hits` for each area."""
    response = writing_arrays(types.response("hypermap_msgs/GetHitsInAreas"))
    return response(success=True, message="", frame_id=frame_id, hits=hits)


def map_reply(types: ReplyTypes, layer: OccupancyLayer, stamp: int) -> Message:
    """Return the response of `nav_msgs/GetMap`."""
    response = writing_arrays(types.response("nav_msgs/GetMap"))
    return response(map=occupancy_grid(layer, types, stamp))


def plan_reply(types: ReplyTypes, poses: NDArray[np.float64], frame_id: str, stamp: int) -> Message:
    """Return the response of `nav_msgs/GetPlan`.

    Args:
        types: the middleware's classes.
        poses: x, y and yaw in the frame [m, m, rad], shape (N, 3).
        frame_id: the frame.
        stamp: of the plan [ns].
    """
    posed, pose = types.message("geometry_msgs/PoseStamped"), types.message("geometry_msgs/Pose")
    head = header(frame_id, types, stamp)
    plan = types.message("nav_msgs/Path")(
        header=head,
        poses=[
            posed(
                header=head,
                pose=pose(position=point(x, y, types), orientation=quaternion(yaw, types)),
            )
            for x, y, yaw in poses.tolist()
        ],
    )
    return types.response("nav_msgs/GetPlan")(plan=plan)


def as_int32(values: ArrayLike) -> NDArray[np.int32]:
    """Return numbers, (N,), as messages carry them: rounded, cut to 32 bits, -1 for NaN.

    >>> as_int32([1.6, float("nan"), 1e20])
    array([         2,         -1, 2147483647], dtype=int32)
    """
    given = np.asarray(values)
    if np.can_cast(given.dtype, np.int32):
        return np.asarray(given, dtype=np.int32)
    limits = np.iinfo(np.int32)
    if np.issubdtype(given.dtype, np.floating):
        given = np.where(np.isnan(given), _NO_NUMBER, np.rint(given))
    return np.asarray(np.clip(given, limits.min, limits.max), dtype=np.int32)


def _texts(message_class: type[Any], hits: Hits) -> Any:
    return hits.values if takes_arrays(message_class) else hits.values.tolist()


def _points(message_class: type[Any], points_xy: NDArray[np.float64], types: Types) -> Any:
    return points_xy if takes_arrays(message_class) else points(points_xy, types)
