"""Small bags that would take gigabytes or minutes, or that never end."""

from __future__ import annotations

import bz2
import os
import sqlite3
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.rosbag1 import reader as rosbag1_reader
from rosbags.rosbag2 import storage_mcap as mcap

from hypermap.core.errors import FormatError
from hypermap.recordings.bag import bombs
from hypermap.recordings.bag.file import BagFile

from .bag_builder import DEPTH, BagBuilder, add_images, write_bag
from .shots import SHOTS

BZ2 = rosbag1.Writer.CompressionFormat.BZ2
LZ4 = rosbag1.Writer.CompressionFormat.LZ4
ZSTD = rosbag2.CompressionFormat.ZSTD
IN_CHUNKS = rosbag2.CompressionMode.STORAGE, ZSTD
EACH_MESSAGE = rosbag2.CompressionMode.MESSAGE, ZSTD
WHOLE_FILES = rosbag2.CompressionMode.FILE, ZSTD


@pytest.mark.parametrize(
    ("kind", "compression"),
    [("ros1", [BZ2]), ("ros1", [LZ4]), ("mcap", IN_CHUNKS), ("db3", EACH_MESSAGE)],
)
def test_a_chunk_that_unpacks_to_too_much_is_refused(
    tmp_path: Path, kind: str, compression: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = BagBuilder(tmp_path, kind)
    bag._writer.set_compression(*compression)
    with bag:
        add_images(bag, SHOTS[0])
    assert len(list(BagFile(bag.path).messages([DEPTH]))) == 1
    monkeypatch.setattr(bombs, "MOST_BYTES", 1000)
    with pytest.raises(FormatError, match="a chunk unpacks to more than"):
        list(BagFile(bag.path).messages([DEPTH]))


def test_a_packed_file_that_fills_the_disk_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = BagBuilder(tmp_path, "db3")
    bag._writer.set_compression(*WHOLE_FILES)
    with bag:
        add_images(bag, SHOTS[0])
    assert len(list(BagFile(bag.path).messages([DEPTH]))) == 1
    with monkeypatch.context() as nearly_full:
        usage = SimpleNamespace(total=10**9, used=10**9 - 2000, free=2000)
        nearly_full.setattr("hypermap.recordings.bag.bombs.shutil.disk_usage", lambda _: usage)
        with pytest.raises(FormatError, match=r"more than half of the free space in .*TMPDIR"):
            list(BagFile(bag.path).messages([DEPTH]))
    monkeypatch.setattr(bombs, "SMALL_FILE", 1000)
    monkeypatch.setattr(bombs, "MOST_COMPRESSION", 1)
    with pytest.raises(FormatError, match="a file unpacks to more than 1 times its size"):
        list(BagFile(bag.path).messages([DEPTH]))


@pytest.mark.parametrize(
    ("packed", "unpacked"),
    [
        (bz2.compress, rosbag1_reader.decompressors["bz2"]),
        (lz4.frame.compress, lambda data: mcap.DECOMPRESSORS["lz4"](data, 0)),
    ],
    ids=["bz2", "lz4"],
)
def test_a_chunk_may_be_of_several_streams(packed: Any, unpacked: Any) -> None:
    assert unpacked(packed(b"one, ") + packed(b"two")) == b"one, two"
    with pytest.raises(FormatError, match="more than 1000 streams"):
        unpacked(packed(b"") * 1001)
    with pytest.raises(FormatError, match="cut off"):
        unpacked(packed(b"one")[:-1])


def test_a_table_that_computes_gigabytes_is_refused(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "db3", SHOTS)
    with sqlite3.connect(path / "test.db3") as database:
        database.executescript(
            "DROP TABLE messages; CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp "
            "INTEGER, data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL);"
            "INSERT INTO messages(id, topic_id, timestamp) SELECT id, id, id FROM topics"
        )
    database.close()
    with pytest.raises(FormatError, match="too big"):
        list(BagFile(path).messages([DEPTH]))


@pytest.mark.parametrize("name", ["test.db3", "metadata.yaml"])
def test_a_pipe_in_a_bag_is_not_waited_for(tmp_path: Path, name: str) -> None:
    path = write_bag(tmp_path, "db3", SHOTS)
    (path / name).unlink()
    os.mkfifo(path / name)
    with pytest.raises(FormatError, match="is not a regular file"):
        _ = BagFile(path).topics


def test_definitions_of_messages_are_of_limited_length(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag(tmp_path, kind, SHOTS)
    monkeypatch.setattr(bombs, "MOST_DEFINITION", 100)
    with pytest.raises(FormatError, match="of which at most 100 are read"):
        list(BagFile(path).messages([DEPTH]))
