"""Depth is moved into the color camera, as that one would have measured it."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap.core.trajectory import pose_from_rpy
from hypermap.perception.frame import Camera
from hypermap.perception.registration import Registration

DEPTH = Camera.from_intrinsics(50, 50, 31.5, 23.5, width=64, height=48)


def wall(camera: Camera, camera_T_depth: np.ndarray, distance: float) -> np.ndarray:
    """How far each pixel of a camera sees a wall before the depth camera, worked out by rays."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.K).T
    normal = camera_T_depth[:3, 2]
    at = normal @ camera_T_depth[:3, 3] + distance
    return np.asarray(at / (rays @ normal), np.float32)


def test_to_the_same_camera_nothing_changes() -> None:
    depth = np.random.default_rng(0).uniform(1, 3, (48, 64)).astype(np.float32)
    depth[10:20, 5:9] = np.nan
    np.testing.assert_allclose(Registration(DEPTH, np.eye(4)).depth(depth, DEPTH), depth, rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    x=st.floats(-0.1, 0.1),
    y=st.floats(-0.05, 0.05),
    turn=st.floats(-0.1, 0.1),
    focal=st.floats(30, 110),
    distance=st.floats(0.8, 4),
)
def test_a_wall_is_where_the_other_camera_sees_it_without_cracks(
    x: float, y: float, turn: float, focal: float, distance: float
) -> None:
    color = Camera.from_intrinsics(focal, focal, 39.5, 29.5, width=80, height=60)
    color_T_depth = pose_from_rpy(x, y, 0.01, 0.5 * turn, turn, 0.1)
    depth = np.full((48, 64), distance, np.float32)
    found = Registration(color, color_T_depth).depth(depth, DEPTH)
    expected = wall(color, color_T_depth, distance)
    seen = np.isfinite(found)
    np.testing.assert_allclose(found[seen], expected[seen], rtol=0.02)
    # What the depth camera sees is one piece: no row of it has a gap.
    for row in seen:
        inside = np.flatnonzero(row)
        assert len(inside) == 0 or row[inside[0] : inside[-1] + 1].all()
    assert seen.any()


def test_of_two_points_on_one_pixel_the_nearer_counts() -> None:
    depth = np.full((48, 64), 3.0, np.float32)
    depth[20:30, 20:40] = 1.0  # moves by 5 pixels to the left, the wall by 1.7
    moved = Registration(DEPTH, pose_from_rpy(-0.1, 0, 0, 0, 0, 0)).depth(depth, DEPTH)
    assert (moved[20:30, 15:35] == 1.0).all()
    assert np.nanmin(moved[:20]) == 3.0
    assert np.isnan(moved[25, 36])  # which the thing hid from the depth camera


def test_the_pose_is_that_of_the_color_camera() -> None:
    color_T_depth, map_T_depth = (
        pose_from_rpy(-0.1, 0, 0, 0, 0, 0.2),
        pose_from_rpy(1, 2, 3, 1, 1, 1),
    )
    pose = Registration(DEPTH, color_T_depth).pose(map_T_depth)
    np.testing.assert_allclose(pose @ color_T_depth, map_T_depth, atol=1e-12)
