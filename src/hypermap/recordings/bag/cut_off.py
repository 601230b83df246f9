"""Readers of bags that end early: the robot lost its power, or a copy broke off.

A bag's index comes last, and rosbags reads no bag without it. Here, each format is read as far as
it goes, and a reader's `cut_off` says how far that is. What comes after the first damage is lost.
Of a bag that has its index, only the damaged chunks are lost.
"""

from __future__ import annotations

import heapq
import os
import shlex
from array import array
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Collection, Generator, Iterator, Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

import apsw
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection
from rosbags.rosbag1.reader import (
    Chunk,
    Header,
    IndexData,
    RecordType,
    read_bytes,
    read_uint32,
)
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader, Msg, msgsrc
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from hypermap.core.errors import HypermapError
from hypermap.recordings.messages.header import as_seconds
from hypermap.text import counted

_MAGIC = b"#ROSBAG V2.0\n"
_MCAP_HEAD = 9  # bytes before a record: opcode, length
_JOURNAL = bytes.fromhex("d9d505f920a163d7")  # of a change that is not finished
_MCAP_ENDS = (0x00, 0x02, 0x0F)  # opcodes: zeros that a file system left, the footer, data's end
_MCAP_DATA_END = b"\x0f\x04" + bytes(7)


def cut_off_in(reader: rosbag1.Reader | rosbag2.Reader, name: str) -> list[str]:
    """Return a sentence for each file of an open bag, with a name, that is read only in part."""
    storage = getattr(reader, "storage", reader)
    files = getattr(storage, "storages", [storage])
    names = [name] if len(files) == 1 else [Path(file.path).name for file in files]
    pairs = zip(names, files, strict=True)
    return [f"{name} {file.cut_off}" for name, file in pairs if file.cut_off]


