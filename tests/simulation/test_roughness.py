"""Glass, people, false places and maps with errors, through a whole recording."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import (
    EXACT_DEPTH,
    EXACT_DETECTOR,
    Errors,
    MapNoise,
    PoseNoise,
    SimulatedRecording,
    built_in_world,
    errors_of_level,
)
from hypermap.simulation.laser_map import _registered, outlines_at
from hypermap.simulation.people import Walker, draw_walkers, walkers_at
from hypermap.simulation.scene import wall_parts
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.truth import true_occupancy
from hypermap.simulation.world import Doorway, FloorPlan, Wall, World, WorldObject

PANE = Wall(line=((3, 0), (3, 4)), thickness=0.02, glass=True)
ROOM = World(
    "room",
    FloorPlan((0, 0, 6, 4)),
    objects=(WorldObject("table", (4.5, 2)), WorldObject("chair", (4.2, 3.2))),
    walls=(Wall(rectangle=(-0.05, -0.05, 6.05, 4.05)),),
    drive=DrivePlan(((0.5, 2), (1.5, 2), (2.0, 2.0, 40)), speed=0.5),
)
EXACT = Errors(EXACT_DEPTH, PoseNoise(), EXACT_DETECTOR)


def frames(world: World, errors: Errors, count: int = 100, **options: object) -> list[RgbdFrame]:
    recording = SimulatedRecording.with_errors(world, errors, **{"rate": 1.0, **options})
    return list(itertools.islice(recording.frames(), count))


def test_depth_goes_through_glass_and_the_camera_still_sees_what_is_behind() -> None:
    with_pane = replace(ROOM, walls=(*ROOM.walls, PANE))
    plain, seen = frames(ROOM, EXACT, 1)[0], frames(with_pane, EXACT, 1)[0]
    assert sorted(seen.detections.names) == ["chair", "table"]
    is_pane = np.abs(seen.depth - plain.depth) > 0.01
    assert 0.02 < is_pane.mean() < 0.1  # a tenth of what shows the pane
    assert (seen.depth[is_pane] < plain.depth[is_pane]).all()
    assert not (seen.color == plain.color).all()
    solid = replace(ROOM, walls=(*ROOM.walls, replace(PANE, glass=False)))
    assert len(frames(solid, EXACT, 1)[0].detections) == 0
    centers = [[3.0, 2.0]]
    assert true_occupancy(with_pane).value_at(centers).tolist() == [OCCUPIED]
    laser = MapNoise("laser").make(with_pane, np.random.default_rng(0))
    assert laser.value_at(centers).tolist() == [FREE]


def test_people_walk_along_the_way_and_are_not_in_the_truth() -> None:
    errors = replace(EXACT, people=3)
    recording = SimulatedRecording.with_errors(ROOM, errors, rate=2, seed=3)
    names = [frame.detections.names.tolist() for frame in recording.frames()]
    assert any("person" in found for found in names)
    depths = [frame.depth for frame in recording.frames()]
    again = [frame.depth for frame in recording.frames()]
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(depths, again, strict=True))
    assert np.array_equal(recording.occupancy().cells, true_occupancy(ROOM).cells)


@given(st.floats(0, 500), st.floats(0, 40))
def test_somebody_who_walks_stays_on_the_way_and_is_never_faster(
    stamp: float, start: float
) -> None:
    way = shapely.LineString([(0, 0), (4, 0), (4, 3)])
    walker = Walker(way, start, 1.2, "teal")
    a, b = walker.at(stamp).place, walker.at(stamp + 0.5).place
    assert way.distance(shapely.Point(a)) < 1e-9
    assert math.dist(a, b) <= 0.6 + 1e-9


def test_people_step_out_of_the_way_of_the_camera() -> None:
    walkers = draw_walkers(5, ROOM.drive, np.random.default_rng(0))
    for stamp in range(20):
        for camera in ((0.5, 2.0), (1.5, 2.0)):
            here = walkers_at(walkers, stamp, camera)
            assert all(math.dist(one.place, camera) > 0.8 for _, one in here)
    assert draw_walkers(2, DrivePlan(((1, 1), (1, 1, 90))), np.random.default_rng(0)) == []


def test_a_false_place_is_seen_again_from_the_same_side() -> None:
    noise = replace(EXACT_DETECTOR, false_places=6, false_place_rate=1.0)
    errors = replace(EXACT, detector=noise)
    with_places = frames(ROOM, errors, rate=4.0, seed=1)
    without = frames(ROOM, EXACT, rate=4.0, seed=1)
    extra = [
        len(a.detections) - len(b.detections) for a, b in zip(with_places, without, strict=True)
    ]
    assert max(extra) >= 2
    assert sum(more > 0 for more in extra) > 5  # not once, but frame after frame
    assert all(
        np.array_equal(a.depth, b.depth, equal_nan=True)
        for a, b in zip(with_places, without, strict=True)
    )


def test_late_poses_are_those_of_the_moment_before() -> None:
    late = replace(EXACT, poses=PoseNoise(time_offset=0.2))
    there = frames(ROOM, EXACT, 3)
    seen = frames(ROOM, late, 3)
    assert seen[0].map_T_camera[:2, 3].tolist() == [0.5, 2]  # it stood still before it started
    assert seen[1].map_T_camera[0, 3] == pytest.approx(there[1].map_T_camera[0, 3] - 0.1)
    assert np.array_equal(seen[1].depth, there[1].depth, equal_nan=True)


def test_a_wrong_mounting_turns_all_poses_alike() -> None:
    wrong = replace(EXACT, poses=PoseNoise(mounting_deg=1, mounting=0.02))
    pairs = zip(frames(ROOM, EXACT), frames(ROOM, wrong), strict=True)
    offsets = [np.linalg.inv(a.map_T_camera) @ b.map_T_camera for a, b in pairs]
    assert all(offset == pytest.approx(offsets[0], abs=1e-9) for offset in offsets)
    assert np.linalg.norm(offsets[0][:3, 3]) == pytest.approx(0.02)


def test_a_wall_is_cut_into_its_outline() -> None:
    wall = Wall(line=((0, 0), (2, 0)), thickness=0.2, doors=(Doorway((1, 0), 0.5),))
    lines = outlines_at(0.2, wall_parts(wall))
    cut = shapely.union_all(shapely.linestrings(lines))
    boxes = [shapely.box(-0.1, -0.1, 0.75, 0.1), shapely.box(1.25, -0.1, 2.1, 0.1)]
    expected = shapely.union_all([box.exterior for box in boxes])
    assert cut.hausdorff_distance(expected) < 1e-9
    assert len(outlines_at(5.0, wall_parts(wall))) == 0


def test_a_laser_maps_walls_and_legs_and_leaves_unknown_what_it_did_not_see() -> None:
    laser = MapNoise("laser").make(ROOM, np.random.default_rng(0))
    # The face of the far wall lies at x = 6, the near one at y = 0; errors of matching are small.
    assert OCCUPIED in laser.value_at([[x, 2.7] for x in np.arange(5.9, 6.15, 0.025)])
    assert OCCUPIED in laser.value_at([[1.5, y] for y in np.arange(-0.1, 0.1, 0.025)])
    assert laser.value_at([[4.5, 2.0]]).tolist() == [FREE]  # below the table's top
    assert laser.value_at([[6.4, 4.4]]).tolist() == [UNKNOWN]
    again = MapNoise("laser").make(ROOM, np.random.default_rng(0))
    assert np.array_equal(laser.cells, again.cells)


@given(st.floats(-3, 3), st.floats(-10, 10), st.floats(-10, 10))
def test_a_laser_map_is_turned_and_moved_onto_the_true_drive(
    turn: float, x: float, y: float
) -> None:
    true = np.array([[0.5, 2, 0], [1.5, 2, 0.3], [1.5, 2, 2], [1, 3, 7]])
    cosine, sine = math.cos(turn), math.sin(turn)
    moved = true @ [[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]] + [x, y, turn]
    registered = _registered(moved, true)
    assert registered[:, :2] == pytest.approx(true[:, :2], abs=1e-9)
    assert np.exp(1j * registered[:, 2]) == pytest.approx(np.exp(1j * true[:, 2]), abs=1e-9)


def test_what_a_bend_lays_over_itself_is_mapped_once() -> None:
    floor = built_in_world("floor")
    exact = true_occupancy(floor)
    bent = MapNoise(bend=0.04).make(floor, np.random.default_rng(0))
    free, occupied = (
        np.count_nonzero(bent.cells == value) / np.count_nonzero(exact.cells == value)
        for value in (FREE, OCCUPIED)
    )
    assert free == pytest.approx(1, rel=0.1)
    assert 1 <= occupied < 1.3  # a wall that is not straight touches more cells


def test_a_bent_map_is_off_by_as_much_as_asked() -> None:
    noise = MapNoise(bend=0.03)
    points = np.random.default_rng(1).uniform(0, 40, (4000, 2))
    moves = [noise._bend(np.random.default_rng(seed))(points) - points for seed in range(10)]
    assert np.std(moves) == pytest.approx(0.03, rel=0.15)
    near = noise._bend(np.random.default_rng(0))(points + 0.05) - points - 0.05
    assert np.abs(near - moves[0]).max() < 0.01  # smooth
    exact, bent = true_occupancy(ROOM), MapNoise(bend=0.1).make(ROOM, np.random.default_rng(0))
    assert (exact.value_at(points) != bent.value_at(points)).any()


def test_the_same_seed_gives_the_same_bytes_at_each_level() -> None:
    for level in ("rough", "harsh"):
        a, b, other = (
            frames(ROOM, errors_of_level(level, "tof"), 2, seed=seed) for seed in (4, 4, 5)
        )
        assert a[1].depth.tobytes() == b[1].depth.tobytes() != other[1].depth.tobytes()
        assert a[1].map_T_camera.tobytes() == b[1].map_T_camera.tobytes()
        assert a[1].detections.xyxy.tobytes() == b[1].detections.xyxy.tobytes()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MapNoise(bend=-1), "bend must be a number of at least 0, got -1"),
        (lambda: MapNoise(bend_length=0), "bend_length must be positive"),
        (lambda: Errors(people=-1), "people must be between 0 and 100, got -1"),
    ],
)
def test_errors_out_of_range_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
