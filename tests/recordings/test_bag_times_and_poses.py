"""Which messages of a bag belong together, and where the camera was."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FormatError
from hypermap.recordings import RecordingOptions, open_recording

from .bag_builder import (
    COLOR,
    DEPTH,
    GRID,
    IMAGE,
    BagBuilder,
    add_images,
    add_poses,
    grid,
    image,
    write_bag,
)
from .bag_tools import frames_of
from .shots import INTRINSICS, SHOTS, START, assert_shows


def test_poses_between_two_transforms_are_interpolated(bag: BagBuilder) -> None:
    shot = SHOTS[0]
    with bag:
        bag.add_tf("/tf", shot.stamp - 10**8, "map", "camera", (0, 0, 1))
        bag.add_tf("/tf", shot.stamp + 3 * 10**8, "map", "camera", (4, 0, 1))
        add_images(bag, shot)
    [frame] = frames_of(bag.path)
    assert frame.map_T_camera[:3, 3] == pytest.approx([1, 0, 1], abs=1e-5)


def test_frames_with_leading_slashes_and_out_of_order_transforms_are_understood(
    tmp_path: Path, kind: str
) -> None:
    with BagBuilder(tmp_path, kind) as bag:
        add_poses(bag, SHOTS[::-1], slash="/")
        for shot in SHOTS:
            add_images(bag, shot)
    for frame, shot in zip(frames_of(bag.path), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_images_that_were_recorded_late_and_out_of_order_find_each_other(bag: BagBuilder) -> None:
    order = [2, 0, 3, 1]
    with bag:
        add_poses(bag, SHOTS)
        for k, i in enumerate(order):
            shot, log_time = SHOTS[i], START + 10**9 * k
            bag.add(COLOR, IMAGE, log_time, image(shot.color, "rgb8", shot.color_stamp))
            bag.add(DEPTH, IMAGE, log_time + 5, image(shot.depth_mm, "16UC1", shot.stamp))
            if k == 0:  # a message that was sent twice
                bag.add(DEPTH, IMAGE, log_time + 6, image(shot.depth_mm, "16UC1", shot.stamp))
    recording = open_recording(bag.path, RecordingOptions(intrinsics=INTRINSICS))
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)
    assert "1 image left out: with the stamp of another" in recording.info().notes


def test_a_message_without_a_stamp_takes_the_time_of_recording(bag: BagBuilder) -> None:
    shot = SHOTS[1]
    with bag:
        add_poses(bag, SHOTS)
        bag.add(DEPTH, IMAGE, shot.stamp, image(shot.depth_mm, "16UC1", 0))
        bag.add(COLOR, IMAGE, shot.color_stamp, image(shot.color, "rgb8", 0))
    [frame] = frames_of(bag.path, intrinsics=INTRINSICS)
    assert_shows(frame, shot)


@pytest.mark.parametrize("moves", [False, True])
def test_transforms_without_stamps_are_fixed_or_of_the_time_of_recording(
    tmp_path: Path, kind: str, moves: bool
) -> None:
    def unstamped(bag: BagBuilder, log_time: int, parent: str, child: str, *pose: Any) -> None:
        bag.add_tf("/tf", 0, parent, child, *pose, log_time=log_time)

    with BagBuilder(tmp_path, kind) as bag:
        for shot in SHOTS:
            if moves:
                unstamped(bag, shot.stamp, "map", "base", shot.position, shot.quat_xyzw)
            else:
                bag.add_tf("/tf", shot.stamp, "map", "base", shot.position, shot.quat_xyzw)
            add_images(bag, shot)
        unstamped(bag, SHOTS[0].stamp, "base", "camera", (0, 0, 0))
    for frame, shot in zip(frames_of(bag.path), SHOTS, strict=True):
        assert_shows(frame, shot)
    notes = "\n".join(open_recording(bag.path).info().notes)
    assert "the stamps of 'camera' in 'base' are zero in tf: it is taken as fixed" in notes
    said = "the stamps of 'base' in 'map' are zero in tf: the times of recording are taken"
    assert (said in notes) == moves


def test_every_nth_frame_and_frames_outside_the_poses_are_counted(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS[:3])
        for shot in SHOTS:
            add_images(bag, shot)
    recording = open_recording(bag.path, RecordingOptions(every=2))
    assert len(recording) == len(list(recording.frames())) == 2
    assert recording.info().notes == (
        "left out 1 of 4 frames, outside the poses or in a gap between poses longer than 1 s "
        "(--max-pose-gap)",
    )


@pytest.mark.parametrize(("at", "known"), [((-1,), 0), ((-1, 3), 0), ((0,), 1)])
def test_a_transform_that_is_recorded_too_seldom_is_named(
    tmp_path: Path, at: tuple[int, ...], known: int
) -> None:
    """That of odom in the map, some seconds from the first image; all others are there."""
    with BagBuilder(tmp_path, "mcap") as bag:
        for second in at:
            bag.add_tf("/tf", START + second * 10**9, "map", "odom", (0, 0, 0))
        bag.add_tf("/tf_static", START, "base", "camera", (0, 0, 1))
        for shot in SHOTS:
            bag.add_tf("/tf", shot.stamp, "odom", "base", shot.position, shot.quat_xyzw)
            add_images(bag, shot)
    info = open_recording(bag.path).info()
    assert info.frames == known
    [text] = [text for text in (*info.missing, *info.notes) if "where 'odom' is in 'map'" in text]
    number = "1 transform," if len(at) == 1 else "2 transforms,"
    assert f"tf says at {known / len(SHOTS):.0%} of the images where" in text
    assert number in text
    assert bool(info.missing) == (not known)


def write_two_runs(folder: Path, kind: str, filler: int) -> Path:
    """Write a bag in which time began again: the camera is at x = 0, then at 5."""
    with BagBuilder(folder, kind) as bag:
        for x in (0, 5):
            bag.add("/log", "std_msgs/msg/String", START, {"data": "x" * filler})
            for tenth in range(40):
                stamp = START + tenth * 10**8 + x  # no stamp is there twice
                bag.add_tf("/tf", stamp, "map", "camera", (x, 0, 1))
        for tenth in range(40, 100):  # the second run lasts longer
            bag.add_tf("/tf", START + tenth * 10**8, "map", "camera", (5, 0, 1))
        for second in (1, 2, 6, 8):
            stamp = START + second * 10**9
            bag.add(DEPTH, IMAGE, stamp, image(SHOTS[0].depth_mm, "16UC1", stamp))
    return bag.path


def assert_the_second_run_is_used(path: Path) -> None:
    """By their times of recording, the two would alternate, and so would their poses."""
    recording = open_recording(path, RecordingOptions(intrinsics=INTRINSICS))
    assert [frame.map_T_camera[0, 3] for frame in recording.frames()] == [5, 5]
    assert "the stamps of tf go back" in " ".join(recording.info().notes)


@pytest.mark.parametrize("filler", [2**20, 1])  # which ends a chunk, or leaves all in one
def test_a_bag_in_which_time_began_again_is_read_in_the_order_of_the_file(
    tmp_path: Path, kind: str, filler: int
) -> None:
    assert_the_second_run_is_used(write_two_runs(tmp_path, kind, filler))


def test_an_mcap_file_without_chunks_is_read_in_its_order_too(tmp_path: Path) -> None:
    reading = pytest.importorskip("mcap.reader")
    writing = pytest.importorskip("mcap.writer")
    (chunked,) = write_two_runs(tmp_path, "mcap", 1).glob("*.mcap")
    path = tmp_path / "fastwrite.mcap"
    with chunked.open("rb") as source, path.open("wb") as target:
        writer = writing.Writer(target, use_chunking=False)
        writer.start("ros2", "test")
        channels: dict[int, int] = {}
        reader = reading.make_reader(source)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", known)
            number, time = channels[channel.id], message.log_time
            writer.add_message(number, time, message.data, message.publish_time)
        writer.finish()
    assert_the_second_run_is_used(path)


def test_a_frame_that_jumps_to_and_fro_is_named(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        for number in range(20):
            stamp, side = START - 10**9 + number * 10**8 // 2, number % 2
            bag.add_tf("/tf", stamp, "map", "camera", (0.5 * side, 0, 1.5))
            bag.add_tf("/tf", stamp, "base", "tag", (side, 0, 0))  # nothing to do with the camera
        bag.add_tf("/tf", START + 10**9, "map", "camera", (0, 0, 1.5))
        for shot in SHOTS:
            add_images(bag, shot)
    notes = open_recording(bag.path, RecordingOptions(max_pose_gap=3)).info().notes
    assert [note for note in notes if "to and fro" in note] == [
        "frame 'camera' jumps to and fro in 'map', by 0.50 m: if two nodes publish where it is, "
        "some of the poses are wrong"
    ]


def test_depth_and_poses_that_do_not_overlap_name_both_times(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "ros1") as bag:
        bag.add_tf("/tf", 5 * 10**9, "map", "camera", (0, 0, 0))
        bag.add_tf("/tf", 7 * 10**9, "map", "camera", (0, 0, 0))
        add_images(bag, SHOTS[0])
    assert open_recording(bag.path).info().missing == (
        "no frame has a pose: depth images reach from 1600000000.250 to 1600000000.250 s, poses "
        "from 5.000 to 7.000 s; if their clocks differ by a few seconds, give --time-offset; by "
        "more, convert the stamps of the poses",
    )


def test_a_bag_is_streamed_with_few_messages_in_memory(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add_tf("/tf", START, "map", "camera", (0, 0, 0))
        bag.add_tf("/tf", START + 10**9, "map", "camera", (0, 0, 0))
        depth, color = np.ones((2, 2), np.uint16), np.ones((2, 2, 3), np.uint8)
        stamps = [START + 10**6 * i for i in range(400)]
        for stamp in stamps:
            bag.add("/rgb/image", IMAGE, START, image(color, "rgb8", stamp))
        for stamp in stamps:
            bag.add("/depth/image", IMAGE, START + 1, image(depth, "16UC1", stamp))
    tiny = (2.0, 2.0, 0.5, 0.5)
    options = RecordingOptions(intrinsics=tiny)
    with pytest.raises(FormatError, match="belong together are more than 300 frames apart"):
        next(open_recording(bag.path, options).frames())
    few = RecordingOptions(intrinsics=tiny, every=2)  # what is not wanted is not kept
    assert sum(1 for _ in open_recording(bag.path, few).frames()) == 200


def test_the_map_frame_may_have_another_name(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "ros1", SHOTS, root="world")
    for frame, shot in zip(frames_of(path, map_frame="/world"), SHOTS, strict=True):
        assert_shows(frame, shot)


@pytest.mark.parametrize("slash", ["", "/"])
def test_without_a_frame_map_the_root_above_the_camera_is_taken_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, slash: str
) -> None:
    with BagBuilder(tmp_path, "ros1") as bag:
        add_poses(bag, SHOTS, root="world", slash=slash)
        bag.add_tf("/tf_static", START, "elsewhere", "something", (0, 0, 0))
        bag.add("/map", GRID, START, grid([0] * 6, slash + "world"))
        for shot in SHOTS:
            add_images(bag, shot)
    recording = open_recording(bag.path)
    note = (
        "tf has no frame 'map': the map is made in 'world', the root above the camera, whose z "
        "axis must point up (--map-frame)"
    )
    assert recording.info().notes == (note,)
    assert caplog.messages == []
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)
    assert caplog.messages == [f"{bag.path}: {note}"]
    assert recording.frame_id == "world"
    layer = recording.occupancy()
    assert layer is not None
    assert layer.frame_id == "world"


def test_a_camera_that_stood_still_needs_a_frame_by_name(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add_tf("/tf_static", START, "base", "camera", (0, 0, 1))
        for shot in SHOTS:
            add_images(bag, shot)
    [*frames] = frames_of(bag.path, map_frame="base")
    assert [frame.map_T_camera[2, 3] for frame in frames] == [1.0] * 4