class Ros1Reader(rosbag1.Reader):
    """Reads ROS 1 bags, also those without their index, such as `NAME.bag.active`.

    Each chunk is followed by an index of its own, which is read instead. A chunk that is not
    complete is left out. Source: the ROS wiki on version 2.0 of bags.
    """

    cut_off = ""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._damaged: set[int] = set()  # positions of chunks

    def open(self) -> None:
        """Open the bag, as far as it goes."""
        try:
            super().open()
            self._leave_out_damaged()
        except Exception:  # of many kinds
            self.bio = self.path.open("rb")
            try:
                self._open_cut_off()
            finally:
                if not self.cut_off:
                    self.close()
            if not self.cut_off:
                raise

    def read_chunk(self) -> Chunk:
        """Return the chunk here; if it is damaged, its index is looked for where it is not."""
        assert self.bio is not None
        try:
            return super().read_chunk()
        except Exception:  # of many kinds
            if not self.chunk_infos:
                raise
            return Chunk(0, self.bio.seek(0, os.SEEK_END), bytes)

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Add the entries of an index; of a bag with an index of chunks, note what is damaged."""
        try:
            super().read_index_data(pos, indexes)
        except Exception:  # of many kinds
            if not self.chunk_infos:
                raise
            self._damaged.add(pos)
            if len(self._damaged) == len(self.chunk_infos):
                raise

    def messages(
        self,
        connections: Collection[Connection] = (),
        start: int | None = None,
        stop: int | None = None,
    ) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Yield messages; for each topic in a damaged chunk, one without content."""
        while True:
            done: dict[int, int] = defaultdict(int)
            try:
                for connection, time, data in super().messages(connections, start, stop):
                    done[connection.id] += 1
                    yield connection, time, data
                return
            except (HypermapError, MemoryError):
                raise
            except Exception:  # of many kinds
                lefts = {c.id: self.indexes[c.id][done[c.id] :] for c in connections}
                damaged = min(left[0] for left in lefts.values() if left).chunk_pos
            for connection in connections:
                left = lefts[connection.id]
                kept = [entry for entry in left if entry.chunk_pos != damaged]
                self.indexes[connection.id] = kept
                if len(kept) < len(left):
                    lost = next(entry for entry in left if entry.chunk_pos == damaged)
                    yield connection, lost.time, b""

    def _leave_out_damaged(self) -> None:
        infos = [info for info in self.chunk_infos if info.pos in self._damaged]
        if not infos:
            return
        for index in self.indexes.values():
            index[:] = [entry for entry in index if entry.chunk_pos not in self._damaged]
        self._count()
        lost = sum(sum(info.connection_counts.values()) for info in infos)
        self.cut_off = (
            f"is damaged: {counted(lost, 'message')} in {len(infos)} of its "
            f"{counted(len(self.chunk_infos), 'chunk')} cannot be read"
        )

    def _count(self) -> None:
        self.connections = [
            connection._replace(msgcount=len(self.indexes[connection.id]))
            for connection in self.connections
        ]

    def _open_cut_off(self) -> None:
        assert self.bio is not None
        indexes: dict[int, list[IndexData]] = defaultdict(list)
        end, size, expected = 0, os.fstat(self.bio.fileno()).st_size, 0
        with suppress(Exception):  # the reading of what is incomplete fails in many ways
            self.bio.seek(len(_MAGIC))
            expected = Header.read(self.bio, RecordType.BAGHEADER).get_uint64("index_pos")
            self.bio.seek(read_uint32(self.bio), os.SEEK_CUR)
            while True:
                start = self.bio.tell()
                chunk = self.read_chunk()
                while self._next_is(RecordType.IDXDATA):
                    self.chunks[start] = chunk
                    self.read_index_data(start, indexes)
                    end = self.bio.tell()
        connections: dict[int, Connection] = {}
        for start in sorted(self.chunks, reverse=True):  # the last one may be damaged
            connections, entries, length = self._contents(start)
            if entries:
                end = min(end, self.chunks[start].datapos + length)
                for number in indexes.keys() | entries.keys():
                    before = [entry for entry in indexes[number] if entry.chunk_pos < start]
                    indexes[number] = before + entries[number]
                break
            end = start
            del self.chunks[start]
        for start in sorted(self.chunks):
            if not indexes.keys() <= connections.keys():
                connections = self._contents(start)[0] | connections
        self.indexes = {number: sorted(indexes[number]) for number in connections}
        self.connections = [connection for _, connection in sorted(connections.items())]
        self._count()
        times = [entry.time for index in self.indexes.values() for entry in index]
        self.cut_off = _told(len(times), times, unread=size - end, missing=expected - size)

    def _next_is(self, kind: RecordType) -> bool:
        """Whether another record is of a kind; the position stays before it."""
        assert self.bio is not None
        start = self.bio.tell()
        found = Header.read(self.bio).get_uint8("op")
        self.bio.seek(start)
        return found == kind

    def _contents(
        self, start: int
    ) -> tuple[dict[int, Connection], dict[int, list[IndexData]], int]:
        """Return the connections and messages in a chunk, and how many bytes can be read of it."""
        file, chunk, read = self.bio, self.chunks[start], 0
        connections: dict[int, Connection] = {}
        entries: dict[int, list[IndexData]] = defaultdict(list)
        assert file is not None
        with suppress(Exception):
            file.seek(chunk.datapos)
            content = chunk.decompressor(read_bytes(file, chunk.datasize))
            self.bio = BytesIO(content)
            while read < len(content):
                if self._next_is(RecordType.CONNECTION):
                    connection = self.read_connection()
                    connections[connection.id] = connection
                else:
                    header = Header.read(self.bio, RecordType.MSGDATA)
                    read_bytes(self.bio, read_uint32(self.bio))
                    entry = IndexData(header.get_time("time"), start, read)
                    entries[header.get_uint32("conn")].append(entry)
                read = self.bio.tell()
        self.bio = file
        return connections, entries, read


