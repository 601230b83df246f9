"""The floor that depth shows: where it lies, and that only a wrong one is reported."""

from __future__ import annotations

import dataclasses
import logging
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.trajectory import compose, invert, pose_from_rpy
from hypermap.mapping.config import profile
from hypermap.mapping.floor import Floor, FloorSampler
from hypermap.mapping.preflight import option_text
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.recordings import RecordingOptions, open_recording
from hypermap.simulation import SimulatedRecording, demo_world

pytestmark = pytest.mark.xdist_group("floor")  # they share what takes long to make

LEVEL = pose_from_rpy(0, 0, 0, 0, 0, 0)
WRONG = [
    (0, 0, 0, math.radians(10), 0, 0),
    (0, 0, 0, 0, math.radians(-27), 1),
    (1, 2, 1.2, -math.pi / 2, 0, 0),  # y points down, as in many a SLAM program
    (0, 0, 1.5, math.radians(-117), 0, 0),
    (3, 0, 0, math.pi, 0.2, 0),
    (0, 0, -1.2, 0, 0, 0),
    (0, 0, 1.2, 0, 0, 0),
]


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    return list(SimulatedRecording(demo_world(), rate=0.5).frames())


def seen_in(frames: Iterable[RgbdFrame], map_T_world: NDArray[np.float64] = LEVEL) -> Floor | None:
    sampler = FloorSampler()
    for frame in frames:
        sampler.add(frame.moved_to(compose(map_T_world, frame.map_T_camera)))
    return sampler.floor()


@pytest.mark.parametrize("pose", WRONG)
def test_a_wrong_floor_is_found_and_brought_level_to_nought(
    frames: list[RgbdFrame], pose: tuple[float, ...]
) -> None:
    wrong = pose_from_rpy(*pose)
    floor = seen_in(frames, wrong)
    assert floor is not None
    assert not floor.is_level
    assert floor.normal == pytest.approx(wrong[:3, 2], abs=0.01)
    again = seen_in(frames, compose(floor.level_T_map(), wrong))
    assert again is not None
    assert again.is_level
    assert again.tilt_deg < 0.5
    assert abs(again.offset) < 0.02


@pytest.mark.parametrize(("degrees", "is_level"), [(1, True), (10, False)])
def test_far_from_the_origin_the_floor_is_measured_and_turned_where_the_camera_is(
    frames: list[RgbdFrame], degrees: float, is_level: bool
) -> None:
    """As with coordinates of a whole country, such as those of UTM."""
    there = compose(
        pose_from_rpy(5e5, 5e6, 0, math.radians(degrees), 0, 0), pose_from_rpy(-3, -2, 0, 0, 0, 0)
    )
    floor = seen_in(frames, there)
    assert floor is not None
    assert floor.is_level == is_level
    assert floor.offset == pytest.approx(0, abs=0.15)
    assert "z = 0 under the camera" in str(floor) or is_level
    level = floor.level_T_map()
    again = seen_in(frames, compose(level, there))
    assert again is not None
    assert again.tilt_deg < 0.5
    assert again.offset == pytest.approx(0, abs=0.02)
    assert compose(level, there)[:2, 3] == pytest.approx(there[:2, 3], abs=0.5)
    given = [float(number) for number in option_text(level, floor).split(",")]
    assert pose_from_rpy(*given) @ [5e5, 5e6, 0, 1] == pytest.approx(
        level @ [5e5, 5e6, 0, 1], rel=0, abs=0.02
    )


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_depth_of_a_wrong_scale_is_thought_of(frames: list[RgbdFrame], factor: float) -> None:
    floor = seen_in(
        dataclasses.replace(frame, depth=frame.depth * np.float32(factor)) for frame in frames
    )
    assert floor is not None
    assert not floor.is_level
    assert f"as if all depth were {factor:g} times what it is" in str(floor)
    assert "--depth-scale" not in str(seen_in(frames, pose_from_rpy(0, 0, -0.3, 0, 0, 0)))


@pytest.mark.parametrize("count", [5, 12, None])
def test_a_level_floor_is_right(frames: list[RgbdFrame], count: int | None) -> None:
    floor = seen_in(frames[:count])
    assert floor is not None
    assert floor.is_level
    assert floor.tilt_deg < 1


def test_long_recordings_are_remembered_from_end_to_end(frames: list[RgbdFrame]) -> None:
    tilted = pose_from_rpy(0, 0, 0, 0.5, 0, 0)
    sampler = FloorSampler()
    for frame in frames * 12:
        sampler.add(frame.moved_to(compose(tilted, frame.map_T_camera)))
    floor = sampler.floor()
    assert floor is not None
    assert floor.tilt_deg == pytest.approx(math.degrees(0.5), abs=0.5)


