"""The occlusion test: how much of an object a frame could see."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hypermap.core.trajectory import pose_from_rpy
from hypermap.mapping.occlusion import sample_points, visible_shares
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.perception.depth_view import DepthView
from hypermap.perception.frame import Camera, RgbdFrame

CAMERA = Camera.from_intrinsics(262.5, 262.5, 159.5, 119.5, 320, 240)
OPTICAL = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
CHAIR = shapely.box(1.8, -0.25, 2.3, 0.25)
HEIGHTS = np.array([[0.6, 1.4]])


def looking_along_x(
    depth: float | np.ndarray, x: float = 0.0, y: float = 0.0, yaw: float = 0.0
) -> DepthView:
    """A camera one meter high that measures the same depth everywhere, or a given image."""
    pose = pose_from_rpy(x, y, 1.0, 0.0, 0.0, yaw) @ OPTICAL
    image = np.full((240, 320), depth, dtype=np.float32)
    return DepthView.of(RgbdFrame(0.0, image, CAMERA, pose))


def shares(view: DepthView, shape: shapely.Polygon = CHAIR) -> tuple[float, float]:
    seen = visible_shares(view, sample_points([PreparedPolygon.of(shape)]), HEIGHTS, tolerance=0.15)
    return float(seen.visible[0]), float(seen.through[0])


@pytest.mark.parametrize(
    ("depth", "expected"),
    [(4.0, (1, 1)), (2.0, (1, 0)), (1.0, (0, 0)), (np.nan, (0, 0))],
    ids=["a wall behind it", "the object itself", "something before it", "no return"],
)
def test_what_the_rays_show_of_an_object(depth: float, expected: tuple[float, float]) -> None:
    assert shares(looking_along_x(depth)) == expected


def test_a_wall_right_behind_an_object_is_not_behind_all_of_it() -> None:
    samples = sample_points([PreparedPolygon.of(CHAIR)])
    seen = visible_shares(looking_along_x(2.44), samples, HEIGHTS, tolerance=0.15)
    assert (seen.visible, seen.through, seen.beyond) == (1, 0, 1)


@pytest.mark.parametrize("yaw", [np.pi, np.pi / 2, -np.pi / 2])
def test_nothing_is_seen_outside_the_image(yaw: float) -> None:
    assert shares(looking_along_x(4.0, yaw=yaw)) == (0, 0)


def test_half_of_an_object_may_be_hidden() -> None:
    depth = np.full((240, 320), 4.0)
    depth[:, :160] = 1.0  # the left half of the image
    visible, through = shares(looking_along_x(depth))
    assert 0.3 < visible < 0.7
    assert visible == through


def test_what_is_too_small_to_be_found_is_not_missed() -> None:
    cup = shapely.box(3.0, 0.0, 3.08, 0.08)
    heights = np.array([[1.0, 1.1]])
    samples = sample_points([PreparedPolygon.of(cup)])
    assert visible_shares(looking_along_x(6.0), samples, heights, 0.15).visible == 0
    assert visible_shares(looking_along_x(6.0, x=2.0), samples, heights, 0.15).visible == 1


def test_what_was_detected_from_as_far_is_missed_however_small_it_is() -> None:
    cup = shapely.box(3.0, 0.0, 3.08, 0.08)
    heights = np.array([[1.0, 1.1]])
    samples, view = sample_points([PreparedPolygon.of(cup)]), looking_along_x(6.0)
    for distance, expected in ((2.5, 0), (3.5, 1)):
        seen = visible_shares(view, samples, heights, 0.15, detected_from=np.array([distance]))
        assert (seen.visible, seen.through, seen.beyond) == (expected,) * 3


@given(corners=st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=3, max_size=9))
def test_hulls_are_sampled_alike_wherever_their_ring_begins(corners) -> None:
    hull = shapely.convex_hull(shapely.linestrings(np.round(corners, 2)))
    assume(isinstance(hull, shapely.Polygon))
    ring = shapely.get_coordinates(hull)[:-1]
    found = sample_points([PreparedPolygon.of(hull)])
    turned = sample_points([PreparedPolygon.of(shapely.Polygon(np.roll(ring, 1, axis=0)))])
    np.testing.assert_allclose(found.around, turned.around, atol=1e-9)
    np.testing.assert_allclose(found.xy, turned.xy, atol=1e-9)
    assert found.widths == pytest.approx(turned.widths)


def test_a_hole_in_a_shape_does_not_matter() -> None:
    hull = shapely.convex_hull(shapely.box(0, 0, 2, 2))
    pierced = hull.difference(shapely.box(1.0, 1.2, 1.8, 1.8))
    hole = shapely.get_coordinates(shapely.convex_hull(pierced.interiors[0]))
    for ring in (hole, hole[::-1]):
        found = sample_points([PreparedPolygon.of(shapely.Polygon(hull.exterior, [ring]))])
        np.testing.assert_allclose(found.xy[0, 0], (1, 1))
        assert found.widths == pytest.approx(2 * np.sqrt(2))


def test_without_objects_there_is_nothing_to_see() -> None:
    seen = visible_shares(looking_along_x(4.0), sample_points([]), np.empty((0, 2)), 0.15)
    assert len(seen.visible) == len(seen.through) == len(seen.beyond) == 0


@settings(deadline=None, max_examples=50)
@given(
    x=st.floats(-5e3, 5e3), y=st.floats(-5e3, 5e3), yaw=st.floats(-3, 3), depth=st.floats(0.5, 6)
)
def test_sight_does_not_depend_on_where_the_map_begins(
    x: float, y: float, yaw: float, depth: float
) -> None:
    here = shares(looking_along_x(depth))
    cos, sin = np.cos(yaw), np.sin(yaw)
    moved = shapely.transform(CHAIR, lambda xy: xy @ [[cos, sin], [-sin, cos]] + [x, y])
    there = shares(looking_along_x(depth, x, y, yaw), moved)
    assert there == pytest.approx(here, abs=0.25)  # samples may fall on the outline's other side
    assert there[1] <= there[0]


def test_the_seen_ground_ends_at_the_wall() -> None:
    view = looking_along_x(3.0)
    assert view.is_level
    assert view.ground.bounds[2] == pytest.approx(3.0, abs=0.01)


def test_the_seen_ground_does_not_reach_behind_what_stands_in_the_way() -> None:
    depth = np.full((240, 320), 4.0)
    depth[:, 120:200] = 1.5  # a cupboard in the middle
    depth[:, 0] = 0.5
    ground = looking_along_x(depth).ground
    assert ground.covers(shapely.Point(1.0, 0.0))
    assert not ground.intersects(shapely.Point(3.0, 0.0))
    assert ground.covers(shapely.Point(3.0, 1.2))


def test_without_returns_there_is_no_ground() -> None:
    assert looking_along_x(np.nan).ground.is_empty


def test_a_camera_that_looks_down_is_not_level() -> None:
    pose = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1.0]])
    view = DepthView.of(RgbdFrame(0.0, np.ones((240, 320), np.float32), CAMERA, pose))
    assert not view.is_level
