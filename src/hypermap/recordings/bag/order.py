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
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from hypermap.core.arrays import IntArray

_BACK = 1_000_000_000  # [ns] by which times go back where a clock was set, or time began again


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
    for storage in getattr(reader.storage, "storages", [reader.storage]):
        numbers = [c.id for c in storage.connections if c.topic in names]
        if isinstance(storage, Sqlite3Reader) and _goes_back(_times_in(storage, numbers)):
            vars(storage)["messages"] = partial(_rows_of, storage)
        elif isinstance(storage, McapReader) and _goes_back(_times_of_chunks(storage, numbers)):
            vars(storage)["messages"] = storage.messages_scan


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


def _times_of_chunks(storage: McapReader, topics: Collection[int]) -> IntArray:
    """Return when chunks begin and end that have messages of some topics."""
    of_file = sorted(storage.chunks, key=lambda chunk: chunk.chunk_start_offset)
    times = [
        (chunk.message_start_time, chunk.message_end_time)
        for chunk in of_file
        if any(chunk.channel_count.get(number) for number in topics)
    ]
    return np.array(times, np.int64).ravel()
