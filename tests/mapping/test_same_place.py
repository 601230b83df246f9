"""Whether a drive shows the place of the map that it is mapped onto."""

from __future__ import annotations

import dataclasses
import functools
import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.core.trajectory import Trajectory
from hypermap.formats import save_map
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.recording_to_map import map_recording
from hypermap.mapping.same_place import Likeness, OtherPlace, PlaceCheck
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.recording import SameRecording
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.simulation.levels import errors_of_level

pytestmark = pytest.mark.xdist_group("same_place")  # they share what takes long to make

SMALL = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)
SOURCE = detections_from_recording()
DAY = 86_400.0


@functools.cache
def recording() -> SimulatedRecording:
    return SimulatedRecording.with_errors(
        demo_world(), errors_of_level("robot"), camera=SMALL, rate=0.45, has_occupancy=False
    )


@functools.cache
def drive() -> list[RgbdFrame]:
    return list(recording().frames())


@functools.cache
def first_day() -> Hypermap:
    mapper = Mapper(profile("default"), SOURCE, drive="day")
    for each in drive():
        mapper.add(each)
    return mapper.hypermap()


class NextDay(SameRecording):
    """The same drive a day later, in a frame that may be another."""

    def __init__(self, world: Pose2D, count: int | None = None) -> None:
        super().__init__(recording())
        self._world, self._count = world, count

    def frames(self, _on_bad: object = None) -> Iterator[RgbdFrame]:
        matrix = np.eye(4)
        matrix[np.ix_([0, 1, 3], [0, 1, 3])] = self._world.matrix()
        for frame in drive()[: self._count]:
            later = dataclasses.replace(frame, stamp=frame.stamp + DAY, color_stamp=None)
            yield later.moved_to(matrix @ frame.map_T_camera)


def mapped(drive: NextDay, onto: Hypermap, has_objects: bool = True, **options: bool) -> Hypermap:
    source = SOURCE if has_objects else None
    return map_recording(drive, source, profile("default"), onto=onto, **options)


@pytest.mark.parametrize("has_objects", [True, False])
def test_the_same_place_a_day_later_is_mapped_without_a_word(caplog, has_objects):
    made = mapped(NextDay(Pose2D(0.05, 0.05, 0.01)), first_day(), has_objects)
    assert made.metadata["frames"]["used"] > first_day().metadata["frames"]["used"]
    assert "shows the place" not in caplog.text


@pytest.mark.parametrize(
    ("world", "has_objects"),
    [(Pose2D(2.5, 1.0, 0.0), True), (Pose2D(2.5, 1.0), False), (Pose2D(6.0, 4.0, np.pi), False)],
)
def test_a_drive_in_another_frame_is_refused(world, has_objects):
    with pytest.raises(OtherPlace, match=r"does not fit the map: \d+% of \d+ m of walls agree"):
        mapped(NextDay(world), first_day(), has_objects)


@pytest.mark.parametrize("world", [Pose2D(6.0, 4.0, np.pi), Pose2D(50.0, 0.0, 0.0)])
def test_a_live_map_warns_once_of_another_frame(tmp_path: Path, world: Pose2D) -> None:
    save_map(first_day(), tmp_path / "office.hmap")
    settings = LiveSettings(depth_topic="/d", detections_topic="/b", onto=f"{tmp_path}/office.hmap")
    live = LiveMap(settings)
    frames = list(NextDay(world).frames())
    frames += [dataclasses.replace(frame, stamp=frame.stamp + DAY) for frame in frames]
    said = [live.add(frame)[1] for frame in frames]
    (warning,) = filter(None, said)
    assert "what the robot sees does not fit the map" in warning


def test_it_is_mapped_anyway_if_the_user_vouches_for_it():
    drive = NextDay(Pose2D(2.5, 1.0, 0.0), count=2)
    assert mapped(drive, first_day(), has_objects=False, same_place=True).metadata["frames"]


def test_a_drive_that_shares_too_little_is_mapped_with_a_word(caplog):
    caplog.set_level(logging.WARNING)
    mapped(NextDay(Pose2D(7.0, 0.0, 0.0)), first_day(), has_objects=False)
    assert "could not check whether" in caplog.text


@pytest.mark.parametrize("count", [3, None])
def test_a_drive_that_has_no_floor_in_common_with_the_map_is_refused(count):
    why = r"does not fit the map: the two have no floor in common, and are 4\d.\d m apart; is it"
    way = ".* If it is another part of the same place, in the frame of the map, --same-place maps"
    with pytest.raises(OtherPlace, match=why + way):
        mapped(NextDay(Pose2D(50.0, 0.0, 0.0), count), first_day())


def test_a_drive_through_the_next_room_is_mapped_with_a_word(caplog):
    caplog.set_level(logging.WARNING)
    shift = 7.6  # the room is 7 m wide, and what is seen through its door is in no other frame
    check = PlaceCheck(first_day(), profile("default").occupancy)
    mapper = Mapper(profile("default"), None)
    mapper.place = check
    for frame in NextDay(Pose2D(shift, 0.0, 0.0)).frames():
        mapper.add(frame)
    check.check("tuesday", is_last=True)
    assert 0 < check.likeness.gap < 0.5
    assert "could not check whether tuesday" in caplog.text


