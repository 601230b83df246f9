"""Levels of error."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.simulation import SimulatedRecording, demo_world, errors_of_level


def first_frame(level: str):
    errors = errors_of_level(level)
    recording = SimulatedRecording(
        demo_world(),
        depth_noise=errors.depth,
        pose_noise=errors.poses,
        detector_noise=errors.detector,
    )
    return next(recording.frames())


def test_each_level_adds_errors_to_the_one_before() -> None:
    none, fair, robot = map(first_frame, ("none", "fair", "robot"))
    seen = np.isfinite(fair.depth)
    assert 0.001 < np.abs(none.depth - fair.depth)[seen].mean() < 0.1
    assert seen.sum() < np.isfinite(none.depth).sum()
    assert (fair.map_T_camera == none.map_T_camera).all()
    assert 0.001 < np.linalg.norm((robot.map_T_camera - none.map_T_camera)[:3, 3]) < 0.2


def test_an_unknown_level_is_named_with_the_known_ones() -> None:
    with pytest.raises(HypermapError, match=r"no level of errors 'robt'; did you mean 'robot'\?"):
        errors_of_level("robt")
