"""The order of the messages in a bag whose clock went back while it was recorded."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection
from rosbags.rosbag1.reader import IndexData
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from hypermap.core.arrays import IntArray
from hypermap.recordings.bag.cut_off import SqliteReader

_BACK = 1_000_000_000  # [ns] by which times go back where a clock was set, or time began again
_INDEX_HEAD = 15  # bytes before the times in a MCAP message index: opcode, lengths, channel


def read_without_index(reader: rosbag1.Reader | rosbag2.Reader) -> None:
    """Let a reader yield the messages of files without an index as written.

    MCAP files of `ros2 bag record --storage-preset-profile fastwrite` are such; rosbags refuses
    them if times go back in them, by however little. So are files that were cut off.
    """
    for storage in _storages(reader):
        if isinstance(storage, McapReader) and not storage.chunks:
            vars(storage)["messages"] = storage.messages_scan
        elif isinstance(storage, SqliteReader) and storage.lacks_rows:
            vars(storage)["messages"] = partial(_rows_of, storage)


def read_as_written(
    reader: rosbag1.Reader | rosbag2.Reader, wanted: Collection[Connection]
) -> None:
    """Let a reader yield messages in the order in which they lie in the file, if times go back.

    Args:
        reader: open.
        wanted: what is read.
    """
    if isinstance(reader, rosbag1.Reader):
        _read_ros1_as_written(reader, wanted)
        return
    names = {connection.topic for connection in wanted}
    for storage in _storages(reader):
        numbers = [c.id for c in storage.connections if c.topic in names]
        if isinstance(storage, Sqlite3Reader) and _goes_back(_times_in(storage, numbers)):
            vars(storage)["messages"] = partial(_rows_of, storage)
        elif isinstance(storage, McapReader) and _goes_back(_times_in_chunks(storage, numbers)):
            vars(storage)["messages"] = storage.messages_scan


def _storages(reader: rosbag1.Reader | rosbag2.Reader) -> list[Any]:
    """Return the files of a ROS 2 bag."""
    if isinstance(reader, rosbag1.Reader):
        return []
    return list(getattr(reader.storage, "storages", [reader.storage]))


def _goes_back(times: IntArray) -> bool:
    """Whether some times [ns], in the order of a file, are before earlier ones."""
    return bool((times < np.maximum.accumulate(times) - _BACK).any())


def _read_ros1_as_written(reader: rosbag1.Reader, wanted: Collection[Connection]) -> None:
    """Sort the indexes, which a reader merges: it takes the least entry first, of time or place."""
    indexes = {connection.id: reader.indexes[connection.id] for connection in wanted}
    numbers = chain.from_iterable(chain.from_iterable(indexes.values()))
    time, chunk, offset = np.fromiter(numbers, np.int64).reshape(-1, 3).T
    if _goes_back(time[np.lexsort((offset, chunk))]):
        for connection, index in indexes.items():
            reader.indexes[connection] = sorted(_Place(*entry) for entry in index)


class _Place(IndexData):
    """An entry of an index; comes before those behind it in the file."""

    def __lt__(self, other: tuple[int, ...]) -> bool:
        return self[1:] < other[1:]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Place) and self[1:] == other[1:]

    def __hash__(self) -> int:
        return hash(self[1:])


def _times_in(storage: Sqlite3Reader, topics: Collection[int]) -> IntArray:
    rows = _selected(storage, "timestamp", topics)
    return np.fromiter((time for (time,) in rows), np.int64)


def _rows_of(
    storage: Sqlite3Reader, connections: Collection[Connection], *_: object
) -> Iterator[tuple[Connection, int, bytes]]:
    """Yield the messages of a database as its `messages` does, of any time."""
    known = {connection.id: connection for connection in connections}
    for topic, time, data in _selected(storage, "topic_id, timestamp, data", known):
        yield known[topic], time, data


def _selected(storage: Sqlite3Reader, columns: str, topics: Collection[int]) -> Any:
    assert storage.dbconn is not None  # it is open
    marks = ",".join("?" * len(topics))
    query = f"SELECT {columns} FROM messages WHERE topic_id IN ({marks}) ORDER BY id"
    return storage.dbconn.execute(query, tuple(topics))


def _times_in_chunks(storage: McapReader, topics: Collection[int]) -> IntArray:
    """Return the times of the messages of some topics, in the order of the file."""
    of_file = sorted(storage.chunks, key=lambda chunk: chunk.chunk_start_offset)
    times = [_times_of_chunk(storage, chunk, topics) for chunk in of_file]
    return np.concatenate([np.empty(0, np.int64), *times])


def _times_of_chunk(storage: McapReader, chunk: ChunkInfo, topics: Collection[int]) -> IntArray:
    """Return what the index of a chunk says; none if there is no index, or a damaged one."""
    assert storage.bio is not None  # it is open
    entries = b""
    for number in topics:
        size = min(16 * chunk.channel_count.get(number, 0), chunk.message_index_length)
        if size:
            storage.bio.seek(chunk.message_index_offsets[number] + _INDEX_HEAD)
            entries += storage.bio.read(size)
    times, offsets = np.frombuffer(entries[: len(entries) // 16 * 16], "<i8").reshape(-1, 2).T
    if ((times < chunk.message_start_time) | (times > chunk.message_end_time)).any():
        return times[:0]
    return times[np.argsort(offsets, kind="stable")]
