"""Frames of requests: the map's own ones, however it spells them, and those of tf."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FrameError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.core.trajectory import pose_from_rpy
from hypermap.ros.server.floor_frames import FloorFrames, floor_pose


class Tf:
    """A port whose tf knows one frame; like tf2, it takes no names with a slash in front."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str, int | None, float]] = []

    def lookup(self, target: str, source: str, stamp: int | None, timeout: float) -> Any:
        self.asked.append((target, source, stamp, timeout))
        if (target, source) != ("map", "odom"):
            raise FrameError(f"tf does not know {source!r}")
        matrix = np.eye(4)
        matrix[:2, 3] = 3, 4
        return matrix


def old_map() -> Hypermap:
    layers = [SemanticLayer("a", "/map"), SemanticLayer("b", "/lab")]
    return Hypermap(layers, FrameTree([Transform("/map", "/lab", Pose2D(1, 2))]))


@pytest.mark.parametrize(
    ("source", "expected"),
    [(None, Pose2D()), ("map", Pose2D()), ("lab", Pose2D(1, 2)), ("/lab", Pose2D(1, 2))],
)
def test_a_frame_is_known_without_the_slash_of_old_maps(
    source: str | None, expected: Pose2D
) -> None:
    tf: Any = Tf()
    assert FloorFrames(tf).pose(old_map(), "/map", source) == expected
    assert tf.asked == []


def test_a_frame_that_the_map_has_with_and_without_the_slash_is_the_one_named() -> None:
    tf: Any = Tf()
    layers = [SemanticLayer("a", "map"), SemanticLayer("b", "/lab"), SemanticLayer("c", "lab")]
    poses = {"/lab": Pose2D(1, 2), "lab": Pose2D(3, 4)}
    tree = FrameTree([Transform("map", name, pose) for name, pose in poses.items()])
    for name, pose in poses.items():
        assert FloorFrames(tf).pose(Hypermap(layers, tree), "map", name) == pose


def test_tf_is_asked_without_the_slash() -> None:
    tf: Any = Tf()
    pose = FloorFrames(tf, timeout=0.25).pose(old_map(), "/map", "odom", stamp=7)
    assert pose == Pose2D(3, 4)
    assert tf.asked == [("map", "odom", 7, 0.25)]
    assert FloorFrames(tf).pose(old_map(), "/map", "odom") == Pose2D(3, 4)
    assert tf.asked[1:] == [("map", "odom", None, 0.5)]


def test_a_turned_frame_of_tf_turns_the_same_way() -> None:
    class Turned(Tf):
        """`odom` lies at (3, 4) and looks along the map's y axis: to the left, not to the right."""

        def lookup(self, *asked: Any) -> Any:
            matrix = super().lookup(*asked)
            matrix[:2, :2] = [[0, -1], [1, 0]]
            return matrix

    tf: Any = Turned()
    pose = FloorFrames(tf).pose(old_map(), "/map", "odom")
    assert pose.yaw == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(pose.apply([[1.0, 0.0]]), [[3.0, 5.0]])


def test_what_nobody_knows_is_an_error_that_names_both() -> None:
    tf: Any = Tf()
    for hypermap, known in ((old_map(), "/map, /lab"), (Hypermap(), "none")):
        message = f"'moon' is unknown to the map, .* frames {known}; tf does not know 'moon'"
        with pytest.raises(FrameError, match=message):
            FloorFrames(tf).pose(hypermap, "/map", "moon")


@pytest.mark.parametrize("roll", [0, math.radians(4.9), math.radians(-4.9)])
def test_a_frame_that_hardly_leans_is_seen_from_above(roll: float) -> None:
    pose = floor_pose(pose_from_rpy(3, 4, 5, roll, 0, 2.0), "robot")
    np.testing.assert_allclose([pose.x, pose.y, pose.yaw], [3, 4, 2.0], atol=0.01)


def test_a_rounded_rotation_is_no_tilt() -> None:
    pose = np.eye(4)
    pose[2, 2] = 1 + 1e-15
    assert floor_pose(pose, "robot") == Pose2D()
    pose[2, 2] = -1 - 1e-15
    with pytest.raises(FrameError, match="tilted by 180 degrees"):
        floor_pose(pose, "camera")


@pytest.mark.parametrize(
    ("turn", "degrees"),
    [((0.1, 0), 6), ((0, -0.1), 6), ((math.pi, 0), 180), ((math.pi / 2, 0), 90)],
)
def test_a_frame_that_leans_is_refused(turn: tuple[float, float], degrees: int) -> None:
    with pytest.raises(FrameError, match=f"'camera' is tilted by {degrees} degrees"):
        floor_pose(pose_from_rpy(0, 0, 0, *turn, 1.0), "camera")