class _McapReader(McapReader):
    """Reads MCAP files, also those without their footer: what its records say up to the end.

    Source: the specification of MCAP, on records and chunks.
    """

    cut_off = ""

    def _open(self) -> None:
        try:
            super()._open()
            if not self._is_indexed():
                self._scan()
        except Exception:  # of many kinds
            if self.data_start:  # the header is that of ROS 2
                self._open_cut_off()
            if not self.cut_off:
                raise

    def _open_cut_off(self) -> None:
        assert self.bio is not None
        ends, size = array("q", [self.data_start]), self.bio.seek(0, os.SEEK_END)
        head = b""
        while ends[-1] < size:
            self.bio.seek(ends[-1])
            head = self.bio.read(_MCAP_HEAD)
            end = ends[-1] + _MCAP_HEAD + int.from_bytes(head[1:], "little")
            if head[0] in _MCAP_ENDS or end > size:
                break
            ends.append(end)
        self.data_end = ends[-1]
        is_whole = head == _MCAP_DATA_END
        try:
            self._scan()
        except Exception:  # that record is damaged, such as a chunk of zeros
            is_whole = False
            self.data_end = ends[max(bisect_left(ends, self.bio.tell()) - 1, 0)]
            self._scan()
        assert self.statistics is not None
        times = self.statistics.start_time, self.statistics.end_time
        count = self.statistics.message_count
        self.cut_off = _told(count, times, unread=size - self.data_end)
        if self.cut_off and is_whole:
            self.cut_off = f"is damaged, but only after its {counted(count, 'message')}"

    def messages(
        self,
        connections: Collection[Connection],
        start: int | None = None,
        stop: int | None = None,
    ) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Yield messages; for each topic in a damaged chunk, one without content."""
        if not self.chunks:
            yield from super().messages(connections, start, stop)
            return
        assert self.bio is not None  # it is open
        channels = {connection.id: connection for connection in connections}
        sources = []
        for chunk in self.chunks:
            first = chunk.message_start_time if start is None else start
            end = chunk.message_end_time + 1 if stop is None else stop
            is_in_time = first <= chunk.message_end_time and chunk.message_start_time < end
            if is_in_time and any(chunk.channel_count.get(number, 0) for number in channels):
                sources.append(_messages_of_chunk(chunk, channels, first, end, self.bio))
        for time, place, connection, data in heapq.merge(*sources):
            if place:  # the first item of a source only says when its chunk begins
                assert connection is not None
                assert data is not None
                yield connection, time, data

    def _is_indexed(self) -> bool:
        """Whether all types, topics and messages are in the index: recorders may leave out each."""
        found = self.statistics
        assert found is not None
        indexed: dict[int, int] = defaultdict(int)
        for chunk in self.chunks:
            for channel, count in chunk.channel_count.items():
                indexed[channel] += count
        return (
            len(self.schemas) >= max(found.schema_count, 1)
            and len(self.channels) >= found.channel_count
            and all(one.msgtype == self.channels[one.id].schema for one in self.connections)
            and indexed.keys() <= self.channels.keys()
            and sum(indexed.values()) == (found.message_count if self.chunks else 0)
        )

    def _scan(self) -> None:
        self.schemas.clear()
        self.channels.clear()
        self.chunks.clear()
        self.connections.clear()
        self.meta_scan()
        assert self.statistics is not None
        counts = self.statistics.channel_message_counts
        self.connections = [c._replace(msgcount=counts.get(c.id, 0)) for c in self.connections]


def _messages_of_chunk(
    chunk: ChunkInfo, channels: dict[int, Connection], start: int, stop: int, file: BinaryIO
) -> Iterator[Msg]:
    """Yield the messages of a chunk; for each topic in a damaged one, one without content."""
    try:
        yield from msgsrc(chunk, channels, start, stop, file)
    except (HypermapError, MemoryError):
        raise
    except Exception:  # of many kinds
        for number in channels.keys() & chunk.channel_count.keys():
            time, place = chunk.message_start_time, chunk.chunk_start_offset
            yield Msg(time, place, channels[number], b"")


class SqliteReader(Sqlite3Reader):
    """Reads databases of messages, also those that lack pages at their end.

    A B-tree is written from left to right while a bag is recorded, so the rows in the order of
    their ids can be read up to a page that is missing.
    """

    cut_off = ""
    lacks_rows = False

    def open(self) -> None:
        """Open the database, as far as it goes."""
        path = Path(str(self.path))
        missing = _missing_bytes(path)
        try:
            if missing > 0:  # SQLite would not notice that the last page is there in part
                raise rosbag2.ReaderError(f"{_size(missing)} of the file are missing")
            self._open_by_uri()
        except rosbag2.ReaderError:
            apsw.connection_hooks.append(_leave_out_missing_rows)
            try:
                with suppress(Exception):  # the first error says more
                    self._open_by_uri()
                    found = self.metadata
                    times = found.start_time, found.end_time - 1
                    self.cut_off = _told(found.message_count, times, 0, missing)
            finally:
                apsw.connection_hooks.remove(_leave_out_missing_rows)
            self.lacks_rows = bool(self.cut_off)
            if not self.lacks_rows:
                raise
        if log := log_of(path):
            self.cut_off = "; ".join(filter(None, (self.cut_off, log)))

    def _open_by_uri(self) -> None:
        """Open the database; rosbags makes a URI of its path, but would not quote it."""
        path = self.path
        self.path = Path(quote(os.fsencode(str(path)), safe="/\\:"))
        try:
            super().open()
        finally:
            self.path = path


def _missing_bytes(path: Path) -> int:
    """Return by how much a database is shorter than its header says. Source: SQLite's format."""
    with path.open("rb") as file:
        head, size = file.read(32), os.fstat(file.fileno()).st_size
    page, pages = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
    return pages * (1 << 16 if page == 1 else page) - size if head.startswith(b"SQLite") else 0


