"""Poses are corrected by what the depth image shows of a known map."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import FREE, OCCUPIED, OccupancyLayer
from hypermap.core.trajectory import trajectory_of
from hypermap.evaluation.metrics import evaluate
from hypermap.mapping.agreement import Agreement
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.config import MappingConfig, profile
from hypermap.mapping.evidence_buffer import Evidence
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.recording_to_map import map_recording
from hypermap.mapping.stages import AlignmentConfig
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.simulation import PoseNoise, SimulatedRecording
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.truth import true_objects, true_occupancy
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject

pytestmark = pytest.mark.xdist_group("alignment")  # they share what takes long to make

CONFIG = AlignmentConfig()
ROOM = World(
    name="room",
    floor=FloorPlan(rectangle=(0, 0, 5, 4)),
    walls=(Wall(rectangle=(-0.05, -0.05, 5.05, 4.05)),),
    objects=(
        WorldObject("table", at=(3.0, 2.0), yaw_deg=20.0),
        WorldObject("chair", at=(2.2, 3.2), yaw_deg=-60.0),
        WorldObject("plant", at=(4.3, 0.6)),
    ),
    drive=DrivePlan(waypoints=((1.0, 1.0, 0.0), (1.0, 2.6, 30.0), (1.2, 2.6, -60.0)), speed=0.3),
)


def off_by(frame: RgbdFrame, dx: float, dy: float, turn: float) -> RgbdFrame:
    """The frame with a pose that is off by this much, turned about the camera."""
    cosine, sine = math.cos(turn), math.sin(turn)
    pose = frame.map_T_camera.copy()
    pose[:2, :3] = np.array([[cosine, -sine], [sine, cosine]]) @ pose[:2, :3]
    pose[:2, 3] += dx, dy
    return frame.moved_to(pose)


def error(found: RgbdFrame, true: RgbdFrame) -> tuple[float, float]:
    """How far a pose is off: meters over the floor, and degrees."""
    distance = np.hypot(*(found.map_T_camera - true.map_T_camera)[:2, 3])
    cosine = (np.trace(found.map_T_camera[:3, :3].T @ true.map_T_camera[:3, :3]) - 1) / 2
    return float(distance), math.degrees(math.acos(min(cosine, 1.0)))


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    return list(SimulatedRecording(ROOM, rate=0.5).frames())


@settings(max_examples=30, deadline=None)
@given(
    dx=st.floats(-0.06, 0.06),
    dy=st.floats(-0.06, 0.06),
    turn_deg=st.floats(-1.5, 1.5),
    grid_yaw=st.sampled_from([0.0, 0.7, math.pi]),
)
def test_poses_that_are_off_are_brought_back(
    frames: list[RgbdFrame], dx: float, dy: float, turn_deg: float, grid_yaw: float
) -> None:
    aligner = Aligner(turned_map(grid_yaw), CONFIG)
    for true in [*frames, *frames]:  # by the first ones it is seen how far poses are off
        found = aligner.align(off_by(true, dx, dy, math.radians(turn_deg)))
    distance, angle = error(found, true)
    assert distance < 0.03
    assert angle < 0.6


@functools.cache
def turned_map(yaw: float) -> OccupancyLayer:
    """The room's true map, in cells of 2 cm that are turned by an angle about its middle."""
    exact = true_occupancy(ROOM, resolution=0.01)
    corner = Pose2D(2.5, 2.0, yaw).apply([[-3.5, -3.5]])[0]
    grid = GridGeometry(350, 350, 0.02, Pose2D(corner[0], corner[1], yaw))
    rows, cols = np.indices(grid.shape).reshape(2, -1)
    values = exact.value_at(grid.centers(rows, cols)).reshape(grid.shape)
    return OccupancyLayer("occupancy", "map", grid, values.astype(np.int8))


@pytest.mark.parametrize("resolution", [0.02, 0.05])
def test_exact_poses_stay_where_they_are(frames: list[RgbdFrame], resolution: float) -> None:
    aligner = Aligner(true_occupancy(ROOM, resolution=resolution), CONFIG)
    errors = np.array([error(aligner.align(true), true) for true in [*frames, *frames]])
    distance, angle = np.sqrt(np.mean(errors**2, axis=0))
    assert distance < 0.005
    assert angle < 0.05


