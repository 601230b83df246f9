"""A bag of any version as a list of topics and a stream of messages."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hypermap.core.errors import FormatError, HypermapError
from hypermap.formats.store import refuse_pointer
from hypermap.recordings.bag.bombs import (
    bound_unpacking,
    bounded_databases,
    check_definition,
    check_files,
    of_zstd,
)
from hypermap.recordings.bag.cut_off import Ros1Reader, Ros2Reader, cut_off_in, log_of
from hypermap.recordings.bag.definitions import DETECTION_TYPES, known_types
from hypermap.recordings.bag.order import read_as_written, read_without_index
from hypermap.recordings.bag.parts import is_ros1_bag, parts_of

_MOST_METADATA = 1_000_000  # bytes, which take half a second
_REPAIR = {
    ".bag": "rosbag reindex",
    ".active": "rosbag reindex",
    ".mcap": "mcap recover",
    ".db3": "ros2 bag reindex",
}
_ZSTD = b"\x28\xb5\x2f\xfd"  # begins no message
_BEGINNINGS = {
    ".bag": b"#ROSBAG V",
    ".active": b"#ROSBAG V",
    ".mcap": b"\x89MCAP0\r\n",
    ".db3": b"SQLite format 3\0",
}


bound_unpacking()


class DamagedMessage(FormatError):
    """A message cannot be decoded, while others may be."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: as recorded.
        type: its message type in ROS 2 spelling, such as `sensor_msgs/msg/Image`.
        count: number of messages.
    """

    name: str
    type: str
    count: int


class _Unreadable(FormatError):
    """Nothing can be read of a bag."""


@dataclass(frozen=True)
class _Contents:
    """The files of a bag that can be read, their topics, and a sentence for each loss."""

    parts: list[Path]
    topics: list[Topic]
    cut_off: list[str]


class BagFile:
    """A ROS 1 bag, a ROS 2 bag's folder, one of its files, or a folder of a bag's parts.

    A file is open only while something is read from it; parts are read one after the other.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stores: dict[tuple[str, str], Typestore] = {}

    @property
    def format(self) -> str:
        """The kind of bag."""
        is_ros1 = is_ros1_bag(self.path) or any(self.path.glob("*.bag"))
        return "ROS 1 bag" if is_ros1 else "ROS 2 bag"

    @property
    def topics(self) -> list[Topic]:
        """All topics, by name.

        Raises:
            FormatError: If the bag cannot be read.
        """
        return self._contents.topics

    @property
    def cut_off(self) -> list[str]:
        """A sentence for each file that ends early, or is read only in part or not at all.

        Raises:
            FormatError: If the bag cannot be read.
        """
        return self._contents.cut_off

    def messages(
        self,
        names: Collection[str],
        on_damaged: Callable[[int, DamagedMessage], None] | None = None,
        *,
        as_written: bool = False,
    ) -> Iterator[tuple[str, int, Any]]:
        """Yield topic, time of recording [ns] and message, in the order of these times.

        Args:
            names: of the topics.
            on_damaged: called for each damaged message, with its time of recording [ns]; then the
                message is skipped.
            as_written: whether a bag whose times of recording go back, as of a simulation that
                began again, is read in the order in which it was written.

        Raises:
            FormatError: If the bag cannot be read, or, without `on_damaged`, a message.
        """
        for part in self._contents.parts:
            with _open(part) as reader:
                wanted = [c for c in reader.connections if c.topic in names]
                if not wanted:
                    continue
                read_without_index(reader)
                if as_written:
                    read_as_written(reader, wanted)
                for connection, log_time, data in reader.messages(wanted):
                    try:
                        message = self._decode(part, connection, data)
                    except DamagedMessage as error:
                        if on_damaged is None:
                            raise
                        on_damaged(log_time, error)
                        continue
                    yield connection.topic, log_time, message

    @cached_property
    def _contents(self) -> _Contents:
        parts = parts_of(self.path)
        counts: dict[tuple[str, str], int] = {}
        if len(parts) == 1:
            cut_off = _counted_in(parts[0], "the bag", counts)
        else:
            cut_off = [note for part in parts[:-1] for note in _counted_in(part, part.name, counts)]
            try:
                cut_off += _counted_in(parts[-1], parts[-1].name, counts)
            except _Unreadable as error:  # cut off before anything was written to it
                last = parts.pop()
                cut_off.append(f"{last.name} is left out: {str(error).removeprefix(f'{last}: ')}")
        topics = [Topic(name, kind, counts[name, kind]) for name, kind in sorted(counts)]
        return _Contents(parts, topics, cut_off)

    def _decode(self, part: Path, connection: Connection, data: bytes) -> Any:
        if not data:
            raise DamagedMessage("a chunk of the bag is damaged", key=connection.topic)
        key = connection.msgtype, connection.msgdef.data
        if key not in self._stores:
            self._stores[key] = _types_of(connection)
        try:
            if is_ros1_bag(part):
                return self._stores[key].deserialize_ros1(data, connection.msgtype)
            if data[:4] == _ZSTD:  # only the metadata, which may be lost, says that it is packed
                data = of_zstd(data)
            return self._stores[key].deserialize_cdr(data, connection.msgtype)
        except KeyError:
            raise FormatError(
                f"the bag does not define the type {connection.msgtype}", key=connection.topic
            ) from None
        except Exception as error:
            raise DamagedMessage(f"a message is damaged: {error}", key=connection.topic) from None


