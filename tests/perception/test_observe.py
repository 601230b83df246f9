"""A box on a table, seen from above, and what else a real camera may give."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from hypermap.core.trajectory import compose, pose_from_rpy
from hypermap.perception.config import Method, PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.observe import observe

CAMERA = Camera.from_intrinsics(262.5, 262.5, 159.5, 119.5, 320, 240)
HALF_X, HALF_Y = 0.15, 0.10  # of the box [m]
TABLE, TOP, HEIGHT = 0.70, 0.85, 2.0  # heights in the map [m]
METHODS: list[Method] = ["enclosed", "organised", "unorganised"]

# Two meters above the map's origin, looking straight down, image right along the map's x.
LOOKING_DOWN = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, HEIGHT], [0, 0, 0, 1.0]])
SEEN = Detections.of([[120, 92, 199, 147]], ["box"], [0.8])


def box_on_table() -> NDArray[np.float32]:
    """Ray-cast a box under the camera: its sides are hidden below its top."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    x_over_z, y_over_z = (u - 159.5) / 262.5, (v - 119.5) / 262.5
    z = HEIGHT - TOP
    on_top = (np.abs(x_over_z * z) <= HALF_X) & (np.abs(y_over_z * z) <= HALF_Y)
    return np.where(on_top, z, HEIGHT - TABLE).astype(np.float32)


def frame_of(
    depth: NDArray[np.float32], map_T_camera: NDArray[np.float64] = LOOKING_DOWN
) -> RgbdFrame:
    return RgbdFrame(7.5, depth, CAMERA, map_T_camera)


def iou(a: BaseGeometry, b: BaseGeometry) -> float:
    return float(a.intersection(b).area / a.union(b).area)


@pytest.mark.parametrize("method", METHODS)
def test_a_box_on_a_table_is_seen_from_above_as_it_is(method: Method) -> None:
    observation = observe(frame_of(box_on_table()), SEEN, PerceptionConfig(method=method))
    (found,) = observation.objects
    assert found.name == "box"
    assert found.score == pytest.approx(0.8)
    assert iou(found.footprint, shapely.box(-HALF_X, -HALF_Y, HALF_X, HALF_Y)) > 0.9
    assert (found.z_min, found.z_max) == pytest.approx((TOP, TOP), abs=1e-3)
    # The camera sees the table out to the corners of its image.
    x, y = 160 / 262.5 * (HEIGHT - TABLE), 120 / 262.5 * (HEIGHT - TABLE)
    assert iou(observation.visible_area, shapely.box(-x, -y, x, y)) > 0.98
    assert observation.stamp == 7.5
    np.testing.assert_array_equal(observation.map_T_camera, LOOKING_DOWN)


@pytest.mark.parametrize(
    ("top", "is_seen"),
    [(0.08, True), (0.03, False), (-0.03, False), (-2.0, True)],
)
def test_a_piece_of_the_floor_is_no_object(top: float, is_seen: bool) -> None:
    """Where all lies far below z = 0, the map has its floor elsewhere, and nothing is left out."""
    lowered = LOOKING_DOWN.copy()
    lowered[2, 3] += top - TOP
    seen = observe(frame_of(box_on_table(), lowered), SEEN, PerceptionConfig())
    assert len(seen.objects) == is_seen
    kept = observe(frame_of(box_on_table(), lowered), SEEN, PerceptionConfig(min_top=0))
    assert len(kept.objects) == 1


@settings(deadline=None, max_examples=15)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-np.pi, np.pi))
def test_a_motion_of_the_camera_moves_what_it_sees(x: float, y: float, yaw: float) -> None:
    config = PerceptionConfig()
    here = observe(frame_of(box_on_table()), SEEN, config)
    motion = pose_from_rpy(x, y, 0.3, roll=0, pitch=0, yaw=yaw)
    there = observe(frame_of(box_on_table(), compose(motion, LOOKING_DOWN)), SEEN, config)
    for before, after in (
        (here.objects[0].footprint, there.objects[0].footprint),
        (here.visible_area, there.visible_area),
    ):
        moved = shapely.transform(before, lambda xy: xy @ motion[:2, :2].T + motion[:2, 3])
        # Only the grid of cells stays where it is.
        assert shapely.hausdorff_distance(after, moved) < 2 * config.voxel_size
    assert there.objects[0].z_max == pytest.approx(here.objects[0].z_max + 0.3, abs=1e-4)


