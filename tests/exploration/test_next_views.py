"""From where unsure objects are looked at next."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap import GridGeometry, Hypermap, OccupancyLayer, SemanticLayer, SemanticObject
from hypermap.core.evidence import EvidenceTable, is_one_sided
from hypermap.exploration import Explorer
from hypermap.exploration.next_views import new_angles
from hypermap.paths import PathSettings

ROBOT = PathSettings(robot_radius=0.2)


def evidence_from(cameras: dict[int, list[tuple[float, float]]]) -> EvidenceTable:
    """Return evidence that each object was seen from some places."""
    ids = [number for number, places in cameras.items() for _ in places]
    places = np.array([place for each in cameras.values() for place in each], dtype=np.float64)
    n = len(ids)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :2, 3] = places
    shapes = np.array([shapely.box(0, 0, 1, 1)] * n, dtype=object)
    return EvidenceTable(
        np.array(ids),
        np.arange(n),
        np.ones(n),
        shapes,
        np.zeros((n, 2)),
        np.arange(n) * 1.0,
        poses,
        shapes,
    )


def a_hall(
    *objects: SemanticObject, cameras=None, blocked: shapely.Geometry | None = None
) -> Hypermap:
    """Return a hall of 8 x 8 m with a table of 1 x 1 m in its middle, and objects."""
    grid = GridGeometry(160, 160, 0.05)
    cells = np.zeros(grid.shape, dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[70:90, 70:90] = 100
    if blocked is not None:
        cells[grid.cells_in(blocked)] = 100
    evidence = None if cameras is None else evidence_from(cameras)
    layers = [
        OccupancyLayer("occupancy", "map", grid, cells),
        SemanticLayer("semantic", "map", objects, evidence=evidence),
    ]
    return Hypermap(layers)


TABLE = SemanticObject("table", shapely.box(3.5, 3.5, 4.5, 4.5), 1, existence=18.0)
CUP = SemanticObject("cup", shapely.box(3.9, 3.9, 4.0, 4.0), 2, existence=2.5)
ALL_AROUND = [(1.0, 4.0), (4.0, 1.0), (7.0, 4.0), (4.0, 7.0)]
LEFT = [(1.0, 3.9), (1.0, 4.1), (1.5, 4.0)]


def test_what_was_seen_from_one_side_is_looked_at_from_the_other():
    hall = a_hall(TABLE, cameras={1: LEFT})
    (view,) = Explorer(hall, [1.0, 4.0], ROBOT).next_views()
    assert (view.item.object.id, view.is_one_sided, view.is_weak) == (1, True, False)
    assert view.pose.x > 4  # behind it, as far around as it is worth the way
    assert view.turn > math.radians(90)
    toward = math.atan2(4 - view.pose.y, 4 - view.pose.x)
    assert view.pose.yaw == pytest.approx(toward)
    gap = TABLE.footprint.distance(shapely.Point(view.pose.x, view.pose.y))
    assert 0.55 < gap < 2.5
    path = Explorer(hall, [1.0, 4.0], ROBOT).path_to(view)
    assert path.length == pytest.approx(view.distance, abs=0.05)


def test_what_is_sure_and_was_seen_from_all_around_is_left_alone():
    hall = a_hall(TABLE, cameras={1: ALL_AROUND})
    assert Explorer(hall, [1.0, 4.0], ROBOT).next_views() == []
    assert Explorer(a_hall(TABLE), [1.0, 4.0], ROBOT).next_views() == []


def test_what_was_seen_seldom_is_looked_at_again_over_the_table_that_it_stands_on():
    hall = a_hall(TABLE, CUP, cameras={1: ALL_AROUND, 2: [(1.0, 4.0)]})
    (view,) = Explorer(hall, [1.0, 4.0], ROBOT).next_views()
    assert (view.item.object.name, view.is_weak) == ("cup", True)
    known = Explorer(hall, [1.0, 4.0], ROBOT).next_views(sure_from=2.0)
    assert [each.is_weak for each in known] == [False]  # but still from one side alone


def test_where_existence_is_not_known_an_object_is_sure():
    drawn = replace(CUP, existence=None)
    assert Explorer(a_hall(TABLE, drawn), [1.0, 4.0], ROBOT).next_views() == []


def test_without_evidence_the_nearest_place_is_as_good_as_any():
    (view,) = Explorer(a_hall(TABLE, CUP), [1.0, 4.0], ROBOT).next_views()
    assert view.turn == math.pi
    assert view.pose.x < 4


def test_a_side_that_no_free_place_sees_is_no_view():
    wall = shapely.box(3.0, 0, 8, 8)
    hall = a_hall(TABLE, cameras={1: LEFT}, blocked=wall)
    assert Explorer(hall, [1.0, 4.0], ROBOT).next_views() == []


def test_the_nearest_of_like_views_comes_first():
    far = replace(CUP, id=3, footprint=shapely.box(6.5, 6.5, 6.6, 6.6))
    near = replace(CUP, id=4, footprint=shapely.box(1.5, 1.5, 1.6, 1.6))
    found = Explorer(a_hall(far, near), [1.0, 1.0], ROBOT).next_views()
    assert [view.item.object.id for view in found] == [4, 3]
    assert found[0].distance < found[1].distance


angles = st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=6)


@given(angles, angles)
def test_new_angles_are_those_to_the_nearest_camera(cameras, places):
    def around(bearings):
        return np.column_stack([np.cos(bearings), np.sin(bearings)]) * 2 + 1

    found = new_angles(np.ones(2), around(cameras), around(places))
    expected = [min(abs(math.remainder(p - c, math.tau)) for c in cameras) for p in places]
    assert found == pytest.approx(np.array(expected), abs=1e-9)


def test_a_thing_is_seen_from_one_side_by_cameras_within_a_right_angle():
    center = np.zeros(2)
    assert is_one_sided(center, np.array([[2.0, 0.0], [0.0, 2.0], [2.0, 2.0]]))
    assert not is_one_sided(center, np.array([[2.0, 0.0], [-2.0, 0.0]]))
    assert not is_one_sided(center, np.empty((0, 2)))
