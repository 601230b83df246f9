"""ROS 1 messages written from arrays, and read into arrays.

The code that genpy generates writes and reads lists item by item: seconds for a map of millions of
cells. A class from here has the same bytes, but takes whole arrays where the message has lists.
Nothing of ROS is imported: the classes are handed in.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any, BinaryIO

import numpy as np

_NUMBERS = {
    "bool": "?",
    "int8": "<i1",
    "uint8": "<u1",
    "int16": "<i2",
    "uint16": "<u2",
    "int32": "<i4",
    "uint32": "<u4",
    "int64": "<i8",
    "uint64": "<u8",
    "float32": "<f4",
    "float64": "<f8",
}
_ROWS = {"geometry_msgs/Point": ("<f8", 3), "std_msgs/ColorRGBA": ("<f4", 4)}
_COUNT = struct.Struct("<I")
_TIMES = {"time": struct.Struct("<II"), "duration": struct.Struct("<ii")}


@dataclass(frozen=True)
class WrittenList:
    """A list of messages that are written already; stands for the list in a field."""

    count: int
    content: bytes

    def __len__(self) -> int:
        return self.count


def takes_arrays(message_class: Any) -> bool:
    """Return whether a class is of ROS 1, so that `writing_arrays` makes another of it."""
    return hasattr(message_class, "_slot_types")


def writing_arrays(message_class: Any) -> type[Any]:
    """Return a class of ROS 1 messages whose fields may hold arrays; another class as it is.

    An array of numbers stands for a list of numbers, one of shape (M, 2) or (M, 3) for a list of
    `geometry_msgs/Point`, one of shape (M, 4) for a list of `std_msgs/ColorRGBA`, and any iterable
    of texts for a list of strings. Such a message is for sending; who wants to read its fields
    reads arrays.
    """
    if not takes_arrays(message_class):
        return message_class  # type: ignore[no-any-return]
    return _subclass(message_class)


@cache
def _subclass(message_class: Any) -> type[Any]:
    return type(message_class.__name__, (message_class,), {"serialize": _serialize})


def reading_arrays(message_class: Any) -> type[Any]:
    """Return a class of ROS 1 messages whose `int8[]`, the cells of grids, is read as an array.

    A class without such a field is returned as it is. Lists of other numbers become arrays too.
    """
    if "int8[]" not in message_class._slot_types:
        return message_class  # type: ignore[no-any-return]
    return _reading_subclass(message_class)


@cache
def _reading_subclass(message_class: Any) -> type[Any]:
    def deserialize(message: Any, content: bytes) -> Any:
        return message.deserialize_numpy(content, np)  # genpy generates it for this

    return type(message_class.__name__, (message_class,), {"deserialize": deserialize})


def _serialize(message: Any, buff: BinaryIO) -> None:
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        value = getattr(message, name)
        if kind.endswith("[]"):
            _write_list(buff, kind[:-2], value)
        elif kind == "string":
            buff.write(text(value))
        elif kind in _TIMES:
            buff.write(_TIMES[kind].pack(value.secs, value.nsecs))
        elif kind in _NUMBERS:
            buff.write(np.array(value, dtype=_NUMBERS[kind]).tobytes())
        else:
            value.serialize(buff)


def _write_list(buff: BinaryIO, kind: str, values: Any) -> None:
    buff.write(_COUNT.pack(len(values)))
    if isinstance(values, WrittenList):
        buff.write(values.content)
    elif kind in _NUMBERS:
        buff.write(np.asarray(values, dtype=_NUMBERS[kind]).tobytes())
    elif kind == "string":
        buff.write(texts(values))
    elif kind in _ROWS and isinstance(values, np.ndarray):
        dtype, width = _ROWS[kind]
        rows = np.zeros((len(values), width), dtype=dtype)
        rows[:, : values.shape[1]] = values
        buff.write(rows.tobytes())
    else:
        for value in values:
            value.serialize(buff)


def texts(items: Iterable[str]) -> bytes:
    """Return many texts as ROS 1 sends them; each different one is encoded once."""
    every = items.tolist() if isinstance(items, np.ndarray) else list(items)
    known = {item: text(item) for item in set(every)}
    return b"".join(map(known.__getitem__, every))


def text(item: str) -> bytes:
    """Return a text as ROS 1 sends it."""
    encoded = item.encode()
    return _COUNT.pack(len(encoded)) + encoded
