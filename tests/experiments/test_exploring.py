"""A simulated robot that chooses its own way."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from scipy import ndimage

from hypermap.experiments.exploring import Robot, explore, milestones
from hypermap.mapping.config import profile
from hypermap.perception.frame import Camera
from hypermap.simulation.trajectory import planar_poses
from hypermap.simulation.truth import true_occupancy
from hypermap.simulation.world import load_world

# Two rooms with a door; the robot starts in the left one and has never seen the right one.
WORLD = """
name: two rooms
floor: {rectangle: [0, 0, 8, 4]}
walls:
  - {rectangle: [-0.05, -0.05, 8.05, 4.05]}
  - {line: [[4, 0], [4, 4]], doors: [{at: [4, 2], width: 1.0}]}
objects: [{model: plant, at: [7.2, 0.8]}, {model: sofa, at: [1.5, 3.4], yaw_deg: -90}]
drive: {waypoints: [[1.2, 1.2], [1.4, 1.4]], speed: 0.5, turn_rate_deg: 60}
"""
CAMERA = Camera.from_intrinsics(65.6, 65.6, 39.5, 29.5, width=80, height=60)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    file = tmp_path_factory.mktemp("worlds") / "rooms.yaml"
    file.write_text(WORLD)
    return load_world(file)


def test_a_robot_finds_the_other_room_and_what_stands_in_it(world):
    robot = Robot(0.2, most_meters=25.0)
    explored = explore(world, robot, profile("default"), every=2.0, camera=CAMERA)
    first, *_, last = explored.milestones
    assert last.area > 0.9
    assert last.objects == 1
    assert first.area < last.area
    assert first.meters < last.meters < 30
    assert explored.drive.waypoints[0][:2] == (1.2, 1.2)

    # It never drives into anything that is there.
    _, poses = planar_poses(explored.drive, rate=4)
    truth = true_occupancy(world)
    free = ndimage.distance_transform_edt(truth.cells == 0) * truth.grid.resolution
    rows, cols = truth.grid.cells_at(poses[:, :2]).T
    assert free[rows, cols].min() > 0.1

    # The drive can be recorded as any other, and shows the same.
    again = replace(world, drive=explored.drive)
    *_, end = milestones(again, profile("default"), every=100.0, radius=0.2, camera=CAMERA)
    assert end.meters == pytest.approx(last.meters, abs=0.5)
    assert end.area == pytest.approx(last.area, abs=0.05)


def test_a_robot_stops_where_it_is_reported_to(world):
    robot = Robot(0.2, most_meters=0.5, looks_at_objects=False)
    explored = explore(world, robot, profile("default"), camera=CAMERA)
    (only,) = explored.milestones
    assert 0.5 <= only.meters < 6
    assert only.seconds > 360 / 60  # it has turned around
    assert not math.isnan(only.area)


def test_without_a_drive_there_is_no_start(world):
    with pytest.raises(ValueError, match="has no drive, so there is no start"):
        explore(replace(world, drive=None), Robot(0.2), profile("default"))
