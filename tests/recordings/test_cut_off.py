"""Bags whose recording was cut off are read as far as they go."""

from __future__ import annotations

import logging
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from rosbags import rosbag1, rosbag2

from hypermap.core.errors import FormatError
from hypermap.recordings import open_recording
from hypermap.recordings.samples import read_bag

from .bag_builder import DEPTH, BagBuilder, add_images, add_poses
from .bag_tools import storage_file
from .shots import START, assert_shows, make_shots

SHOTS = make_shots(12)
REPAIR = {"ros1": "rosbag reindex", "db3": "ros2 bag reindex", "mcap": "mcap recover"}
ENDS_EARLY = "ends early, as when a recording or a copy is cut off: "


def write(folder: Path, kind: str, name: str = "test", packed: str = "") -> Path:
    """Write a bag with a chunk for each shot, as of robots whose images are large."""
    bag = BagBuilder(folder, kind, name)
    writer: Any = bag._writer
    if kind == "ros1":
        writer.chunk_threshold = 4000
    if packed and kind == "ros1":
        writer.set_compression(rosbag1.Writer.CompressionFormat[packed])
    elif packed:
        mode, how = rosbag2.CompressionMode[packed], rosbag2.CompressionFormat.ZSTD
        writer.set_compression(mode, how)
    with bag:
        add_poses(bag, SHOTS[:1])
        for shot in SHOTS:
            base = shot.position - [0, 1, 0] - shot.map_T_camera[:3, 2] * -0.5
            bag.add_tf("/tf", shot.stamp, "odom", "base", base, shot.quat_xyzw)
            add_images(bag, shot)
            if kind == "mcap":
                writer.storage.close_chunk()
    return storage_file(bag.path)


def cut(file: Path, share: float, *, zeros: bool = False) -> Path:
    """Return a copy that ends after a share of the file, or is of zeros from there."""
    content = file.read_bytes()
    kept = content[: int(len(content) * share)]
    copy = file.parent / f"cut{file.suffix}"
    copy.write_bytes(kept + bytes(len(content) - len(kept)) * zeros)
    return copy


@pytest.mark.parametrize("share", [0.4, 0.58, 0.75, 0.93])
def test_a_bag_that_was_cut_off_is_read_up_to_there(
    tmp_path: Path, kind: str, share: float, caplog: pytest.LogCaptureFixture
) -> None:
    path = cut(write(tmp_path, kind), share)
    recording = open_recording(path)
    info = recording.info()
    assert info.missing == ()
    [note] = [note for note in info.notes if note.startswith(f"the bag {ENDS_EARLY}")]
    with caplog.at_level(logging.WARNING):
        frames = list(recording.frames())
    assert f"{path}: {note}" in [record.getMessage() for record in caplog.records]
    for frame, shot in zip(frames, SHOTS, strict=False):
        assert_shows(frame, shot)
    assert len(SHOTS) * share - 5 < len(frames) < len(SHOTS) * share + 1


@pytest.mark.parametrize(
    ("kind", "packed"),
    [
        ("ros1", "LZ4"),
        ("ros1", "BZ2"),
        ("mcap", "STORAGE"),
        ("mcap", "MESSAGE"),
        ("db3", "MESSAGE"),
    ],
)
def test_a_packed_bag_is_read_up_to_its_last_complete_chunk_or_message(
    tmp_path: Path, kind: str, packed: str
) -> None:
    recording = open_recording(cut(write(tmp_path, kind, packed=packed), 0.75))
    frames = list(recording.frames())
    for frame, shot in zip(frames, SHOTS, strict=False):
        assert_shows(frame, shot)
    assert 5 <= len(frames) < len(SHOTS)


