"""Where the robot was, as SLAM has optimized it: messages of other programs as trajectories."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hypermap.core.errors import FormatError, FrameError
from hypermap.core.trajectory import Trajectory, pose_matrix, trajectory_of
from hypermap.recordings.messages.header import as_seconds, clean_frame, nanoseconds
from hypermap.ros.port import Message


def path_of(message: Message, map_frame: str) -> Trajectory:
    """Return a `nav_msgs/Path` as a trajectory; of poses with one stamp, the last one counts.

    Raises:
        FrameError: If it is in another frame.
        FormatError: If it has no poses, or none of use.
    """
    _check_frame(message, "path", map_frame)
    by_stamp = {nanoseconds(one.header.stamp): one.pose for one in message.poses}
    if len(by_stamp) < 2:
        raise FormatError("a path needs at least two poses with stamps of their own")
    return _trajectory(by_stamp)


class TimedGraph:
    """RTAB-Map's `MapGraph` as a trajectory, of the nodes whose times are known.

    A graph has no stamp but that of its header, at which the robot was at the newest node. So a
    node that was not in the graphs before is of that time. The nodes of the first graph are of
    unknown times, unless it has but one.

    Source: CoreWrapper::publishStats of rtabmap_ros: node ids grow; landmarks have negative ones.
    """

    def __init__(self) -> None:
        self._stamps: dict[int, int] = {}  # ns, by node
        self._newest_id = 0
        self._count, self._stamp = 0, 0  # of nodes in the latest graph, and its time

    def learn(self, message: Message) -> None:
        """Note which node is new in a graph; to be called with each one, in order."""
        ids, stamp = [one for one in _ids(message) if one > 0], nanoseconds(message.header.stamp)
        if not ids:
            return
        newest = max(ids)
        is_reset = newest < self._newest_id and 2 * len(ids) < self._count
        if is_reset or stamp < self._stamp:  # or a bag is played again
            self._stamps, self._newest_id = {}, 0
        if newest > self._newest_id:
            if self._newest_id > 0 or len(ids) == 1:
                self._stamps[newest] = stamp
            self._newest_id = newest
        self._count, self._stamp = len(ids), stamp

    def path(self, message: Message, map_frame: str) -> Trajectory | None:
        """Return a graph's poses; None if the times of fewer than two are known.

        Raises:
            FrameError: If it is in another frame.
            FormatError: If it has another number of poses than of ids, or a bad pose.
        """
        _check_frame(message, "graph", map_frame)
        ids = _ids(message)
        if len(ids) != len(message.poses):
            raise FormatError(f"a graph of {len(ids)} nodes has {len(message.poses)} poses")
        stamps = self._stamps
        pairs = zip(ids, message.poses, strict=True)
        by_stamp = {stamps[number]: pose for number, pose in pairs if number in stamps}
        return _trajectory(by_stamp) if len(by_stamp) > 1 else None


def _ids(message: Message) -> list[int]:
    """Return the ids of a graph's nodes, which ROS 1 and ROS 2 spell differently."""
    ids = message.posesId if hasattr(message, "posesId") else message.poses_id
    return [int(number) for number in ids]


def _check_frame(message: Message, kind: str, map_frame: str) -> None:
    frame_id = clean_frame(message.header.frame_id)
    if frame_id != map_frame:
        raise FrameError(f"the {kind} is in the frame {frame_id!r}, not in {map_frame!r}")


def _trajectory(by_stamp: Mapping[int, Message]) -> Trajectory:
    """Return poses, by their stamps [ns], as a trajectory."""
    stamps = sorted(by_stamp)
    places = [by_stamp[stamp].position for stamp in stamps]
    turns = [by_stamp[stamp].orientation for stamp in stamps]
    try:
        matrices = pose_matrix(
            [(p.x, p.y, p.z) for p in places], [(q.x, q.y, q.z, q.w) for q in turns]
        )
    except ValueError as error:
        raise FormatError(str(error)) from None
    return trajectory_of(np.array([as_seconds(stamp) for stamp in stamps]), matrices)