def test_it_is_learnt_anew_when_poses_get_worse_and_better(frames: list[RgbdFrame]) -> None:
    aligner = Aligner(turned_map(0.0), CONFIG)

    def error_after(dx: float, turn: float) -> float:
        for true in frames * 5:
            found = aligner.align(off_by(true, dx, 0.0, turn))
        return error(found, true)[0] / 0.05 + error(found, true)[1]

    exact = error_after(0.0, 0.0)
    assert exact < 0.2
    assert error_after(0.05, 0.015) < 0.8  # of 1.86
    assert error_after(0.0, 0.0) < 0.3


def test_what_was_learnt_outlives_another_map(frames: list[RgbdFrame]) -> None:
    aligner, fresh = (Aligner(true_occupancy(ROOM), CONFIG) for _ in range(2))
    for true in frames * 3:
        aligner.align(true)
    aligner.replace_map(turned_map(0.0))
    fresh.replace_map(turned_map(0.0))
    slightly_off = off_by(frames[0], 0.02, 0.02, 0.004)
    moved_by = [error(a.align(slightly_off), slightly_off)[0] for a in (aligner, fresh)]
    assert moved_by[0] < moved_by[1]


def test_what_the_depth_image_does_not_show_stays_as_it_was() -> None:
    """In a corridor without end nobody knows how far along it one is."""
    cells = np.full((60, 1000), FREE, np.int8)
    cells[:20] = cells[40:] = OCCUPIED
    corridor = OccupancyLayer("occupancy", "map", GridGeometry(1000, 60, 0.05), cells)
    camera = Camera.from_intrinsics(150, 150, 79.5, 59.5, 160, 120)
    # It looks along the x axis, half a meter from each of the walls, which are at y = 1 and 2 m.
    pose = np.array([[0, 0, 1, 25.0], [-1, 0, 0, 1.5], [0, -1, 0, 1.2], [0, 0, 0, 1]])
    right = (np.arange(160) - 79.5) / 150
    depth = np.tile((0.5 + 0.025) / np.abs(right), (120, 1)).astype(np.float32)
    frame = RgbdFrame(0.0, np.where(depth < 5, depth, np.float32(np.nan)), camera, pose)
    found = Aligner(corridor, CONFIG).align(off_by(frame, 0.04, 0.05, math.radians(1.0)))
    assert found.map_T_camera[1, 3] == pytest.approx(1.5, abs=0.025)
    assert found.map_T_camera[0, 3] == pytest.approx(25.04, abs=0.005)
    assert error(found, frame)[1] < 0.7


def down(depth: float) -> RgbdFrame:
    """A frame that shows nothing but the floor."""
    camera = Camera.from_intrinsics(150, 150, 79.5, 59.5, 160, 120)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = 2.5, 2.0, 1.2
    return RgbdFrame(0.0, np.full((120, 160), depth, np.float32), camera, pose)


def moved(frame: RgbdFrame, x: float) -> RgbdFrame:
    pose = frame.map_T_camera.copy()
    pose[0, 3] += x
    return frame.moved_to(pose)


def test_a_frame_that_shows_nothing_of_the_map_keeps_its_pose(frames: list[RgbdFrame]) -> None:
    known = true_occupancy(ROOM)
    unknown = OccupancyLayer("occupancy", "map", known.grid, np.full(known.cells.shape, -1))
    all_free = OccupancyLayer("occupancy", "map", known.grid, np.zeros(known.cells.shape, int))
    for layer, frame in [
        (known, down(1.2)),
        (known, down(np.nan)),
        (known, moved(frames[0], 1e6)),
        (known, moved(frames[0], -30.0)),
        (unknown, frames[0]),
        (all_free, frames[0]),
        (OccupancyLayer("occupancy", "map"), frames[0]),
    ]:
        found = Aligner(layer, CONFIG).align(frame)
        np.testing.assert_array_equal(found.map_T_camera, frame.map_T_camera)


@pytest.mark.parametrize("shape", [(1, 200), (200, 1)])
def test_one_row_or_column_of_a_map_moves_no_pose(
    frames: list[RgbdFrame], shape: tuple[int, int]
) -> None:
    cells = np.zeros(shape, np.int8)
    cells.ravel()[::3] = OCCUPIED
    grid = GridGeometry(shape[1], shape[0], 0.05)
    found = Aligner(OccupancyLayer("occupancy", "map", grid, cells), CONFIG).align(frames[0])
    np.testing.assert_array_equal(found.map_T_camera, frames[0].map_T_camera)


