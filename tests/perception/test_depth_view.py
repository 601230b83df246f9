"""The ground that a frame has seen."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.core.trajectory import pose_from_rpy
from hypermap.perception.depth_view import DepthView, ground_ring
from hypermap.perception.frame import Camera, RgbdFrame

CAMERA = Camera.from_intrinsics(65, 65, 39.5, 29.5, 80, 60)


def ground_of(
    depth: np.ndarray, roll: float = -np.pi / 2, max_range: float = 5.0
) -> shapely.Geometry:
    pose = pose_from_rpy(3.0, -2.0, 1.2, roll, 0.1, 0.7)
    return DepthView.of(RgbdFrame(0.0, depth.astype(np.float32), CAMERA, pose), max_range).ground


def expected_ground(depth: np.ndarray, roll: float) -> shapely.Geometry:
    """Return what lies within the ring of farthest ends and nearest ends, however it crosses."""
    pose = pose_from_rpy(3.0, -2.0, 1.2, roll, 0.1, 0.7)
    columns, rows = np.arange(0, 80, 4), np.arange(0, 60, 4)
    rays = np.stack(
        np.broadcast_arrays((columns - 39.5) / 65, (rows[:, np.newaxis] - 29.5) / 65, 1)
    )
    over_floor = np.tensordot(pose[:2, :3], rays, axes=1)
    z = depth.astype(np.float32)[::4, ::4]
    reach = (z * np.hypot(*over_floor)).astype(np.float32)
    reach = np.where(reach <= 5.0, reach, 0.0)
    middle = over_floor[:, len(rows) // 2]
    directions = (middle / np.hypot(*middle)).T
    far = reach.max(axis=0)[:, np.newaxis] * directions
    near = reach[reach > 0].min() * directions
    ring = shapely.Polygon(np.vstack([far, near[::-1]]) + pose[:2, 3])
    return shapely.buffer(shapely.make_valid(ring), 0)


@pytest.mark.parametrize("roll", [-np.pi / 2, -2.0, 1.2, 2.9])
@pytest.mark.parametrize("lost", [0.0, 0.2, 0.7])
def test_the_ground_lies_between_the_nearest_and_the_farthest_returns(
    roll: float, lost: float
) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        depth = rng.uniform(0.5, 6, (60, 80))
        depth[:, np.repeat(rng.random(20) < lost, 4)] = np.nan
        ground, expected = ground_of(depth, roll), expected_ground(depth, roll)
        assert ground.is_valid
        assert ground.area > 0
        assert shapely.symmetric_difference(ground, expected).area < 1e-9


def test_a_wall_at_one_distance_leaves_slivers_of_ground() -> None:
    depth = np.full((60, 80), 2.0)
    ground = ground_of(depth)
    assert ground.is_valid
    assert shapely.symmetric_difference(ground, expected_ground(depth, -np.pi / 2)).area < 1e-9


def test_without_returns_there_is_no_ground() -> None:
    depth = np.full((60, 80), np.nan)
    assert ground_of(depth).is_empty
    depth[:, 40] = 2.0  # one column
    assert ground_of(depth).is_empty
    assert ground_of(np.full((60, 80), 6.0)).is_empty
    assert ground_of(np.full((60, 80), np.inf), max_range=np.inf).is_empty


@pytest.mark.parametrize("fill", [0.0, -1.0, -np.inf])
def test_what_is_no_depth_shows_no_ground(fill: float) -> None:
    depth = np.full((60, 80), fill)
    assert ground_of(depth).is_empty
    depth[:, 20:60] = 2.0
    seen = np.full((60, 80), np.nan)
    seen[:, 20:60] = 2.0
    assert ground_of(depth).equals(ground_of(seen))


def test_rays_that_all_end_equally_far_away_show_no_ground() -> None:
    pose = pose_from_rpy(3.0, -2.0, 1.2, -np.pi / 2, 0.0, 0.0)  # looks level
    view = DepthView(CAMERA, pose, np.full((60, 80), 2.0, np.float32))
    assert view.ground.is_empty


def test_columns_that_all_look_the_same_way_show_no_ground() -> None:
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # on its side: columns look up and down
    frame = RgbdFrame(0.0, np.full((60, 80), 2.0, np.float32), CAMERA, pose)
    view = DepthView.of(frame)
    middle = DepthView(Camera(np.diag([16.0, 16.0, 1.0]), 20, 1), pose, view.reach[:1])
    assert middle.ground.is_empty


def test_ground_in_one_piece_is_a_ring() -> None:
    pose = pose_from_rpy(3.0, -2.0, 1.2, -np.pi / 2, 0.1, 0.7)
    reach = np.random.default_rng(5).uniform(1, 3, (3, 60, 80)).astype(np.float32)
    reach[1, :, 20:30] = reach[2] = np.nan  # in pieces, and none
    whole, parted, none = (DepthView(CAMERA, pose, one) for one in reach)
    assert shapely.get_coordinates(whole.ground).tolist() == ground_ring(whole).tolist()
    assert ground_ring(parted) is None
    assert shapely.get_num_geometries(parted.ground) == 3
    assert len(ground_ring(none)) == 0
    assert none.ground.is_empty
