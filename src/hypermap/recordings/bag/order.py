"""The order of the messages in a ROS 1 bag whose clock went back while it was recorded."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain

import numpy as np
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import IndexData

_BACK = 1_000_000_000  # [ns] by which times go back where a clock was set, or time began again


def read_as_written(reader: Reader, wanted: Iterable[Connection]) -> None:
    """Let a reader yield messages in the order in which they lie in the file, if times go back.

    A reader merges its indexes, and takes the least entry first: of time, or now of place.

    Args:
        reader: open.
        wanted: what is read.
    """
    indexes = {connection.id: reader.indexes[connection.id] for connection in wanted}
    numbers = chain.from_iterable(chain.from_iterable(indexes.values()))
    time, chunk, offset = np.fromiter(numbers, np.int64).reshape(-1, 3).T
    if (np.diff(time[np.lexsort((offset, chunk))]) > -_BACK).all():
        return
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