def _counted_in(part: Path, name: str, counts: dict[tuple[str, str], int]) -> list[str]:
    """Add the messages of each topic and type of a file; return what `cut_off_in` does."""
    with _open(part) as reader:
        for connection in reader.connections:
            key = connection.topic, connection.msgtype
            if not all(isinstance(text, str) for text in key):  # NULL in SQLite
                raise FormatError("has a topic without a name or a type")
            counts[key] = counts.get(key, 0) + connection.msgcount
        return cut_off_in(reader, name)


@contextmanager
def _open(path: Path) -> Iterator[rosbag1.Reader | rosbag2.Reader]:
    """Yield an open reader; attribute any error inside to the bag."""
    reader: rosbag1.Reader | rosbag2.Reader
    try:
        check_files(path)
        if path.is_file():
            path.open("rb").close()  # rosbags does not say whether it may be read
        _check_metadata(path / "metadata.yaml")
        reader = Ros1Reader(path) if is_ros1_bag(path) else Ros2Reader(path)
        with bounded_databases():
            reader.open()
        try:
            yield reader
        finally:
            reader.close()
    except HypermapError as error:
        raise FormatError(str(error), path=path) from None
    except PermissionError as error:
        raise FormatError(f"the bag cannot be read ({error.strerror})", path=path) from None
    except Exception as error:
        # rosbags reports damage by errors of many kinds: its own, struct's, zlib's, SQLite's.
        for file in (path, *sorted(path.glob("*"))):
            refuse_pointer(file)
        repair = _REPAIR.get(path.suffix, "ros2 bag reindex")
        detail = str(error) or type(error).__name__
        if "Profile is not ros2" in detail:
            raise FormatError("only MCAP files of ROS 2 can be read", path=path) from error
        if _is_of_another_kind(path):
            raise FormatError(
                f"is not a bag of this kind: its first bytes are not those of {path.suffix} files",
                path=path,
            ) from error
        if log := log_of(path):
            raise _Unreadable(f"the bag cannot be read ({detail}); it {log}", path=path) from error
        raise _Unreadable(
            f"the bag cannot be read ({detail}); if its recording was cut off, "
            f"`{repair}` may repair it",
            path=path,
        ) from error


def _check_metadata(file: Path) -> None:
    """Refuse a description of a bag that takes minutes to read, as it is read at each opening."""
    if file.is_file() and (size := file.stat().st_size) > _MOST_METADATA:
        raise FormatError(
            f"metadata.yaml has {size / 1e6:.1f} MB, of which at most {_MOST_METADATA / 1e6:g} are "
            "read; `ros2 bag reindex` writes it anew"
        )


def _is_of_another_kind(path: Path) -> bool:
    """Whether a file begins like none of its name; a recording that was cut off may leave zeros."""
    if not path.is_file():
        return False
    expected = _BEGINNINGS.get(path.suffix, b"")
    with path.open("rb") as file:
        found = file.read(len(expected))
    return any(found) and not expected.startswith(found)


def _types_of(connection: Connection) -> Typestore:
    """Return the types that a connection's messages need, its own definitions first.

    Each connection has its own store: bags may define a type in two ways.

    Raises:
        FormatError: If a type of ROS lacks a field there.
    """
    text = connection.msgdef.data
    if connection.msgdef.format == MessageDefinitionFormat.NONE:
        return known_types()
    check_definition(text, connection.topic)
    store = get_typestore(Stores.EMPTY)
    if connection.msgdef.format == MessageDefinitionFormat.MSG:
        store.register(get_types_from_msg(text, connection.msgtype))
    else:
        # Several definitions follow each other, each after a line "IDL: name".
        separator = "=" * 80 + "\nIDL: "
        for part in text.split(separator) if text.startswith(separator) else [text]:
            idl = part.partition("\n")[2] if text.startswith(separator) else part
            if idl.strip():
                store.register(get_types_from_idl(idl))
    of_ros = known_types().fielddefs
    for name in store.fielddefs.keys() & (of_ros.keys() - DETECTION_TYPES.keys()):
        here, there = (
            {_spelled(field) for field, _ in f[name][1]} for f in (store.fielddefs, of_ros)
        )
        if missing := there - here:
            raise FormatError(
                f"in the bag's definitions, a {name} has no {min(missing)}; it does in ROS",
                key=connection.topic,
            )
    return store


def _spelled(field: str) -> str:
    """Return a field's name as in ROS 2; camera info spells D, K, R and P like this in ROS 1."""
    return field.lower() if field in ("D", "K", "R", "P") else field
