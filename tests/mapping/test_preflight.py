"""Preflight reports what is wrong with a recording before a map is made, and nothing else."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.trajectory import (
    compose,
    pose_from_rpy,
    pose_matrix,
    quats_of,
    trajectory_of,
)
from hypermap.mapping.consistency import Consistency
from hypermap.mapping.preflight import Finding, Preflight, clock_offset, leveling_pose
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.turning import turned
from hypermap.recordings import RecordingOptions, open_recording
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.simulation.levels import errors_of_level

pytestmark = pytest.mark.xdist_group("preflight")  # they share what takes long to make

SMALL = Camera.from_intrinsics(131, 131, 79.5, 59.5, width=160, height=120)


@functools.cache
def room(level: str = "fair") -> tuple[RgbdFrame, ...]:
    errors = errors_of_level(level)
    recording = SimulatedRecording(
        demo_world(), camera=SMALL, rate=3.0, depth_noise=errors.depth, pose_noise=errors.poses
    )
    return tuple(recording.frames())


def wrong(frames: Iterable[RgbdFrame], **options: object) -> dict[str, Finding]:
    """The faults that are reported of frames, all of which are mapped."""
    found: list[Finding] = []
    preflight = Preflight(found.append, **options)
    for frame in frames:
        preflight.add(frame)
        preflight.add_mapped(frame)
    preflight.finish()
    preflight.finish()
    assert len({finding.check for finding in found}) == len(found)  # each is reported once
    return {finding.check: finding for finding in found}


def late(frames: Iterable[RgbdFrame], seconds: float) -> list[RgbdFrame]:
    """Frames with the poses of some seconds before their images."""
    frames = list(frames)
    stamps = np.array([frame.stamp for frame in frames])
    trajectory = trajectory_of(stamps, np.array([frame.map_T_camera for frame in frames]))
    known = [frame for frame in frames if trajectory.covers([frame.stamp - seconds])[0]]
    return [frame.moved_to(trajectory.at([frame.stamp - seconds])[0]) for frame in known]


@pytest.mark.parametrize("level", ["fair", "robot"])
def test_of_a_recording_as_it_should_be_nothing_is_reported(level: str) -> None:
    assert wrong(room(level)) == {}


@pytest.mark.parametrize("pose", [(0, 0, -0.4, 0, 0, 0), (0, 0, 0, 0.2, -0.1, 0)])
def test_a_world_that_is_not_level_is_reported_and_leveled(pose: tuple[float, ...]) -> None:
    moved = pose_from_rpy(*pose)
    frames = [frame.moved_to(compose(moved, frame.map_T_camera)) for frame in room()[::3]]
    assert "--level auto" in wrong(frames)["level"].remedy
    leveling, _ = leveling_pose(frames)
    level = compose(leveling, moved)
    assert level[2] == pytest.approx([0, 0, 1, 0], abs=0.02)
    # The option that the warning names comes on top of the one that was given.
    given = pose_from_rpy(1, 2, 3, 0.1, 0.2, 0.3)
    reported = wrong(frames, map_T_world=given)["level"].remedy.rpartition("=")[2]
    numbers = pose_from_rpy(*map(float, reported.split(",")))
    np.testing.assert_allclose(numbers, compose(leveling, given), atol=0.002)


def test_a_level_world_stays_as_it_is() -> None:
    np.testing.assert_array_equal(leveling_pose(room()[::3])[0], np.eye(4))
    np.testing.assert_array_equal(leveling_pose([])[0], np.eye(4))


@pytest.mark.parametrize("seconds", [-0.3, -0.1, 0.1, 0.3])
def test_clocks_that_differ_are_reported_and_by_how_much(seconds: float) -> None:
    frames = late(room("robot"), seconds)
    finding = wrong(frames)["clock"]
    [(reported, side)] = re.findall(r"poses of ([0-9.]+) s (\w+)", finding.measured)
    assert float(reported) == pytest.approx(abs(seconds), abs=0.03)
    assert side == ("later" if seconds > 0 else "earlier")
    assert clock_offset(frames) == pytest.approx(seconds, abs=0.03)


def test_of_frames_far_apart_nobody_knows_the_clock() -> None:
    assert clock_offset(room()[::8]) is None
    assert clock_offset([]) is None
    assert clock_offset(room()) == pytest.approx(0.0, abs=0.021)


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_depth_in_another_unit_is_reported(factor: float) -> None:
    frames = [
        dataclasses.replace(frame, depth=frame.depth * np.float32(factor)) for frame in room()
    ]
    measured = wrong(frames)["scale"].measured
    assert float(measured.split()[-1]) == pytest.approx(1 / factor, rel=0.1)


def test_a_unit_that_is_uncertain_is_not_said_to_be_right() -> None:
    preflight = Preflight()
    for frame in room():
        preflight.add(dataclasses.replace(frame, depth=frame.depth * np.float32(2)))
    [found] = (finding for finding in preflight.findings() if finding.check == "scale")
    assert not found.is_wrong
    assert "unclear whether depth and poses are in the same unit" in found.measured
    assert "all depth is multiplied by 0.49, but" in found.measured


def test_poses_in_millimeters_are_reported() -> None:
    def in_millimeters(pose: np.ndarray) -> np.ndarray:
        return np.vstack([np.hstack([pose[:3, :3], 1000 * pose[:3, 3:]]), pose[3:]])

    found = wrong([frame.moved_to(in_millimeters(frame.map_T_camera)) for frame in room()])
    assert "from one frame to the next" in found["scale"].measured
    assert found["scale"].remedy.endswith("convert them to meters")


def test_poses_that_drift_do_not_look_like_another_unit_of_depth() -> None:
    drift = [pose_from_rpy(0.01 * i, 0, 0, 0, 0, 0.03 * i) for i in range(len(room()))]
    consistency = Consistency()
    for frame, pose in zip(room(), drift, strict=True):
        consistency.add(frame.moved_to(compose(pose, frame.map_T_camera)))
    fit = consistency.depth_scale()
    assert fit is not None
    assert not fit.is_sure


@pytest.mark.parametrize("pixels", [-5, 4])
def test_color_that_is_not_registered_is_reported(pixels: int) -> None:
    frames = [
        dataclasses.replace(frame, color=np.roll(frame.color, pixels, axis=1))
        for frame in room()[:40]
    ]
    assert "--register" in wrong(frames)["registration"].remedy


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_images_that_are_not_upright_are_reported_with_the_turn_that_mends_them(
    degrees: int,
) -> None:
    frames = [turned(frame, 360 - degrees) for frame in room()[:30]]
    found = wrong(frames)
    assert found.keys() == {"upright"}
    assert found["upright"].remedy == f"give --rotate {degrees}"
    assert turned(frames[0], degrees).map_T_camera == pytest.approx(room()[0].map_T_camera)


def test_a_camera_that_hangs_upside_down_without_its_pose_saying_so_is_reported() -> None:
    frames = [
        turned(frame, 180).moved_to(frame.map_T_camera) for frame in room()[:30]
    ]  # the images are upside down, and the pose is that of an upright camera
    found = wrong(frames)["upright"]
    assert "rotated by 180 degrees" in found.measured
    assert found.remedy.endswith("correct its poses, in a bag those in tf")


# What other programs write for the pose of a camera, written down independently of the product.
_BODY = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
_AS_OTHERS_WRITE = {
    "body": lambda pose: pose @ _BODY,
    "frd": lambda pose: pose @ _BODY * (1, -1, -1, 1),
    "opengl": lambda pose: pose * (1, -1, -1, 1),
    "world-to-camera": np.linalg.inv,
    "w-first": lambda pose: pose_matrix(pose[:3, 3], np.roll(quats_of(pose[None, :3, :3])[0], 1)),
    "mirrored": lambda pose: np.diag([1, -1, 1, 1]) @ pose @ np.diag([1, -1, 1, 1]),
}


@pytest.mark.parametrize("convention", _AS_OTHERS_WRITE)
def test_poses_of_another_convention_are_reported_with_the_option_that_reads_them(
    convention: str,
) -> None:
    written = [frame.moved_to(_AS_OTHERS_WRITE[convention](frame.map_T_camera)) for frame in room()]
    found = wrong(written[:60])
    assert found.keys() == {"poses"}
    assert found["poses"].remedy == f"give --pose-convention {convention}"
    options = RecordingOptions(pose_convention=convention)
    for frame, true in zip(written[::20], room()[::20], strict=True):
        np.testing.assert_allclose(
            options.poses_in_map(frame.map_T_camera), true.map_T_camera, atol=1e-9
        )


@pytest.mark.parametrize(("convention", "first", "last"), [("w-first", 60, 140), ("frd", 30, 90)])
def test_poses_of_another_convention_do_not_pass_for_a_wrong_clock_or_unit(
    convention: str, first: int, last: int
) -> None:
    frames = room()[first:last]
    write = _AS_OTHERS_WRITE[convention]
    assert wrong([f.moved_to(write(f.map_T_camera)) for f in frames]).keys() == {"poses"}


def test_a_convention_that_was_given_wrongly_is_not_advised_again() -> None:
    options = RecordingOptions(pose_convention="opengl")
    frames = [frame.moved_to(options.poses_in_map(frame.map_T_camera)) for frame in room()[:60]]
    finding = wrong(frames, pose_convention="opengl")["poses"]
    assert "do not match" in finding.measured
    assert finding.remedy.startswith("leave --pose-convention out")


def test_of_a_camera_at_rest_nothing_is_reported() -> None:
    frames = [dataclasses.replace(room("robot")[20], stamp=i / 10) for i in range(30)]
    pose = pose_from_rpy(0.3, 1.7, 0, 0, 0, 0.7)  # rounding must not look like a better match
    assert wrong([frame.moved_to(compose(pose, frame.map_T_camera)) for frame in frames]) == {}


def test_without_motion_the_floor_says_that_the_camera_hangs_upside_down() -> None:
    frames = [turned(frame, 180).moved_to(frame.map_T_camera) for frame in room()[::25]]
    found = wrong(frames)
    assert found.keys() == {"upright"}  # and not that its ceiling is a floor that is not level
    assert "the floor is level at z = 0 only if" in found["upright"].measured
    pose, floor = leveling_pose(frames)
    np.testing.assert_array_equal(pose, np.eye(4))
    assert floor is None


def test_without_a_floor_only_the_poses_say_that_images_are_upright() -> None:
    for frames, said in ((room()[::3], "the images"), (room()[:2], "by their poses, the images")):
        preflight = Preflight()
        for frame in frames:
            preflight.add(frame)
            preflight.add_mapped(frame)
        (found,) = (one for one in preflight.findings() if one.check == "upright")
        assert not found.is_wrong
        assert found.measured.startswith(f"{said} are upright")


@pytest.mark.parametrize("degrees", [90, 180])
def test_without_a_floor_turned_images_may_also_be_another_convention(degrees: int) -> None:
    preflight = Preflight()
    for frame in room()[:2]:
        preflight.add_mapped(turned(frame, 360 - degrees))
    (found,) = (one for one in preflight.findings() if one.check == "upright")
    assert "by their poses" in found.measured
    assert f"--rotate {degrees}" in found.remedy
    assert "--pose-convention" in found.remedy


def test_color_that_cannot_be_read_is_left_out() -> None:
    from hypermap.core.errors import FormatError

    def broken() -> np.ndarray:
        raise FormatError("damaged")

    frames = [
        RgbdFrame(f.stamp, f.depth, f.camera, f.map_T_camera, broken, f.stamp) for f in room()[:30]
    ]
    assert wrong(frames) == {}


def test_of_a_real_kitchen_level_and_registration_are_reported(shared_data: Path) -> None:
    path = shared_data / "kitchen"
    found = wrong(open_recording(path).frames())
    assert found.keys() == {"level", "registration"}
    # Both were measured by someone else, too.
    options = dict(
        re.findall(r"--(color-intrinsics|depth-transform)=(\S+)", found["registration"].remedy)
    )
    focal = [float(number) for number in options["color-intrinsics"].split(",")[:2]]
    assert focal == pytest.approx([525, 525], rel=0.02)
    baseline = [float(number) for number in options["depth-transform"].split(",")]
    assert baseline == pytest.approx([-0.025, 0, 0, 0, 0, 0], abs=0.006)
    leveling, _ = leveling_pose(open_recording(path).frames())
    mended = RecordingOptions(
        register=True,
        color_intrinsics=(525, 525, 320, 240),
        color_T_depth=(-0.025, 0, 0, 0, 0, 0),
        map_T_world=leveling,
    )
    assert wrong(open_recording(path, mended).frames()) == {}


def test_the_clock_of_a_real_desk_is_reported_when_it_is_off(shared_data: Path) -> None:
    path = shared_data / "desk"
    assert wrong(open_recording(path).frames()) == {}
    measured = clock_offset(open_recording(path, RecordingOptions(time_offset=0.3)).frames())
    assert measured == pytest.approx(-0.3, abs=0.05)  # 20 ms of it are the recording's own


def test_poses_of_another_time_are_not_taken_for_a_tilt(shared_data: Path) -> None:
    frames = late(open_recording(shared_data / "desk").frames(), 0.22)
    assert wrong(frames).keys() == {"clock"}
    tilted = pose_from_rpy(0, 0, 0, 0.2, -0.1, 0)
    moved = [frame.moved_to(compose(tilted, frame.map_T_camera)) for frame in frames]
    assert wrong(moved).keys() == {"clock"}  # and then, with the clock that it names, the tilt
    assert wrong(late(moved, -0.22)).keys() == {"level"}
