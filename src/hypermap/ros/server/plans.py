"""Paths over the served map: `nav_msgs/GetPlan`."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap import paths
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.masks import Zone
from hypermap.ros.messages.replies import plan_reply
from hypermap.ros.port import Message, Parameter, Port, Value
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.requests import Requests
from hypermap.ros.server.zones import entries_of, keepout_filter

_LONGEST = 1e3  # m


class Plans:
    """The part that plans paths for the robot of the parameters, around the keepout zones.

    What a map and a robot take to prepare is kept until one of them changes.
    """

    PARAMETERS = (
        Parameter(
            "robot_radius", 0.0, "Radius of the robot in paths [m].", 0.0, _LONGEST, changes=True
        ),
        Parameter(
            "inflation_radius",
            0.0,
            "How far paths keep from walls where it costs little [m]; 0 for the shortest.",
            0.0,
            _LONGEST,
            changes=True,
        ),
        Parameter(
            "cost_scaling",
            10.0,
            "How fast that cost falls with the distance [1/m].",
            0.0,
            _LONGEST,
            changes=True,
        ),
        Parameter(
            "through_unknown", False, "Whether paths lead through unknown cells.", changes=True
        ),
        Parameter(
            "path_layer",
            "",
            "The occupancy layer that paths lead over; empty for the only one.",
            changes=True,
        ),
    )

    def __init__(self, port: Port, current: CurrentMap, requests: Requests) -> None:
        self._port = port
        self._current = current
        self._requests = requests
        self._settings = paths.PathSettings()
        self._keepout: tuple[Zone, ...] = ()
        self._layer: str | None = None
        self._planner: tuple[Hypermap, paths.Planner] | None = None
        self._lock = threading.Lock()

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters, all or those that changed; the zones are those of `CostmapMasks`.

        Raises:
            HypermapError: If a zone is wrong; nothing is changed then.
        """
        names = {"through_unknown": "unknown_is_free"}
        own: dict[str, Any] = {  # each of the type that its parameter declares
            names.get(name, name): values[name]
            for name in ("robot_radius", "inflation_radius", "cost_scaling", "through_unknown")
            if name in values
        }
        zones = keepout_filter(entries_of(values.get("keepout", ()))).zones
        with self._lock:
            self._settings = replace(self._settings, **own)
            if "keepout" in values:
                self._keepout = zones
            if "path_layer" in values:
                self._layer = str(values["path_layer"]) or None
            if own or {"keepout", "path_layer"} & values.keys():
                self._planner = None

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Take a map: there is nothing to show."""

    def close(self) -> None:
        """Forget what was prepared."""
        with self._lock:
            self._planner = None

    def make_plan(self, request: Message) -> Message:
        """Answer `nav_msgs/GetPlan`; raises HypermapError where no path leads to the goal."""
        hypermap = self._current.hypermap
        start = self._requests.pose(hypermap, request.start)
        goal = self._requests.pose(hypermap, request.goal)
        planner = self._planner_of(hypermap)
        points = _points(planner, start, goal, float(request.tolerance))
        poses = _poses(points, planner.space.grid.resolution, goal.yaw)
        return plan_reply(self._port, poses, hypermap.base_frame, self._port.now())

    def _planner_of(self, hypermap: Hypermap) -> paths.Planner:
        with self._lock:
            if self._planner is None or self._planner[0] is not hypermap:
                made = paths.Planner(
                    hypermap, self._settings, keepout=self._keepout, occupancy=self._layer
                )
                self._planner = hypermap, made
            return self._planner[1]


def _points(
    planner: paths.Planner, start: Pose2D, goal: Pose2D, tolerance: float
) -> NDArray[np.float64]:
    """Return the path, shape (N, 2), to the goal or to what can be reached nearest to it.

    Args:
        planner: of the map and the robot.
        start: in the base frame.
        goal: likewise.
        tolerance: how far from the goal the path may end if it cannot be reached [m].

    Raises:
        HypermapError: If no path leads there.
    """
    if not 0 <= tolerance < math.inf:
        raise HypermapError(f"the tolerance must be 0 or more meters, got {tolerance}")
    begin, end = (start.x, start.y), (goal.x, goal.y)
    try:
        return planner.path(begin, end).points_xy
    except HypermapError:
        if tolerance == 0:
            raise
        reached = np.isfinite(planner.distances(begin).meters)
        around = shapely.Point(end).buffer(tolerance)
        nearest = planner.space.middle_of(around, end, preferred=reached)
        if nearest is None:
            raise
    return planner.path(begin, nearest).points_xy


def _poses(points: NDArray[np.float64], step: float, last_yaw: float) -> NDArray[np.float64]:
    """Return poses along a path as x, y and yaw, shape (M, 3), each looking at the next.

    Args:
        points: the path, shape (N, 2); without length if the robot is there already.
        step: how far apart poses are at most [m].
        last_yaw: where the last one looks [rad].
    """
    line = shapely.LineString(points)
    dense = shapely.get_coordinates(shapely.segmentize(line, step)) if line.length else points[:1]
    ahead = np.diff(dense, axis=0)
    yaws = np.append(np.arctan2(ahead[:, 1], ahead[:, 0]), last_yaw)
    return np.column_stack([dense, yaws])