def test_a_camera_that_is_about_to_leave_the_map_keeps_its_pose(frames: list[RgbdFrame]) -> None:
    """Of the map only its last column is near enough."""
    known = true_occupancy(ROOM)
    assert known.grid is not None
    resolution, edge = known.grid.resolution, known.grid.origin.x
    for cells in range(-3, 4):
        x = edge - 2 * CONFIG.max_range + (cells + 0.5) * resolution
        frame = moved(frames[0], x - frames[0].map_T_camera[0, 3])
        found = Aligner(known, CONFIG).align(frame)
        np.testing.assert_array_equal(found.map_T_camera, frame.map_T_camera)


def test_infinite_depth_is_no_depth(frames: list[RgbdFrame]) -> None:
    lost, infinite = frames[0].depth.copy(), frames[0].depth.copy()
    lost[::3], infinite[::3] = np.nan, np.inf
    poses = [
        Aligner(true_occupancy(ROOM), CONFIG)
        .align(off_by(dataclasses.replace(frames[0], depth=depth), 0.05, 0.04, 0.02))
        .map_T_camera
        for depth in (lost, infinite)
    ]
    assert error(frames[0].moved_to(poses[0]), frames[0])[0] < 0.05
    np.testing.assert_array_equal(*poses)


def test_what_is_not_in_the_map_does_not_move_the_pose(frames: list[RgbdFrame]) -> None:
    """Someone stands in front of the robot."""
    depth = frames[0].depth.copy()
    depth[40:, 100:180] = 1.0
    with_person = dataclasses.replace(frames[0], depth=depth)
    given_pose = off_by(with_person, 0.04, 0.04, 0.015)
    distance, angle = error(Aligner(turned_map(0.0), CONFIG).align(given_pose), frames[0])
    assert distance < 0.03
    assert angle < 0.6


def test_a_cloud_serves_as_well_as_a_depth_image(frames: list[RgbdFrame]) -> None:
    given_pose = off_by(frames[1], 0.04, -0.03, 0.015)
    of_depth = Aligner(true_occupancy(ROOM), CONFIG).align(given_pose)
    cloud = dataclasses.replace(given_pose, cloud=given_pose.points())
    of_cloud = Aligner(true_occupancy(ROOM), CONFIG).align(cloud)
    np.testing.assert_allclose(of_cloud.map_T_camera, of_depth.map_T_camera, atol=1e-4)


def test_correcting_the_pose_does_not_decode_the_color(frames: list[RgbdFrame]) -> None:
    def never() -> NDArray[np.uint8]:
        raise AssertionError("nobody looks at the color")

    frame = RgbdFrame(0.0, frames[0].depth, frames[0].camera, frames[0].map_T_camera, color=never)
    Aligner(true_occupancy(ROOM), CONFIG).align(frame)


def evidence_of(mapper: Mapper) -> list[Evidence]:
    return [item for track in mapper.evidence.tracks().objects for item in track.buffer.items]


def test_evidence_knows_how_its_pose_was_corrected(frames: list[RgbdFrame]) -> None:
    mapper = Mapper(profile("default"), detections_from_recording(), true_occupancy(ROOM))
    for frame in frames:
        mapper.add(off_by(frame, 0.05, -0.04, 0.02))
    items = evidence_of(mapper)
    given = {frame.stamp: off_by(frame, 0.05, -0.04, 0.02) for frame in frames}
    assert len({item.correction for item in items}) > 3
    for item in items:
        frame, (x, y, turn) = given[item.stamp], item.correction
        assert np.allclose(off_by(frame, x, y, turn).map_T_camera, item.map_T_camera)
    stamps, poses = mapper.logged_poses()
    mapper.correct(trajectory_of(stamps, poses))
    assert [one.correction for one in evidence_of(mapper)] == [one.correction for one in items]
    poses[:, 0, 3] += 0.1
    mapper.correct(trajectory_of(stamps, poses))
    assert {item.correction for item in evidence_of(mapper)} == {(0.0, 0.0, 0.0)}


def test_objects_come_to_lie_where_they_are_in_a_known_map() -> None:
    noise = PoseNoise(position=0.01, yaw_deg=0.3, drift=0.04, drift_yaw_deg=1.0)
    recording = SimulatedRecording(ROOM, rate=2.0, pose_noise=noise, seed=3)
    config = profile("default")
    as_given = dataclasses.replace(config, alignment=AlignmentConfig(enabled=False))
    truth = {thing.name: thing.footprint.centroid for thing in true_objects(ROOM).objects()}

    def mean_distance(config: object) -> float:
        found = map_recording(recording, detections_from_recording(), config)["semantic"].objects()
        assert {thing.name for thing in found} == set(truth)
        return float(np.mean([t.footprint.centroid.distance(truth[t.name]) for t in found]))

    assert mean_distance(config) < 0.8 * mean_distance(as_given)