def test_a_drive_that_begins_where_the_map_does_and_looks_the_other_way_is_of_the_same_place():
    """No camera sees the floor at its own feet, so that nothing that they see is the same."""
    before = Mapper(profile("default"), None, drive="day")
    for frame in drive()[:3]:
        before.add(frame)
    here = Pose2D(*drive()[0].map_T_camera[:2, 3])
    turned = NextDay(here @ Pose2D(yaw=np.pi) @ here.inverse(), count=3)
    made = mapped(turned, before.hypermap(), has_objects=False)
    assert made.metadata["frames"]["used"] == 6


def test_a_drive_may_come_to_the_known_floor_at_its_end():
    check = PlaceCheck(first_day(), profile("default").occupancy)
    mapper = Mapper(profile("default"), None)
    mapper.place = check
    for frame in NextDay(Pose2D(50.0, 0.0, 0.0)).frames():
        mapper.add(frame)
    check.compare()
    assert check.likeness.is_apart
    check.check("tuesday")
    for frame in NextDay(Pose2D(0.0, 0.0, 0.0)).frames():
        mapper.add(dataclasses.replace(frame, stamp=frame.stamp + DAY))
    check.check("tuesday", is_last=True)


def test_a_map_without_walls_cannot_be_compared(caplog):
    caplog.set_level(logging.WARNING)
    check = PlaceCheck(Hypermap(), profile("default").occupancy)
    mapper = Mapper(profile("default"), None)
    mapper.place = check
    mapper.add(drive()[0])
    check.check("tuesday", is_last=True)
    assert "could not check whether tuesday shows the place of the map" in caplog.text
    assert "if its poses are in another frame, leave out --onto" in caplog.text


def test_outlines_that_cross_themselves_can_be_compared():
    before = first_day()
    layer = before.semantic().copy()
    for corner in (1.0, 1.5):
        around = [(corner, corner), (corner + 1, corner + 1), (corner + 1, corner)]
        layer.add(SemanticObject("chair", shapely.Polygon([*around, (corner, corner + 1)])))
    check = PlaceCheck(before.with_layer(layer), profile("default").occupancy)
    mapper = Mapper(profile("default"), SOURCE)
    mapper.place = check
    for frame in drive()[:8]:
        mapper.add(frame)
    assert check.compare().fits


def test_another_occupancy_layer_does_not_matter():
    other = OccupancyLayer("plan", "map")
    before = first_day().with_layers([*first_day(), other])
    with pytest.raises(OtherPlace):
        mapped(NextDay(Pose2D(6.0, 4.0, np.pi)), before)


def test_few_frames_tell_nothing(caplog):
    caplog.set_level(logging.WARNING)
    mapped(NextDay(Pose2D(6.0, 4.0, np.pi), count=7), first_day())
    assert "not sure whether" in caplog.text


def test_a_drive_whose_poses_were_corrected_is_looked_at_again():
    later = list(NextDay(Pose2D(6.0, 4.0, np.pi)).frames())
    mapper = Mapper.onto(first_day(), SOURCE)
    mapper.place = PlaceCheck(first_day(), mapper.config.occupancy)
    for frame in later[:10]:
        mapper.add(frame)
    assert mapper.place.compare().differs
    poses = np.array([frame.map_T_camera for frame in drive()[:10]])
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    stamps = np.array([frame.stamp for frame in later[:10]])
    mapper.correct(Trajectory(stamps, poses[:, :3, 3], turns), is_under_way=True)
    assert mapper.place.likeness is None
    for frame, right in zip(later[10:], drive()[10:], strict=True):
        mapper.add(frame.moved_to(right.map_T_camera))
    assert mapper.place.compare().fits


def test_maps_that_share_only_a_strip_along_walls_tell_nothing():
    """All that both know is near walls, so that no more of it can agree than by chance."""
    found = Likeness(wall=10.0, agree=0.0, telling=0.3, sightings=2, near=2)
    assert not found.differs
    assert not found.fits
    assert dataclasses.replace(found, telling=8.0).differs


@pytest.mark.parametrize(
    ("agree", "sightings", "near", "differs"),
    [
        (0.47, 6, 0, True),  # a place whose walls lie alike by chance, and none of its objects do
        (0.47, 4, 0, False),
        (0.47, 6, 1, False),
        (0.52, 12, 0, False),
        (0.56, 39, 0, True),
        (0.56, 39, 1, False),
        (0.3, 0, 0, True),
    ],
)
def test_sightings_none_of_which_is_near_count_though_they_are_few(
    agree: float, sightings: int, near: int, differs: bool
) -> None:
    found = Likeness(wall=30.0, agree=agree, telling=20.0, sightings=sightings, near=near)
    assert found.differs == differs
