"""What the camera sees, compared with where things are."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.core.trajectory import invert
from hypermap.perception.frame import Camera
from hypermap.simulation.render import DEFAULT_CAMERA, Renderer, Rendering
from hypermap.simulation.scene import BACKGROUND, Scene, footprint, placed
from hypermap.simulation.trajectory import DrivePlan, camera_poses
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject, demo_world

CAMERA = Camera.from_intrinsics(50, 50, 31.5, 23.5, width=64, height=48)


def look(world: World, x: float, y: float, pitch_deg: float = 0, height: float = 1.0) -> Rendering:
    """Return the view from (x, y) along +x."""
    drive = DrivePlan(((x, y),), pitch_deg=pitch_deg, camera_height=height)
    return Renderer(Scene.of(world), CAMERA).render(camera_poses([[x, y, 0]], drive)[0])


def test_a_wall_straight_ahead_has_the_same_depth_everywhere() -> None:
    wall = Wall(line=((5, -10), (5, 10)), height=10, thickness=0.2)
    view = look(World("w", FloorPlan((0, 0, 1, 1)), walls=(wall,)), 1, 0, height=5)
    # Depth is measured along the optical axis, not along the ray.
    np.testing.assert_allclose(view.depth, np.full((48, 64), 3.9), rtol=0, atol=1e-4)
    assert (view.instances == BACKGROUND).all()
    # At the image's corner the ray leaves at atan(|(31.5, 23.5)| / 50) from the normal.
    assert view.incidence[0, 0] == pytest.approx(np.arctan(np.hypot(31.5, 23.5) / 50), abs=1e-4)


def test_where_there_is_nothing_depth_is_nan() -> None:
    view = look(World("w", FloorPlan((0, 0, 1, 1))), 5, 0)
    assert np.isnan(view.depth).all()
    assert np.isnan(view.incidence).all()
    assert (view.instances == BACKGROUND).all()
    assert (view.color == view.color[0, 0]).all()


def test_the_floor_lies_at_height_zero() -> None:
    drive = DrivePlan(((5, 5),), pitch_deg=60)
    (pose,) = camera_poses([[5, 5, 0.3]], drive)
    view = Renderer(Scene.of(World("w", FloorPlan((0, 0, 10, 10)))), CAMERA).render(pose)
    points = _points(view, CAMERA) @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(points[:, 2], np.zeros(48 * 64), rtol=0, atol=1e-4)


def test_the_nearer_of_two_things_is_seen() -> None:
    near, far = (
        WorldObject("cupboard", (3, 0), yaw_deg=180),
        WorldObject("cupboard", (5, 0), yaw_deg=180),
    )
    view = look(World("w", FloorPlan((0, 0, 1, 1)), (far, near)), 1, 0)
    assert view.instances[24, 32] == 1
    assert view.depth[24, 32] == pytest.approx(2 - 0.225, abs=1e-4)
    assert 0 not in view.instances  # wholly behind the near one


def test_all_points_of_an_object_lie_on_it() -> None:
    world = demo_world()
    renderer = Renderer(Scene.of(world))
    (pose,) = camera_poses([[0.4, 1.1, 0.3]], world.drive)
    view = renderer.render(pose)
    points = _points(view, DEFAULT_CAMERA) @ pose[:3, :3].T + pose[:3, 3]
    seen = view.instances[~np.isnan(view.depth)]
    assert len(np.unique(seen)) > 8
    for index in np.unique(seen[seen >= 0]):
        parts = placed(world.objects[index])
        z = np.concatenate([part.vertices[:, 2] for part in parts])
        mine = points[seen == index]
        outline = footprint(parts).buffer(1e-3)
        assert shapely.contains_xy(outline, mine[:, 0], mine[:, 1]).all()
        assert mine[:, 2].min() > z.min() - 1e-3
        assert mine[:, 2].max() < z.max() + 1e-3


def test_a_projected_corner_appears_where_the_pinhole_model_puts_it() -> None:
    cupboard = WorldObject(
        "cupboard", (4, 0), yaw_deg=180, size={"length": 1, "width": 1, "height": 1.5}
    )
    view = look(World("w", FloorPlan((0, 0, 1, 1)), (cupboard,)), 1, 0, height=0.75)
    drive = DrivePlan(((1, 0),), pitch_deg=0, camera_height=0.75)
    (pose,) = camera_poses([[1, 0, 0]], drive)
    # The front's upper left corner, seen from the camera: x = 3.52 (the doors' plane), y = 0.5.
    x, y, z = (invert(pose) @ [3.52, 0.5, 1.5, 1])[:3]
    u, v = 50 * x / z + 31.5, 50 * y / z + 23.5
    rows, cols = np.nonzero(view.instances == 0)
    assert abs(cols.min() - u) <= 1
    assert abs(rows.min() - v) <= 1


def test_a_lit_surface_is_brighter_than_one_in_the_shadow() -> None:
    table = WorldObject("table", (5, 5), size={"length": 2, "width": 2})
    view = look(World("w", FloorPlan((0, 0, 10, 10), color="white"), (table,)), 2, 5, 30)
    floor = (view.instances == BACKGROUND) & ~np.isnan(view.depth)
    points = np.full((48, 64, 3), np.nan)
    (pose,) = camera_poses([[2, 5, 0]], DrivePlan(((2, 5),), pitch_deg=30, camera_height=1.0))
    points[~np.isnan(view.depth)] = _points(view, CAMERA) @ pose[:3, :3].T + pose[:3, 3]
    under = floor & (np.abs(points[..., :2] - 5) < 0.8).all(axis=-1)
    beside = floor & (points[..., 0] < 3.5)
    assert under.sum() > 10
    assert view.color[under].mean() < 0.8 * view.color[beside].mean()


def test_the_same_pose_gives_the_same_picture() -> None:
    world = demo_world()
    poses = camera_poses([[2.2, 1.5, 1.0], [0.6, 1.1, 0.0]], world.drive)
    renderer, again = Renderer(Scene.of(world)), Renderer(Scene.of(world))
    first = renderer.render(poses[0])
    renderer.render(poses[1])
    for second in (renderer.render(poses[0]), again.render(poses[0])):
        assert (first.color == second.color).all()
        assert np.array_equal(first.depth, second.depth, equal_nan=True)
        assert (first.instances == second.instances).all()


def _points(view: Rendering, camera: Camera) -> np.ndarray:
    """Return the seen points in the optical frame, worked out from depth and K, shape (N, 3)."""
    v, u = np.nonzero(~np.isnan(view.depth))
    z = view.depth[v, u]
    return np.column_stack(
        [
            (u - camera.K[0, 2]) / camera.K[0, 0] * z,
            (v - camera.K[1, 2]) / camera.K[1, 1] * z,
            z,
        ]
    )