def _leave_out_missing_rows(connection: apsw.Connection) -> None:
    """Let a database that lacks pages seem to have only the messages before these."""
    connection.pragma(
        "writable_schema", True
    )  # else a file shorter than its header says is refused
    rows, bound = "FROM main.messages NOT INDEXED", -1
    with suppress(apsw.Error):
        for (id_,) in connection.execute(f"SELECT id {rows} ORDER BY id"):
            if id_ <= bound:  # of a page of zeros
                break
            bound = id_
    # The last page may be there in part, the rest being zeros, and SQLite looks at the row behind
    # the last one, too: what could be on one page is left out. A large message has pages of its
    # own, so it may lack some although a smaller one behind it does not.
    page, size_behind = connection.pragma("page_size"), 0
    before = f"SELECT id, length(data) {rows} WHERE id < ? ORDER BY id DESC"
    for id_, size in connection.execute(before, (bound,)):
        if not _is_readable(connection, f"SELECT data {rows} WHERE id = ?", id_):
            bound, size_behind = id_, page
            continue
        if size_behind > 2 * page:
            break
        bound = id_ if size_behind < page else bound
        size_behind += size
    view = f"SELECT id, topic_id, timestamp, data {rows} WHERE id < {bound:d}"
    connection.execute(f"CREATE TEMP VIEW messages AS {view}")


def _is_readable(connection: apsw.Connection, query: str, id_: int) -> bool:
    try:
        return all(data is not None for (data,) in connection.execute(query, (id_,)))
    except apsw.Error:
        return False


class _FolderReader(DirectoryReader):
    """Reads the folder of a ROS 2 bag."""

    STORAGE_PLUGINS: Mapping[str, type[Any]] = {"mcap": _McapReader, "sqlite3": SqliteReader}

    def open(self) -> None:
        """Open the files; the counts of `metadata.yaml` are those of whole files."""
        super().open()
        files: list[Any] = self.storages
        if any(file.cut_off for file in files):
            counts: dict[str, int] = defaultdict(int)
            for connection in (connection for file in files for connection in file.connections):
                counts[connection.topic] += connection.msgcount
            self.connections = [c._replace(msgcount=counts[c.topic]) for c in self.connections]


class Ros2Reader(rosbag2.Reader):
    """Reads a ROS 2 bag: a folder, or one of its files."""

    STORAGE_PLUGINS: Mapping[str, type[Any]] = {
        "dir": _FolderReader,
        ".mcap": _McapReader,
        ".db3": SqliteReader,
    }


def log_of(path: Path) -> str:
    """Return what is to be said of a database beside which SQLite has left a log; "" if it has not.

    Such is the case where a recording with `--storage-preset-profile resilient` was cut off.
    Source: SQLite's format, on the rollback journal and the write-ahead log.
    """
    remedy = f"`sqlite3 {shlex.quote(str(path))} 'SELECT count(*) FROM topics'`"
    wal, journal = Path(f"{path}-wal"), Path(f"{path}-journal")
    if wal.is_file() and wal.stat().st_size:
        return f"does not contain its newest messages, which are in {wal.name}: {remedy} adds them"
    if journal.is_file():
        with journal.open("rb") as file:
            is_open = file.read(len(_JOURNAL)) == _JOURNAL
        if is_open:
            return (
                "may be damaged, because its last change was cut off: "
                f"{remedy} undoes this change by {journal.name}"
            )
    return ""


def _told(count: int, times: Collection[int], unread: int, missing: int = 0) -> str:
    """Return what is read of a file, and how much is not; "" if nothing is read.

    Args:
        count: number of messages that are read.
        times: their times of recording [ns], or the first and last ones.
        unread: bytes at the end of the file that are not read.
        missing: bytes by which the file should be longer, where that is known.
    """
    if not count:
        return ""
    lost = [f"its last {_size(unread)} are damaged or unfinished"] if unread > 0 else []
    lost += [f"{_size(missing)} are missing"] if missing > 0 else []
    return (
        f"ends early, as when a recording or a copy is cut off: {counted(count, 'message')} over "
        f"{as_seconds(max(times) - min(times)):.1f} s are read"
        + f"; {', and '.join(lost)}"
        * bool(lost)
    )


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 50_000 else f"{count} bytes"
