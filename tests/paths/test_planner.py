"""Paths to objects and rooms, the nearest by path, and where a robot stands to look at things."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from hypermap import FrameTree, Hypermap, Pose2D, SemanticLayer, Transform
from hypermap.core.errors import HypermapError
from hypermap.core.masks import Zone
from hypermap.core.occupancy import OccupancyLayer
from hypermap.paths import NoPath, PathSettings, Planner

from .conftest import a_flat, square


def test_a_path_tells_its_length_rooms_and_doors(flat):
    path = Planner(flat).path([2.0, 2.5], [7.0, 2.5])
    # By hand: to the door's lower corners, (4.4, 3.5) and (4.6, 3.5), and on.
    assert path.length == pytest.approx(math.hypot(2.4, 1) + 0.2 + math.hypot(2.4, 1), abs=0.01)
    assert path.line.length == pytest.approx(path.length)
    assert [room.name for room in path.rooms] == ["kitchen", "room"]
    (door,) = path.doors
    assert door.place_xy == pytest.approx([4.5, 3.95], abs=0.1)


def test_a_path_within_a_room_passes_no_door(flat):
    path = Planner(flat).path([2.0, 2.5], [1.0, 1.0])
    assert ([room.name for room in path.rooms], path.doors) == (["kitchen"], ())


def test_without_rooms_a_path_is_a_path():
    path = Planner(a_flat()).path([2.0, 2.5], [7.0, 2.5])
    assert (path.rooms, path.doors) == ((), ())


def test_a_path_leads_to_rooms_by_name(flat):
    path = Planner(flat, PathSettings(robot_radius=0.3)).path("kitchen", "room")
    assert path.points_xy[0] == pytest.approx([2.1, 2.5], abs=0.6)
    assert path.points_xy[-1] == pytest.approx([6.6, 2.5], abs=0.1)


def test_the_nearest_cup_through_the_wall_is_not_the_nearest(flat):
    start = [5.0, 1.5]  # in the right room, next to the wall behind which the table is
    assert flat.nearest("cup", start)[0].object.id == 1
    (cup,) = flat.nearest("cup", start, by="path")
    assert cup.object.id == 3
    # By hand: nothing lies between, so the path is the straight line to the shape.
    assert cup.distance == pytest.approx(math.hypot(2.4, 2.4), abs=0.1)


def test_what_cannot_be_reached_is_not_among_the_nearest(flat):
    found = flat.nearest("cup", [5.0, 1.5], k=3, by="path")
    assert [item.object.id for item in found] == [3, 1]
    around = math.hypot(0.4, 2.0) + 0.2 + math.hypot(0.2, 1.9)
    assert found[1].distance == pytest.approx(around, abs=0.5)


def test_the_nearest_are_measured_in_a_frame_that_is_asked_for(flat):
    frames = FrameTree([Transform("map", "robot", Pose2D(5.0, 1.5))])
    moved = Hypermap(flat.layers, frames)
    assert moved.nearest("cup", [0, 0], by="path", frame_id="robot")[0].object.id == 3


def test_distance_is_by_air_or_by_path(flat):
    with pytest.raises(ValueError, match="by must be 'air' or 'path', got 'foot'"):
        flat.nearest("cup", [5.0, 1.5], by="foot")
    with pytest.raises(HypermapError, match="has no objects"):
        flat.nearest("Free", [5.0, 1.5], layer="occupancy", by="path")


def test_one_sweep_tells_the_distances_of_all_objects(flat):
    found = Planner(flat).nearest(None, [2.0, 2.5], k=None)
    assert [(item.object.name, item.object.id) for item in found] == [
        ("table", 2),
        ("refrigerator", 5),
        ("cup", 1),
        ("cup", 3),
    ]
    assert found[0].distance == pytest.approx(math.hypot(1.4, 0.5), abs=0.1)


def test_an_approach_pose_faces_the_object(flat):
    planner = Planner(flat, PathSettings(robot_radius=0.3))
    there = planner.approach("cup 3", distance=0.6, start=[2.0, 2.5])
    at = np.array([there.pose.x, there.pose.y])
    shape = there.object.object.footprint
    assert shape.distance(shapely.Point(at)) == pytest.approx(0.6, abs=0.05)
    assert there.distance == pytest.approx(0.6, abs=0.05)
    assert there.pose.yaw == pytest.approx(math.atan2(4.0 - at[1], 7.5 - at[0]))
    assert there.path.points_xy[-1] == pytest.approx(at)
    assert len(there.path.doors) == 1
    assert planner.approach(3).path is None


def test_a_cup_on_a_table_is_approached_over_the_table(flat):
    there = Planner(flat, PathSettings(robot_radius=0.2)).approach("cup 1", distance=0.9)
    assert there.pose.x < 4.4  # not from behind the wall
    assert math.cos(there.pose.yaw) > 0


@pytest.mark.parametrize(
    ("what", "robot", "distance", "start", "reason"),
    [
        ("cup 4", {}, 0.6, [2, 2], "cup 4 cannot be reached, because no path leads there"),
        ("cup 3", {"robot_radius": 0.6}, 0.6, [2, 2], "because no path leads there"),
        ("cup 1", {"robot_radius": 0.3}, 0.3, None, "because no place 0.3 m from it is free for"),
        ("cup 1", {"robot_radius": 0.8}, 0.6, None, "of 0.8 m cannot stand 0.6 m from"),
        ("cup", {}, 0.6, None, "3 objects are called 'cup'; ask for one of 'cup 1', 'cup 3'"),
        ("cap 3", {}, 0.6, None, "there is no object or room 'cap 3'; did you mean 'cup'"),
        (9, {}, 0.6, None, "there is no object or room 9"),
    ],
)
def test_what_cannot_be_reached_is_reported_with_the_reason(
    flat, what, robot, distance, start, reason
):
    with pytest.raises(HypermapError, match=reason):
        Planner(flat, PathSettings(**robot)).approach(what, distance, start)


def test_a_thing_behind_a_wall_is_not_in_sight():
    cells = np.zeros((60, 60), dtype=np.int8)
    cells[20:40, 20:40] = 100  # a block with a thing in its middle
    from hypermap.core.grid import GridGeometry

    hypermap = Hypermap(
        [
            OccupancyLayer("occupancy", "map", GridGeometry(60, 60, 0.05), cells),
            SemanticLayer("semantic", "map", [square("safe", 1.5, 1.5, 0)]),
        ]
    )
    with pytest.raises(NoPath, match=r"safe 0 cannot be reached, because it is not visible from"):
        Planner(hypermap).approach("safe", 0.5)
    with pytest.raises(NoPath, match=r"safe 0 cannot be reached, because it is not visible from"):
        Planner(hypermap).path("safe", [0.1, 0.1])
    assert Planner(hypermap).nearest("safe", [0.1, 0.1]) == []


def test_keepout_zones_around_objects_are_driven_around(flat):
    free = Planner(flat).path([5.0, 4.0], [8.3, 4.0])
    kept = Planner(flat, keepout=[Zone("cup", margin=0.4)]).path([5.0, 4.0], [8.3, 4.0])
    cup = square("cup", 7.5, 4.0, 3).footprint
    assert cup.distance(free.line) == 0
    assert cup.distance(kept.line) > 0.35


def test_rooms_are_reachable_through_doors_that_are_wide_enough(flat):
    assert Planner(flat, PathSettings(robot_radius=0.4)).is_reachable("kitchen", "room")
    assert not Planner(flat, PathSettings(robot_radius=0.5)).is_reachable("kitchen", "room")
    with pytest.raises(NoPath, match="room 'room' has no free place for a radius of 3 m"):
        Planner(flat, PathSettings(robot_radius=3.0)).is_reachable("kitchen", "room")


def test_a_room_is_meant_by_name_kind_or_id(flat):
    planner = Planner(flat)
    kitchen = planner.point_of("kitchen")
    number = planner.places.rooms["kitchen"].id
    assert planner.point_of(f"room {number}").tolist() == kitchen.tolist()
    twice = Hypermap(flat.layers)
    rooms = SemanticLayer("rooms", "map", flat.semantic("rooms"))
    rooms.rename([1, 2], "den")
    with pytest.raises(HypermapError, match=r"2 rooms are 'den'; ask for one of 'room 1' \(den\)"):
        Planner(twice.with_layer(rooms)).path([2.0, 2.5], "den")


def test_a_grid_in_another_frame_gives_paths_in_the_base_frame():
    flat = a_flat()
    occupancy = flat.occupancy()
    pose = Pose2D(1.0, 2.0, 0.3)
    frames = FrameTree([Transform("map", "grid", pose)])
    grid = OccupancyLayer("occupancy", "grid", occupancy.grid, occupancy.cells)
    moved = Hypermap([flat.semantic(), grid], frames)
    start, goal = pose.apply([[2.0, 2.5], [7.0, 2.5]])
    path = Planner(moved).path(start, goal)
    assert path.length == pytest.approx(Planner(flat).path([2.0, 2.5], [7.0, 2.5]).length)
    assert path.points_xy[1] == pytest.approx(pose.apply([4.4, 3.5])[0], abs=1e-3)