def test_a_known_map_does_not_make_the_map_of_exact_poses_worse() -> None:
    recording = SimulatedRecording(ROOM, rate=1.0, seed=4)
    config = profile("default")
    as_given = dataclasses.replace(config, alignment=AlignmentConfig(enabled=False))
    truth = true_objects(ROOM).objects()

    def quality(config: MappingConfig) -> float:
        found = map_recording(recording, detections_from_recording(), config)["semantic"].objects()
        return evaluate(found, truth).overall.iou

    assert quality(config) > quality(as_given) - 0.005


def test_the_profile_of_the_thesis_takes_poses_as_they_are(frames: list[RgbdFrame]) -> None:
    mapper = Mapper(profile("thesis"), lambda _: Detections.of([], [], []), true_occupancy(ROOM))
    given_pose = off_by(frames[0], 0.04, 0.04, 0.015)
    observation = mapper.add(given_pose)
    assert observation is not None
    np.testing.assert_array_equal(observation.map_T_camera, given_pose.map_T_camera)


@pytest.fixture(scope="module")
def drive() -> tuple[list[RgbdFrame], list[RgbdFrame]]:
    """Frames with exact poses, and the same with poses that drift."""
    camera = Camera.from_intrinsics(131, 131, 79.5, 59.5, 160, 120)
    exact = list(SimulatedRecording(ROOM, camera=camera, rate=3.0).frames())
    rng = np.random.default_rng(1)
    errors = np.cumsum(rng.normal(size=(len(exact), 3)) * [0.01, 0.01, 0.005], axis=0)
    return exact, [off_by(frame, *error) for frame, error in zip(exact, errors, strict=True)]


def test_images_tell_whether_corrected_poses_are_worse(
    drive: tuple[list[RgbdFrame], list[RgbdFrame]],
) -> None:
    exact, drifting = drive
    for poses, corrected, is_worse in ((exact, drifting, True), (drifting, exact, False)):
        agreement = Agreement()
        for frame, other in zip(poses, corrected, strict=True):
            agreement.add(frame, other.map_T_camera)
        assert agreement.is_worse == is_worse


def test_a_bent_map_moves_exact_poses_no_more_once_images_tell(
    drive: tuple[list[RgbdFrame], list[RgbdFrame]],
) -> None:
    exact = true_occupancy(ROOM, resolution=0.02)
    assert exact.grid is not None
    assert exact.cells is not None
    rows, cols = np.indices(exact.grid.shape)
    bend = np.rint(4 * np.sin(rows / 12)).astype(int)  # cells, up to 8 cm
    cells = exact.cells[rows, np.clip(cols + bend, 0, exact.grid.width - 1)]
    aligner = Aligner(OccupancyLayer("occupancy", "map", exact.grid, cells), CONFIG)
    for frame in drive[0]:
        aligner.align(frame)
    left = aligner.corrections.summary()["as_recorded"]
    assert any("distorted map" in reason for reason in left)


def test_what_became_of_the_poses_is_counted(frames: list[RgbdFrame]) -> None:
    aligner = Aligner(turned_map(0.0), CONFIG)
    for _ in range(3):
        for frame in frames:
            aligner.align(off_by(frame, 0.05, 0.0, 0.015))
    aligner.align(down(1.2))
    aligner.align(moved(frames[0], 1e6))
    found = aligner.corrections.summary()
    assert found["corrected"] + sum(found["as_recorded"].values()) == 3 * len(frames) + 2
    assert found["corrected"] >= 2 * len(frames)
    assert 0.03 < found["median_m"] < 0.06
    assert 0.4 < found["median_deg"] < 1.2
    assert found["median_m"] <= found["most_m"]
    assert {reason.split()[0] for reason in found["as_recorded"]} >= {"too", "the"}

    exact = Aligner(turned_map(0.0), CONFIG)
    for frame in frames:
        exact.align(frame)
    (reason,) = exact.corrections.summary()["as_recorded"]
    assert reason.startswith("corrections so far are no larger than their own errors")
