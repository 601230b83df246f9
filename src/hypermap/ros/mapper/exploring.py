"""The part of a live node that publishes where the robot should look next."""

from __future__ import annotations

import math

from hypermap.exploration import Explorer, Sensor
from hypermap.paths import PathSettings
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.repeating import Repeating
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.messages.exploration_messages import exploration_markers, pose_array
from hypermap.ros.port import Port
from hypermap.ros.throttle import Throttle
from hypermap.ros.topic_names import FRONTIERS

_MOVED = 0.1  # meters that the robot must have moved, if the map is the same
_NONE_LEFT = "the robot cannot reach any frontier from here"


class LiveExploration:
    """Publishes frontiers and next views, as markers and as poses, best first; it drives nowhere.

    It looks every `frontiers_every` seconds, in a thread of its own, while someone listens.
    """

    def __init__(
        self, port: Port, settings: LiveSettings, live_map: LiveMap, log: Throttle
    ) -> None:
        self._port, self._settings, self._map, self._log = port, settings, live_map, log
        self._frame_id = settings.map_frame.strip("/")
        self._markers = port.publisher(FRONTIERS, "visualization_msgs/MarkerArray", latched=True)
        self._frontiers = port.publisher("frontier_poses", "geometry_msgs/PoseArray", latched=True)
        self._views = port.publisher("next_view_poses", "geometry_msgs/PoseArray", latched=True)
        self._robot = PathSettings(settings.robot_radius, unknown_is_free=settings.through_unknown)
        self._sensor = Sensor(settings.sensor_range, settings.sensor_min_range, settings.sensor_fov)
        self._looked = (-1, (math.inf, math.inf))  # at which revision of the map, and where
        every = settings.frontiers_every
        self._repeating = Repeating("frontiers", self._look, every, log, "no frontiers")

    def close(self) -> None:
        """Publish no more."""
        self._repeating.close()
        for publisher in (self._markers, self._frontiers, self._views):
            publisher.close()

    def _look(self) -> None:
        if not (self._markers.listeners or self._frontiers.listeners or self._views.listeners):
            return
        revision = self._map.revision
        if revision == 0:  # nothing is mapped yet
            return
        pose = self._port.lookup(self._frame_id, self._settings.base_frame)
        here = float(pose[0, 3]), float(pose[1, 3])
        if revision == self._looked[0] and math.dist(here, self._looked[1]) < _MOVED:
            return
        explorer = Explorer(self._map.hypermap(), here, self._robot, self._sensor)
        frontiers, views = explorer.frontiers(), explorer.next_views()
        self._looked = revision, here
        if not frontiers:
            self._log.log("info", "none left", _NONE_LEFT)
        now = self._port.now()
        self._markers.publish(exploration_markers(frontiers, views, self._frame_id, self._port))
        for publisher, goals in ((self._frontiers, frontiers), (self._views, views)):
            poses = [goal.pose for goal in goals]
            publisher.publish(pose_array(poses, self._frame_id, self._port, now))