def test_the_thesis_profile_sees_what_the_default_leaves_out() -> None:
    far = np.full((240, 320), 8.0, np.float32)
    frame = frame_of(far)
    unsure = Detections.of([[100, 100, 150, 150]], ["chair"], [0.1])
    assert len(observe(frame, unsure, PerceptionConfig.thesis()).objects) == 1
    assert len(observe(frame, unsure, PerceptionConfig(max_depth=10)).objects) == 0
    assert len(observe(frame, unsure, PerceptionConfig(min_score=0.05)).objects) == 0
    assert observe(frame, unsure, PerceptionConfig()).visible_area.is_empty


def test_a_recorded_cloud_counts_more_than_the_depth() -> None:
    cloud = frame_of(box_on_table()).points() + np.array([1, 0, 0], np.float32)
    frame = RgbdFrame(0.0, box_on_table(), CAMERA, LOOKING_DOWN, cloud=cloud)
    (found,) = observe(frame, SEEN, PerceptionConfig()).objects
    assert found.footprint.centroid.x == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("fill", [np.nan, 0.0, -1.0, np.inf])
def test_a_frame_without_depth_shows_nothing(method: Method, fill: float) -> None:
    frame = frame_of(np.full((240, 320), fill, np.float32))
    observation = observe(frame, SEEN, PerceptionConfig(method=method, max_depth=np.inf))
    assert observation.objects == ()
    assert observation.visible_area.is_empty


def test_without_detections_there_is_still_a_visible_area() -> None:
    observation = observe(frame_of(box_on_table()), Detections.of([], []), PerceptionConfig())
    assert observation.objects == ()
    assert observation.visible_area.area > 1


@pytest.mark.parametrize("method", METHODS)
def test_a_wall_seen_straight_on_has_no_footprint(method: Method) -> None:
    facing_x = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.0], [0, 0, 0, 1]])
    wall = frame_of(np.full((240, 320), 2.0, np.float32), facing_x)
    observation = observe(wall, SEEN, PerceptionConfig(method=method))
    assert observation.objects == ()
    assert observation.visible_area.is_empty


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("share", [0.0005, 0.02, 0.5])
def test_scattered_points_are_no_trouble(method: Method, share: float) -> None:
    rng = np.random.default_rng(5)
    depth = rng.uniform(0.5, 4, (240, 320)).astype(np.float32)
    depth[rng.random(depth.shape) >= share] = np.nan
    whole = Detections.of([[0, 0, 320, 240], [100, 50, 180, 90]], ["a", "b"])
    observation = observe(frame_of(depth), whole, PerceptionConfig(method=method))
    assert observation.visible_area.area > 1
    assert all(found.footprint.area > 0 for found in observation.objects)


def test_a_shape_is_as_exact_far_from_the_origin_as_near_to_it() -> None:
    camera = Camera.from_intrinsics(100, 100, 31.5, 23.5, 64, 48)
    depth = np.full((48, 64), 1.0, np.float32)
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    down[2, 3] = 2.0
    boxes = Detections.of([[0, 0, 64, 48]], ["plate"])
    shapes = []
    for x, y in [(0.0, 0.0), (460_000.0, 5_500_000.0)]:
        pose = down.copy()
        pose[:2, 3] = x, y
        frame = RgbdFrame(0.0, depth, camera, pose)
        (seen,) = observe(frame, boxes, PerceptionConfig.thesis()).objects
        shapes.append(translate(seen.footprint, -x, -y))
    assert shapes[1].hausdorff_distance(shapes[0]) < 1e-6


def test_what_a_box_cuts_out_of_a_larger_thing_counts_as_much_as_the_whole() -> None:
    depth = np.full((CAMERA.height, CAMERA.width), HEIGHT, np.float32)
    depth[110:124, 150:172] = 1.5  # two things side by side that touch, too small for a plane
    whole, left = [150, 110, 172, 124], [150, 110, 161, 124]
    for box in (whole, left):
        seen = Detections.of([box], ["thing"], [0.8])
        (found,) = observe(frame_of(depth), seen, PerceptionConfig()).objects
        assert found.score == pytest.approx(0.8)
