"""Camera info, transforms, occupancy grids and detections, where bags of good data do not reach."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FormatError, FrameError
from hypermap.core.moving_frames import Chain
from hypermap.recordings.messages.camera import camera_of_info, has_distortion
from hypermap.recordings.messages.detections import detections_of
from hypermap.recordings.messages.header import as_seconds, clean_frame, nanoseconds
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.recordings.messages.transforms import TransformLog, leap_of


def test_stamps_keep_their_nanoseconds_and_seconds_round_once() -> None:
    stamp = SimpleNamespace(sec=1600000000, nanosec=250000000)
    assert nanoseconds(stamp) == 1600000000250000000
    assert as_seconds(1600000000250000000) == 1600000000.25


@pytest.mark.parametrize(("given", "clean"), [("/map", "map"), ("map", "map"), ("a/b", "a/b")])
def test_frames_lose_their_leading_slash(given: str, clean: str) -> None:
    assert clean_frame(given) == clean


def test_camera_infos_of_both_ros_versions_say_the_same() -> None:
    numbers = {"D": [0.0] * 5, "K": [50, 0, 3, 0, 51, 2, 0, 0, 1], "P": [0.0] * 12}
    one = SimpleNamespace(width=7, height=5, **numbers)
    two = SimpleNamespace(width=7, height=5, **{k.lower(): v for k, v in numbers.items()})
    for info in (one, two):
        camera = camera_of_info(info, 7, 5, is_rectified=True)
        assert camera.K.tolist() == [[50, 0, 3], [0, 51, 2], [0, 0, 1]]
        assert not has_distortion(info)


@pytest.mark.parametrize(
    ("part", "binning", "size", "K"),
    [
        ((0, 0, 0, 0), (2, 2), (320, 240), [[250, 0, 160], [0, 255, 120], [0, 0, 1]]),
        ((100, 40, 400, 300), (0, 0), (400, 300), [[500, 0, 220], [0, 510, 200], [0, 0, 1]]),
        ((100, 40, 400, 300), (2, 4), (200, 75), [[250, 0, 110], [0, 127.5, 50], [0, 0, 1]]),
    ],
)
def test_images_of_a_part_of_the_sensor_have_its_intrinsics(part, binning, size, K) -> None:
    """Expected: by hand, from the definition of sensor_msgs/CameraInfo."""
    names = ("x_offset", "y_offset", "width", "height")
    info = SimpleNamespace(
        width=640,
        height=480,
        K=[500, 0, 320, 0, 510, 240, 0, 0, 1],
        D=[],
        roi=SimpleNamespace(**dict(zip(names, part, strict=True))),
        binning_x=binning[0],
        binning_y=binning[1],
    )
    assert camera_of_info(info, *size, is_rectified=False).K.tolist() == K
    with pytest.raises(FormatError, match="is for images of 640 x 480 pixels, but the depth"):
        camera_of_info(info, size[0] - 1, size[1], is_rectified=False)


def transform(parent: str, child: str, stamp: float, x: float, w: float = 1.0) -> Any:
    header = SimpleNamespace(
        frame_id=parent, stamp=SimpleNamespace(sec=int(stamp), nanosec=int(stamp % 1 * 1e9))
    )
    pose = SimpleNamespace(
        translation=SimpleNamespace(x=x, y=0.0, z=0.0),
        rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=w),
    )
    item = SimpleNamespace(header=header, child_frame_id=child, transform=pose)
    return SimpleNamespace(transforms=[item])


def test_the_last_of_several_transforms_with_a_stamp_counts() -> None:
    log = TransformLog()
    for x in (1.0, 2.0, 3.0):
        log.add(transform("map", "base", 5, x), is_static=False)
        log.add(transform("base", "camera", 5, x * 10), is_static=True)
    tree, notes = log.frames(max_gap=1)
    assert tree.motion("map", "camera").at([5.0])[0, 0, 3] == 33
    assert notes == []
    assert log.span() == (5, 5)


def test_broken_transforms_and_second_parents_are_noted() -> None:
    log = TransformLog()
    log.add(transform("map", "base", 1, math.nan), is_static=False)
    log.add(transform("map", "base", 1, 0, w=0.0), is_static=False)
    for stamp in (1, 2, 3):
        log.add(transform("odom", "base", stamp, 7.0), is_static=False)
    log.add(transform("map", "base", 2, 8.0), is_static=False)
    log.add(transform("/", "odom", 1, 0), is_static=True)
    log.add(transform("odom", "", 1, 0), is_static=False)
    tree, notes = log.frames(max_gap=1)
    assert tree.motion("odom", "base").at([2.0])[0, 0, 3] == 7
    assert notes == [
        "frame 'base' has several parents in tf (odom, map); 'odom' is used",
        "2 transforms left out: not finite",
        "2 transforms left out: without names of frames",
    ]


def two_nodes(apart: float) -> TransformLog:
    """One of 20 Hz, the other of 30 Hz; the robot drives at 0.5 m/s."""
    sent = [(number / rate, rate) for rate in (20, 30) for number in range(4 * rate)]
    log = TransformLog()
    for time, rate in sorted(sent):
        place = 0.5 * time + apart * (rate == 30)
        log.add(transform("odom", "base", 100 + time, place), is_static=False)
    return log


@pytest.mark.parametrize(("apart", "leap"), [(0.4, 0.4), (0.05, 0.0), (0.0, 0.0)])
def test_a_frame_that_two_nodes_publish_leaps(apart: float, leap: float) -> None:
    motion = two_nodes(apart).frames(max_gap=1)[0].motion("odom", "base")
    assert isinstance(motion, Chain)
    [trajectory] = motion.links[1].links
    assert leap_of(trajectory) == pytest.approx(leap, abs=0.02)


def test_a_frame_that_moves_is_not_held_by_a_pose_of_tf_static() -> None:
    log = TransformLog()
    log.add(transform("map", "odom", 0, 0.0), is_static=True)
    log.add(transform("base", "arm", 0, 3.0), is_static=True)
    for stamp in (1, 2):
        log.add(transform("map", "odom", stamp, 7.0), is_static=False)
        log.add(transform("base", "arm", stamp, 3.0), is_static=False)
    tree, notes = log.frames(max_gap=1)
    assert tree.motion("map", "odom").at([1.5])[0, 0, 3] == 7
    assert tree.motion("base", "arm").at([99.0])[0, 0, 3] == 3
    assert notes == [
        "frame 'odom' is fixed in 'map' by tf_static, but moves in tf: what tf_static says of it "
        "is left out"
    ]


def log_of(runs: list[tuple[int, int, float]]) -> TransformLog:
    """Return runs from one stamp to another, each at some place."""
    log = TransformLog()
    for first, last, x in runs:
        for stamp in range(first, last + 1):
            log.add(transform("map", "base", stamp, x), is_static=False)
    return log


def test_times_that_are_there_twice_have_no_pose() -> None:
    log = log_of([(0, 20, 1.0), (0, 9, 2.0), (8, 30, 3.0)])
    tree, notes = log.frames(max_gap=1)
    motion = tree.motion("map", "base")
    known = motion.covers(np.arange(31.0))
    assert np.flatnonzero(known).tolist() == list(range(21, 31))
    assert notes == [
        "the stamps of tf go back: poses of 'base' in 'map' are there twice from 0.000 to 20.000 "
        "s, and are left out; was a simulation begun again, or a clock set back? "
        "Record each run in a bag of its own"
    ]


def test_a_frame_of_which_all_is_there_twice_is_noted() -> None:
    tree, (note,) = log_of([(0, 9, 1.0), (0, 9, 2.0)]).frames(max_gap=1)
    assert not tree.motion("map", "base").covers(np.arange(1.0, 10.0)).any()
    assert "twice from" in note


@pytest.mark.parametrize("runs", [[(0, 9, 1.0), (0, 9, 1.0)], [(10, 20, 1.0), (0, 9, 2.0)]])
def test_a_bag_that_was_played_again_or_a_clock_set_far_back_costs_no_pose(
    runs: list[tuple[int, int, float]],
) -> None:
    tree, notes = log_of(runs).frames(max_gap=1)
    assert tree.motion("map", "base").covers([0.0, 4.5, 9.0]).all()
    assert notes == []


def test_a_loop_of_transforms_is_an_error() -> None:
    log = TransformLog()
    log.add(transform("a", "b", 1, 0), is_static=True)
    log.add(transform("b", "a", 1, 0), is_static=True)
    with pytest.raises(FrameError, match="form a loop"):
        log.frames(max_gap=1)


def test_without_transforms_there_are_no_frames_and_no_times() -> None:
    log = TransformLog()
    assert log.frames(max_gap=1)[0].frames == []
    assert all(math.isnan(stamp) for stamp in log.span())


def grid(
    cells: list[int], width: int = 2, height: int = 1, resolution: float = 0.5, **turn: float
) -> Any:
    rotation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0} | turn
    origin = SimpleNamespace(
        position=SimpleNamespace(x=1.0, y=2.0), orientation=SimpleNamespace(**rotation)
    )
    info = SimpleNamespace(width=width, height=height, resolution=resolution, origin=origin)
    header = SimpleNamespace(frame_id="")
    return SimpleNamespace(header=header, info=info, data=np.array(cells, np.int8))


def test_a_grid_without_frame_or_orientation_lies_in_the_map() -> None:
    layer = occupancy_of_grid(grid([0, 100], w=0.0))
    assert layer.frame_id == "map"
    assert layer.grid is not None
    assert (layer.grid.origin.x, layer.grid.origin.y, layer.grid.origin.yaw) == (1, 2, 0)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (grid([0]), "the map of 2 x 1 cells has 1 numbers"),
        (grid([0, 101]), "the map's cells must be -1 to 100, found 0 to 101"),
        (grid([0, -2]), "the map's cells must be -1 to 100, found -2 to 0"),
        (grid([0, 0], x=0.1), "the map's origin is tilted out of the plane"),
        (
            grid([], width=0),
            "the map's geometry is wrong: a grid needs at least one cell, got 0 x 1",
        ),
        (
            grid([0, 0], resolution=0.0),
            "the map's geometry is wrong: resolution must be ",
        ),
        (grid([0, 0], w=math.nan), "the map's geometry is wrong: a pose must be finite, got "),
    ],
)
def test_broken_grids_are_errors(message: Any, text: str) -> None:
    with pytest.raises(FormatError) as caught:
        occupancy_of_grid(message)
    assert str(caught.value).startswith(text)


def test_darknets_own_stamp_serves_where_the_images_is_empty() -> None:
    at = SimpleNamespace(stamp=SimpleNamespace(sec=5, nanosec=1))
    nothing = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0))
    message = SimpleNamespace(header=at, image_header=nothing, bounding_boxes=[])
    stamp, found = detections_of(message)
    assert stamp == 5_000_000_001
    assert len(found) == 0


def test_a_message_of_another_kind_holds_no_detections() -> None:
    with pytest.raises(FormatError, match="SimpleNamespace contains no detections"):
        detections_of(SimpleNamespace())