def test_what_is_lost_of_a_file_is_told(tmp_path: Path) -> None:
    path = write(tmp_path, "ros1")
    size, content = path.stat().st_size, path.read_bytes()
    index = int.from_bytes(content[(at := content.index(b"index_pos=") + 10) : at + 8], "little")
    path.write_bytes(content[: size - size // 4])
    [note] = notes_on(path)
    assert note.startswith(f"the bag {ENDS_EARLY}39 messages over 0.8 s are read; its last ")
    lost = f" bytes are damaged or unfinished, and {index - path.stat().st_size} bytes are missing"
    assert note.endswith(lost)

    path = write(tmp_path, "db3", "database")
    path.write_bytes(path.read_bytes() + bytes(path.stat().st_size))
    assert notes_on(path) == []
    path.write_bytes(path.read_bytes()[:63488])
    expected = f"the bag {ENDS_EARLY}16 messages over 0.3 s are read; 63488 bytes are missing"
    assert notes_on(path) == [expected.replace("63488 bytes", "0.1 MB")]

    path = write(tmp_path, "mcap", "chunks")
    content = path.read_bytes()
    path.write_bytes(content[: begin_of_record(content, 20) + 5])
    [note] = notes_on(path)
    assert note.endswith(" s are read; its last 5 bytes are damaged or unfinished")


def begin_of_record(content: bytes, number: int) -> int:
    begin = 8  # of the first one of an MCAP file
    for _ in range(number):
        begin += 9 + int.from_bytes(content[begin + 1 : begin + 9], "little")
    return begin


def notes_on(path: Path) -> list[str]:
    return [note for note in open_recording(path).info().notes if ENDS_EARLY in note]


@pytest.mark.parametrize("share", [0.4, 0.75, 0.93])
def test_a_bag_that_ends_in_zeros_is_read_up_to_them(
    tmp_path: Path, kind: str, share: float
) -> None:
    path = cut(write(tmp_path, kind), share, zeros=True)
    recording = open_recording(path)
    assert any(ENDS_EARLY in note for note in recording.info().notes)
    stamps = [frame.stamp for frame in recording.frames(lambda *_: None)]
    expected = [shot.stamp / 1e9 for shot in SHOTS][: len(stamps)]
    assert stamps == pytest.approx(expected, abs=1e-6)
    assert len(SHOTS) * share - 5 < len(stamps) <= len(SHOTS) * share + 1


def test_a_bag_of_which_nothing_can_be_read_is_an_error_with_a_remedy(
    tmp_path: Path, kind: str
) -> None:
    path = cut(write(tmp_path, kind), 0.08)
    recording = open_recording(path)
    with pytest.raises(FormatError) as caught:
        list(recording.frames())
    assert str(caught.value).startswith(f"{path}: the bag cannot be read (")
    assert f"`{REPAIR[kind]}` may repair it" in str(caught.value)
    assert recording.info().missing == (str(caught.value),)


@pytest.mark.parametrize("damage", [b"\xff" * 500, b"\x05" + b"\xff" * 8 + bytes(500)])
def test_a_file_is_read_up_to_a_record_of_any_length(tmp_path: Path, damage: bytes) -> None:
    path = write(tmp_path, "mcap")
    content = path.read_bytes()
    path.write_bytes(content[: begin_of_record(content, 20)] + damage)
    [note] = notes_on(path)
    assert note.endswith(f" s are read; its last {len(damage)} bytes are damaged or unfinished")


def test_parts_of_a_bag_of_which_the_last_was_cut_off_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    shutil.copy(write(tmp_path, "mcap", "first"), folder / "drive_0.mcap")
    last = cut(write(tmp_path, "mcap", "second"), 0.6)
    shutil.move(last, folder / "drive_1.mcap")
    (folder / "metadata.yaml").touch()  # the power was lost before this was on the disk
    [note] = notes_on(folder)
    assert note.startswith(f"drive_1.mcap {ENDS_EARLY}")
    assert len(list(open_recording(folder).frames())) == len(SHOTS)


@pytest.mark.parametrize("size", [0, 13, 900])
def test_a_last_part_in_which_nothing_was_written_is_left_out(
    tmp_path: Path, kind: str, size: int, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    first = write(tmp_path, kind, "first")
    parts = [folder / f"drive_{number}{first.suffix}" for number in range(2)]
    parts[0].write_bytes(first.read_bytes())
    parts[1].write_bytes(first.read_bytes()[:size])
    recording = open_recording(folder)
    assert len(list(recording.frames())) == len(SHOTS)
    [note] = [note for note in recording.info().notes if "left out" in note]
    assert note.startswith(f"{parts[1].name} is left out: the bag cannot be read (")
    assert caplog.messages.count(f"{folder}: {note}") == 1
    parts[0].write_bytes(first.read_bytes()[:size])
    parts[1].write_bytes(first.read_bytes())
    [problem] = open_recording(folder).info().missing
    assert problem.startswith(f"{parts[0]}: the bag cannot be read (")


def test_a_last_part_that_may_not_be_read_is_an_error(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    file = write(tmp_path, kind)
    parts = [shutil.copy(file, folder / f"drive_{number}{file.suffix}") for number in range(2)]
    open_file = Path.open

    def may_not_open(path: Path, *args: Any) -> Any:  # root may read everything
        if path == parts[1]:
            raise PermissionError(13, "Permission denied", str(path))
        return open_file(path, *args)

    monkeypatch.setattr(Path, "open", may_not_open)
    [problem] = open_recording(folder).info().missing
    assert problem == f"{parts[1]}: the bag cannot be read (Permission denied)"


@pytest.mark.parametrize("size", [4, 200])
def test_a_damaged_chunk_of_a_bag_that_has_its_index_is_left_out(tmp_path: Path, size: int) -> None:
    path = write(tmp_path, "ros1")
    content = bytearray(path.read_bytes())
    at = -1
    for _ in range(len(SHOTS) // 2):
        at = content.index(b"compression=", at + 1)
    content[at : at + size] = b"\xff" * size
    path.write_bytes(content)
    recording = open_recording(path)
    stamps = [frame.stamp for frame in recording.frames()]
    kept = [shot.stamp / 1e9 for shot in SHOTS if shot is not SHOTS[len(SHOTS) // 2 - 2]]
    assert stamps == pytest.approx(kept, abs=1e-6)
    [note] = [note for note in recording.info().notes if "damaged" in note]
    assert note == "the bag is damaged: 4 messages in 1 of its 13 chunks cannot be read"
    [depth] = [stream for stream in recording.info().streams if stream.name == DEPTH]
    assert depth.count == len(SHOTS) - 1


@pytest.mark.parametrize(
    ("kind", "packed"), [("ros1", "LZ4"), ("ros1", "BZ2"), ("mcap", "STORAGE")]
)
def test_of_a_chunk_whose_content_is_damaged_only_its_messages_are_lost(
    tmp_path: Path, kind: str, packed: str
) -> None:
    path = write(tmp_path, kind, packed=packed)
    content = bytearray(path.read_bytes())
    if kind == "ros1":
        at = -1
        for _ in range(6):
            at = content.index(b"compression=", at + 1)
    else:
        chunks = [n for n in range(40) if content[begin_of_record(content, n)] == 0x06]
        at = begin_of_record(content, chunks[5])
    content[at + 200 : at + 240] = b"\xff" * 40
    path.write_bytes(content)
    recording = open_recording(path)
    bad: list[str] = []
    frames = list(recording.frames(lambda _, error: bad.append(str(error))))
    for frame in frames:
        stamps = [round(shot.stamp / 1e9, 6) for shot in SHOTS]
        assert_shows(frame, SHOTS[stamps.index(round(frame.stamp, 6))])
    assert len(SHOTS) - 2 <= len(frames) < len(SHOTS)
    assert bad
    assert all(one.endswith(": a chunk of the bag is damaged") for one in bad)


@pytest.mark.parametrize(("lost", "zeros"), [(8, 0), (0, 4096)])
def test_a_file_that_is_damaged_after_its_messages_is_read_as_whole(
    tmp_path: Path, lost: int, zeros: int
) -> None:
    path = write(tmp_path, "mcap")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) - lost] + bytes(zeros))
    recording = open_recording(path)
    assert len(list(recording.frames())) == len(SHOTS)
    assert "the bag is damaged, but only after its 51 messages" in recording.info().notes


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_the_messages_of_a_folder_are_counted_in_its_files(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind)
    shutil.move(cut(path, 0.6), path)
    info = open_recording(path.parent).info()
    [depth] = [stream for stream in info.streams if stream.name == DEPTH]
    assert len(SHOTS) // 3 < depth.count < len(SHOTS)
    assert len(list(open_recording(path.parent).frames())) in (depth.count, depth.count - 1)


def test_measured_values_are_read_up_to_the_end_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bag = BagBuilder(tmp_path, "ros1")
    writer: Any = bag._writer
    writer.chunk_threshold = 500
    with bag:
        for i in range(40):
            time = START + i * 100_000_000
            bag.add_tf("/tf", time, "map", "base_link", (i, 0, 0))
            bag.add("/temperature", "std_msgs/msg/Float64", time, {"data": 20.0 + i})
    path = cut(bag.path, 0.5)
    measured = read_bag(path, "/temperature")
    count = len(measured.samples.values)
    assert 5 < count < 30
    assert measured.samples.values.tolist() == pytest.approx([20.0 + i for i in range(count)])
    assert f"{path}: the bag {ENDS_EARLY}" in caplog.text


def test_newest_messages_that_sqlite_left_in_a_log_are_told(tmp_path: Path) -> None:
    path = write(tmp_path, "db3")
    copy = path.parent / "a copy.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("DELETE FROM messages WHERE id > 30")
        database.commit()
        database.execute("UPDATE topics SET name = name")
        database.commit()
        for ending in ("", "-wal"):
            shutil.copy(f"{path}{ending}", f"{copy}{ending}")
    [note] = [note for note in open_recording(copy).info().notes if "newest" in note]
    command = f"sqlite3 '{copy}' 'SELECT count(*) FROM topics'"
    assert note == (
        "the bag does not contain its newest messages, which are in a copy.db3-wal: "
        f"`{command}` adds them"
    )
    with closing(sqlite3.connect(copy)) as database:  # as this command does
        database.execute("SELECT count(*) FROM topics").fetchall()
    assert not any("newest" in note for note in open_recording(copy).info().notes)
    assert sum(stream.count for stream in open_recording(copy).info().streams) == 30


def test_a_change_of_a_database_that_was_cut_off_is_told(tmp_path: Path) -> None:
    path = write(tmp_path, "db3")
    copy = path.parent / "copy.db3"
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute("PRAGMA cache_size = 1")  # so that pages are written before the commit
        database.execute("BEGIN")
        database.execute("UPDATE messages SET data = zeroblob(5000)")
        for ending in ("", "-journal"):
            shutil.copy(f"{path}{ending}", f"{copy}{ending}")
        database.execute("ROLLBACK")
    notes = [note for note in open_recording(copy).info().notes if "journal" in note]
    assert notes == [
        "the bag may be damaged, because its last change was cut off: "
        f"`sqlite3 {copy} 'SELECT count(*) FROM topics'` undoes this change by copy.db3-journal"
    ]
    with closing(sqlite3.connect(copy)) as database:  # as this command does
        database.execute("SELECT count(*) FROM topics").fetchall()
    assert len(list(open_recording(copy).frames())) == len(SHOTS)
    assert not any("journal" in note for note in open_recording(copy).info().notes)


@pytest.mark.parametrize(("log", "size"), [("wal", 0), ("journal", 0), ("journal", 512)])
def test_a_log_of_which_all_is_in_the_database_is_not_told(
    tmp_path: Path, log: str, size: int
) -> None:
    path = write(tmp_path, "db3")
    Path(f"{path}-{log}").write_bytes(bytes(size))  # as SQLite leaves it after a commit
    assert not any(log in note for note in open_recording(path).info().notes)


def test_a_database_that_is_all_in_its_log_is_an_error_with_a_remedy(tmp_path: Path) -> None:
    path = write(tmp_path, "db3")
    Path(f"{path}-wal").write_bytes(b"a log")
    path.write_bytes(b"")
    [problem] = open_recording(path).info().missing
    assert (
        "; it does not contain its newest messages, which are in test.db3-wal: `sqlite3 " in problem
    )
