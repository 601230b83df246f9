"""The files of a bag: whole, in parts, damaged, foreign."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import yaml

from hypermap.core.errors import FormatError
from hypermap.recordings import RecordingOptions, open_recording

from .bag_builder import COLOR, DEPTH, IMAGE, BagBuilder, add_images, add_poses, image, write_bag
from .bag_tools import frames_of, storage_file, without
from .shots import INTRINSICS, SHOTS, assert_shows


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the bag cannot be read ("),
        (bytes(4096), "the bag cannot be read ("),
        (
            b"this is not a bag\n" * 100,
            "is not a bag of this kind: its first bytes are not",
        ),
        (b"\x89PNG\r\n\x1a\n", "is not a bag of this kind: its first bytes are not"),
    ],
)
def test_a_foreign_file_is_an_error_that_info_tells(
    tmp_path: Path, kind: str, content: bytes, message: str
) -> None:
    path = tmp_path / {"ros1": "a.bag", "db3": "a.db3", "mcap": "a.mcap"}[kind]
    path.write_bytes(content)
    [problem] = open_recording(path).info().missing
    assert problem.startswith(f"{path}: {message}")


def test_an_mcap_file_of_another_program_is_said_to_be_one(tmp_path: Path) -> None:
    mcap = pytest.importorskip("mcap.writer")
    path = tmp_path / "foxglove.mcap"
    with path.open("wb") as file:
        writer = mcap.Writer(file)
        writer.start(profile="", library="test")
        writer.finish()
    assert open_recording(path).info().missing == (f"{path}: only MCAP files of ROS 2 can be read",)


@pytest.mark.parametrize(
    "left_out",
    [
        {"index_types": "CHUNK"},  # as noMessageIndex of rosbag2 does
        {"index_types": "NONE"},
        {"repeat_channels": False},
        {"repeat_schemas": False},
        {"repeat_schemas": False, "use_chunking": False},
        {"repeat_channels": False, "repeat_schemas": False, "use_statistics": False},
    ],
)
def test_an_mcap_file_is_read_whatever_its_recorder_leaves_out_of_the_index(
    tmp_path: Path, left_out: dict[str, Any]
) -> None:
    mcap = pytest.importorskip("mcap.writer")
    make_reader = pytest.importorskip("mcap.reader").make_reader
    path, schemas, channels = tmp_path / "a.mcap", dict[int, int](), dict[int, int]()
    written = storage_file(write_bag(tmp_path, "mcap", SHOTS))
    if "index_types" in left_out:
        left_out = {"index_types": mcap.IndexType[left_out["index_types"]]}
    with written.open("rb") as source, path.open("wb") as file:
        writer = mcap.Writer(file, chunk_size=5000, **left_out)
        writer.start(profile="ros2", library="test")
        for schema, channel, message in make_reader(source).iter_messages():
            if schema.id not in schemas:
                given = schema.name, schema.encoding, schema.data
                schemas[schema.id] = writer.register_schema(*given)
            if channel.id not in channels:
                schema_id = schemas[schema.id]
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", schema_id)
            given = message.log_time, message.data, message.publish_time
            writer.add_message(channels[channel.id], *given)
        writer.finish()
    for frame, shot in zip(frames_of(path), SHOTS, strict=True):
        assert_shows(frame, shot)
    streams = (open_recording(one).info().streams for one in (path, written))
    assert len({tuple(one) for one in streams}) == 1


def test_a_folder_without_metadata_is_read_from_its_only_file(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", SHOTS)
    (path / "metadata.yaml").unlink()
    for frame, shot in zip(frames_of(path), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_a_single_storage_file_is_read_without_its_folder(tmp_path: Path) -> None:
    for kind in ("db3", "mcap"):
        file = storage_file(write_bag(tmp_path / kind, kind, SHOTS))
        for frame, shot in zip(frames_of(file), SHOTS, strict=True):
            assert_shows(frame, shot)


@pytest.mark.parametrize("name", ["a#b", "what?", "50% done", "a%20b", "ü 🙂", "x&mode=rw"])
def test_a_bag_may_have_any_name(tmp_path: Path, kind: str, name: str) -> None:
    written = storage_file(write_bag(tmp_path, kind, SHOTS))
    folder = tmp_path / name
    folder.mkdir()
    path = folder / f"{name}{written.suffix}"
    shutil.copy(written, path)
    for frame, shot in zip(frames_of(path), SHOTS, strict=True):
        assert_shows(frame, shot)


def write_parts(folder: Path, kind: str, names: list[str]) -> Path:
    """Write a bag in parts, of which the first has tf and each one more shot."""
    (folder / "work").mkdir(parents=True)
    for i, name in enumerate(names):
        with BagBuilder(folder / "work", kind, f"part_{i}") as bag:
            if i == 0:
                add_poses(bag, SHOTS)
            if i < len(SHOTS):
                add_images(bag, SHOTS[i])
        storage_file(bag.path).rename(folder / name)
    shutil.rmtree(folder / "work")
    return folder


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("ros1", [f"drive_{i}.bag" for i in range(4)]),
        ("ros1", [f"desk_2026-11-21-07-10-{50 + i}_{i + 9}.bag" for i in range(5)]),
        ("mcap", [f"rosbag2_2026_11_21-07_10_51_{i}.mcap" for i in range(4)]),
        ("db3", [f"drive_{i}.db3" for i in range(4)]),
    ],
)
def test_the_parts_of_a_bag_are_read_in_order_of_their_numbers(
    tmp_path: Path, kind: str, names: list[str]
) -> None:
    folder = write_parts(tmp_path / "parts", kind, names)
    recording = open_recording(folder)
    info = recording.info()
    assert info.format == ("ROS 1 bag" if kind == "ros1" else "ROS 2 bag")
    assert info.missing == ()
    assert {(s.name, s.count) for s in info.streams} >= {(DEPTH, 4), ("/tf_static", 2)}
    for frame, shot in zip(recording.frames(), SHOTS, strict=True):
        assert_shows(frame, shot)


def test_a_later_part_alone_says_which_part_has_what_it_lacks(tmp_path: Path) -> None:
    names = [f"desk_2026-11-21-07-10-{50 + i}_{i + 9}.bag" for i in range(3)]
    folder = write_parts(tmp_path, "ros1", names)
    told = f"if this is a part of the bag that begins with {names[0]}, give a folder"
    assert told in open_recording(folder / names[1]).info().missing[-1]
    with pytest.raises(FormatError, match=told):
        len(open_recording(folder / names[2]))
    assert told not in " ".join(open_recording(folder / names[0]).info().missing)


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_ros2_bag_in_parts_is_read_by_its_metadata(tmp_path: Path, kind: str) -> None:
    names = [f"drive_{i}.{kind}" for i in range(4)]
    folder = write_parts(tmp_path / "drive", kind, names)
    with BagBuilder(tmp_path, kind, "whole") as bag:
        without()(bag)
    metadata = yaml.safe_load((bag.path / "metadata.yaml").read_text())
    metadata["rosbag2_bagfile_information"]["relative_file_paths"] = names
    (folder / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    assert open_recording(folder).info().missing == ()
    for frame, shot in zip(frames_of(folder), SHOTS, strict=True):
        assert_shows(frame, shot)


@pytest.mark.parametrize(
    ("names", "listed"),
    [
        (["a.bag", "b.bag"], "a.bag, b.bag"),
        (["a_0.bag", "b_1.bag"], "a_0.bag, b_1.bag"),
        (["a_0.bag", "a_1.bag", "other.bag"], "a_0.bag, a_1.bag, other.bag"),
        ([f"{i}_7.bag" for i in range(5)], "0_7.bag, 1_7.bag, 2_7.bag, 3_7.bag, ..."),
        (["a_0.bag", "a_1.mcap"], "a_0.bag, a_1.mcap"),
    ],
)
def test_several_bags_that_are_not_parts_of_one_are_an_error(
    tmp_path: Path, names: list[str], listed: str
) -> None:
    for name in names:
        (tmp_path / name).touch()
    assert open_recording(tmp_path).info().missing == (
        f"{tmp_path}: there are {len(names)} bags that are not the parts of one, which would be "
        f"called NAME_0, NAME_1 and so on: {listed}; name one of them",
    )


def test_packed_parts_that_no_description_names_are_to_be_unpacked(tmp_path: Path) -> None:
    for name in ("bag_0.mcap.zstd", "bag_1.mcap"):
        (tmp_path / name).touch()
    [problem] = open_recording(tmp_path).info().missing
    assert problem.startswith(f"{tmp_path}: bag_0.mcap.zstd is packed, and there is no metadata")
    (tmp_path / "bag_0.mcap").touch()
    [problem] = open_recording(tmp_path).info().missing
    assert problem.startswith(f"{tmp_path / 'bag_0.mcap'}: the bag cannot be read (")


def test_a_folder_with_an_empty_description_of_a_bag_alone_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").touch()
    [problem] = open_recording(tmp_path).info().missing
    assert problem == f"{tmp_path}: there is an empty metadata.yaml, but no file of a bag"


@pytest.mark.parametrize(
    ("right", "wrong", "reason"),
    [
        (b"uint32 step", b"uint32 stop", "a sensor_msgs/msg/Image has no step"),
        (b"Transform transform", b"Transform trAnsform", "TransformStamped has no transform"),
        (b"float64 w\n", b"float64 W\n", "a geometry_msgs/msg/Quaternion has no w"),
    ],
)
def test_a_bag_with_other_types_of_the_same_names_is_an_error(
    tmp_path: Path, right: bytes, wrong: bytes, reason: str
) -> None:
    path = write_bag(tmp_path, "ros1", SHOTS)
    assert right in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(right, wrong))
    with pytest.raises(FormatError, match=f"in the bag.s definitions, .*{reason}"):
        list(open_recording(path).frames())


def test_a_bag_whose_color_images_are_all_damaged_says_so(tmp_path: Path, kind: str) -> None:
    with BagBuilder(tmp_path, kind) as bag:
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            bag.add(DEPTH, IMAGE, shot.stamp, image(shot.depth_mm, "16UC1", shot.stamp))
            color = image(shot.color, "rgb8", shot.color_stamp)
            bag.add(COLOR, IMAGE, shot.color_stamp, color, cut=30)
    recording = open_recording(bag.path, RecordingOptions(intrinsics=INTRINSICS))
    assert recording.info().missing[0].startswith(f"{bag.path}: {COLOR}: a message is damaged: ")


@pytest.mark.parametrize("bad", [[0], [2], [0, 1, 2, 3]])
def test_a_damaged_message_costs_its_frame_alone(tmp_path: Path, kind: str, bad: list[int]) -> None:
    with BagBuilder(tmp_path, kind) as bag:
        add_poses(bag, SHOTS)
        for i, shot in enumerate(SHOTS):
            depth = image(shot.depth_mm, "16UC1", shot.stamp)
            bag.add(DEPTH, IMAGE, shot.stamp, depth, cut=30 if i in bad else None)
    recording = open_recording(bag.path, RecordingOptions(intrinsics=INTRINSICS))
    problem = f"{bag.path}: {DEPTH}: a message is damaged: "
    if len(bad) == len(SHOTS):
        assert recording.info().missing[0].startswith(problem)
        return
    assert recording.info().frames == len(SHOTS) - 1
    assert f"messages that cannot be read: 1, the first: {problem}" in recording.info().notes[-1]
    reported: list[tuple[float, str]] = []
    frames = list(recording.frames(lambda stamp, error: reported.append((stamp, str(error)))))
    good = [shot.stamp / 1e9 for i, shot in enumerate(SHOTS) if i not in bad]
    assert [frame.stamp for frame in frames] == pytest.approx(good)
    [(stamp, message)] = reported
    assert stamp == pytest.approx(SHOTS[bad[0]].stamp / 1e9)
    assert message.startswith(problem)
    with pytest.raises(FormatError, match="a message is damaged"):
        list(recording.frames())


def test_a_description_that_takes_minutes_to_read_is_refused(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", SHOTS[:1])
    described = path / "metadata.yaml"
    described.write_bytes(described.read_bytes() + b"# " + b"x" * 1_000_000)
    [problem] = open_recording(path).info().missing
    assert problem.startswith(f"{path}: metadata.yaml has 1.0 MB, of which at most 1 are read")


@pytest.mark.parametrize("column", ["name", "type"])
def test_a_topic_without_a_name_or_a_type_is_one_error(tmp_path: Path, column: str) -> None:
    bag = BagBuilder(tmp_path, "db3")
    with bag:
        add_poses(bag, SHOTS)
        add_images(bag, SHOTS[0])
    [file] = bag.path.glob("*.db3")
    with closing(sqlite3.connect(file)) as database, database:
        database.executescript(
            f"""CREATE TABLE loose AS SELECT * FROM topics;
            DROP TABLE topics; ALTER TABLE loose RENAME TO topics;
            UPDATE topics SET {column} = NULL WHERE id = 1"""
        )
    with pytest.raises(FormatError, match="a topic without a name or a type"):
        list(open_recording(file).frames())