@pytest.mark.parametrize("depth", [math.nan, math.inf, 0.0, -1.0])
def test_without_depth_there_is_no_floor(frames: list[RgbdFrame], depth: float) -> None:
    nothing = np.full_like(frames[0].depth, depth)
    assert seen_in(replace(frame, depth=nothing, cloud=None) for frame in frames[:8]) is None


def test_a_wall_is_no_floor(frames: list[RgbdFrame]) -> None:
    looking_ahead = pose_from_rpy(0, 0, 1, -math.pi / 2, 0, -math.pi / 2)
    wall = np.full_like(frames[0].depth, 2.5)
    seen = [replace(frame, depth=wall, map_T_camera=looking_ahead) for frame in frames[:8]]
    assert seen_in(seen) is None


def test_a_table_under_a_camera_may_be_above_the_floor(frames: list[RgbdFrame]) -> None:
    looking_down = np.diag([1.0, -1.0, -1.0, 1.0])
    looking_down[2, 3] = 1.5
    table = np.full_like(frames[0].depth, 0.75)
    floor = seen_in([replace(f, depth=table, map_T_camera=looking_down) for f in frames[:8]])
    assert floor is not None
    assert floor.offset == pytest.approx(0.75)
    assert floor.is_level


@pytest.mark.parametrize("every", [1, 10])
def test_the_floor_of_a_real_desk_is_right(shared_data: Path, every: int) -> None:
    floor = seen_in(open_recording(shared_data / "desk", RecordingOptions(every=every)).frames())
    assert floor is not None
    assert floor.is_level


def test_the_world_of_a_real_kitchen_is_not_level(shared_data: Path) -> None:
    floor = seen_in(open_recording(shared_data / "kitchen").frames())
    assert floor is not None
    assert not floor.is_level
    assert "tilted by 27 degrees against its -y axis" in str(floor)
    # Measured by someone else, to a degree and 3 cm.
    true = [0.01372, -0.89278, -0.45028]
    assert math.degrees(math.acos(floor.normal @ true)) < 1.5
    assert floor.offset == pytest.approx(-1.536, abs=0.05)
    level = seen_in(open_recording(shared_data / "kitchen").frames(), floor.level_T_map())
    assert level is not None
    assert level.is_level


class Tilted(SimulatedRecording):
    """A recording of a room whose world is lowered and tilted."""

    world_T_room = pose_from_rpy(0, 0, -1, 0.3, 0, 0)

    def frames(self, on_bad=None):
        for frame in super().frames():
            yield frame.moved_to(compose(self.world_T_room, frame.map_T_camera))


@pytest.mark.parametrize(
    ("kind", "warnings"), [(SimulatedRecording, 0), (Tilted, 1)], ids=["level", "tilted"]
)
def test_who_maps_a_tilted_world_is_warned_once(
    caplog: pytest.LogCaptureFixture, kind: type[SimulatedRecording], warnings: int
) -> None:
    recording = kind(demo_world(), rate=0.5, has_occupancy=False)
    with caplog.at_level(logging.WARNING, "hypermap"):
        map_recording(recording, lambda _: Detections.of([], []), profile("default"))
    reported = [record.getMessage() for record in caplog.records]
    assert len(reported) == warnings
    for text in reported:
        assert "tilted by 17 degrees against its z axis" in text
        numbers = text.rpartition("--world-transform=")[2].split(",")
        levelled = compose(pose_from_rpy(*map(float, numbers)), Tilted.world_T_room)
        assert levelled[2] == pytest.approx([0, 0, 1, 0], abs=0.02)


def test_the_smallest_turn_that_levels_a_floor_exists_for_each_normal() -> None:
    rng = np.random.default_rng(1)
    normals = [*rng.normal(size=(20, 3)), [0, 0, 1], [0, 0, -1], [0, 1e-9, -1]]
    for normal in normals:
        up = np.asarray(normal) / np.linalg.norm(normal)
        pose = Floor(up, 0.7, (1.0, 1.0)).level_T_map()
        assert pose @ [*(0.7 * up), 1] == pytest.approx([0, 0, 0, 1], abs=1e-6)
        assert pose[:3, :3] @ up == pytest.approx([0, 0, 1], abs=1e-6)
        assert compose(pose, invert(pose)) == pytest.approx(np.eye(4), abs=1e-6)
