"""Levels of error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.simulation import (
    EXACT_DEPTH,
    SENSORS,
    SimulatedRecording,
    demo_world,
    errors_of_level,
)


def first_frame(level: str):
    return next(SimulatedRecording.with_errors(demo_world(), errors_of_level(level)).frames())


def test_each_level_adds_errors_to_the_one_before() -> None:
    none, fair, robot, rough, harsh = map(first_frame, ("none", "fair", "robot", "rough", "harsh"))
    seen = np.isfinite(fair.depth)
    assert 0.001 < np.abs(none.depth - fair.depth)[seen].mean() < 0.1
    assert seen.sum() < np.isfinite(none.depth).sum()
    assert (fair.map_T_camera == none.map_T_camera).all()
    assert 0.001 < np.linalg.norm((robot.map_T_camera - none.map_T_camera)[:3, 3]) < 0.2
    ratio = [float(np.nanmedian(frame.depth / none.depth)) for frame in (robot, rough, harsh)]
    assert ratio == pytest.approx([1.0, 1.01, 1.02], abs=0.002)
    holes = [np.isnan(frame.depth).sum() for frame in (robot, rough, harsh)]
    assert holes == sorted(set(holes))


def test_harsh_is_twice_what_rough_adds_and_both_depend_on_the_sensor() -> None:
    robot, rough, harsh = (errors_of_level(level, "tof") for level in ("robot", "rough", "harsh"))
    assert robot.depth == SENSORS["tof"]
    assert (rough.depth.flying, harsh.depth.flying) == (0.3, 0.6)
    assert errors_of_level("rough").depth.flying == 0  # a Kinect has none
    assert (rough.poses.time_offset, harsh.poses.time_offset) == (0.03, 0.06)
    assert (rough.poses.mounting_deg, harsh.poses.mounting_deg) == (0.5, 1.0)
    assert (rough.detector.false_places, harsh.detector.false_places) == (4, 8)
    assert (rough.map.bend, harsh.map.bend) == (0.02, 0.04)
    assert replace(rough.detector, lasting_misses=0, false_places=0, lasting_confusion=0) == (
        robot.detector
    )
    assert errors_of_level("none", "tof").depth == EXACT_DEPTH


def test_drift_differs_from_robot_by_its_poses_alone() -> None:
    drift, robot = errors_of_level("drift"), errors_of_level("robot")
    assert drift.poses.odometry == 0.01
    assert replace(drift, poses=robot.poses) == robot


def test_an_unknown_level_is_named_with_the_known_ones() -> None:
    with pytest.raises(HypermapError, match=r"no level of errors 'robt'; did you mean 'robot'\?"):
        errors_of_level("robt")
