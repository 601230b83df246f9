"""Limits of what a small bag can unpack to: its own library, rosbags, knows none.

A bag of 800 bytes can hold a chunk that unpacks to gigabytes, and the tables of one in SQLite can
compute what they contain. The libraries that are bounded here (apsw, bz2, lz4, zstd) are those that
rosbags itself reads with, so they come with it.
"""

from __future__ import annotations

import bz2
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO, Literal

import apsw
import lz4.frame  # type: ignore[import-untyped]
from rosbags.rosbag1 import reader as ros1
from rosbags.rosbag2 import reader as ros2
from rosbags.rosbag2 import storage_mcap as mcap

from hypermap.core.errors import FormatError

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

MOST_BYTES = 1 << 28  # of a chunk or message once it is unpacked, and of a value in a database
SMALL_FILE = 1 << 30  # bytes that a packed file of a bag may unpack to in any case
MOST_COMPRESSION = 1000  # unpacked size over packed size, for larger ones
_PIECE = 1 << 24  # bytes that are unpacked at a time
_MOST_STREAMS = 1000  # of a chunk; each beginning copies what is left
MOST_DEFINITION = 100_000  # characters of a connection's message definitions


def bound_unpacking() -> None:
    """Let rosbags unpack no chunk or message beyond `MOST_BYTES`, and no file that is a bomb."""
    ros1.decompressors["bz2"] = _bounded(bz2.BZ2Decompressor)
    ros1.decompressors["lz4"] = of_lz4 = _bounded(lz4.frame.LZ4FrameDecompressor)
    mcap.DECOMPRESSORS["lz4"] = lambda data, _: of_lz4(data)
    mcap.DECOMPRESSORS["zstd"] = lambda data, _: of_zstd(data)
    vars(ros2)["zstd"] = SimpleNamespace(decompress=of_zstd, open=_BoundedFile)


@contextmanager
def bounded_databases() -> Iterator[None]:
    """Let no value of a database opened within exceed `MOST_BYTES`: tables can compute them."""
    apsw.connection_hooks.append(_bound)
    try:
        yield
    finally:
        apsw.connection_hooks.remove(_bound)


def check_files(path: Path) -> None:
    """Make sure that a bag is of regular files: opening a pipe would wait for a writer.

    Raises:
        FormatError: If it is not.
    """
    for file in (path, *(path.iterdir() if path.is_dir() else ())):
        if file.exists() and not file.is_file() and not file.is_dir():
            raise FormatError(f"{file.name} is not a regular file")


def check_definition(text: str, topic: str) -> None:
    """Make sure that the definition of a message does not take minutes to read.

    Raises:
        FormatError: If it is too long.
    """
    if len(text) > MOST_DEFINITION:
        raise FormatError(
            f"the definition of its messages has {len(text)} characters, of which at most "
            f"{MOST_DEFINITION} are read",
            key=topic,
        )


def _bounded(decompressor: Callable[[], Any]) -> Callable[[bytes], bytes]:
    """Return what unpacks a chunk or message of one or several streams, unless it is too large."""

    def unpacked(data: bytes) -> bytes:
        pieces, size, streams = [], 0, 0
        while data:
            unpacking = decompressor()
            streams += 1
            if streams > _MOST_STREAMS:
                raise FormatError(f"a chunk is of more than {_MOST_STREAMS} streams")
            while not unpacking.eof:
                piece = unpacking.decompress(data, max_length=_PIECE)
                data = b""
                if not piece and not unpacking.eof and unpacking.needs_input:
                    raise FormatError("a chunk is cut off")
                pieces.append(piece)
                size += len(piece)
                if size > MOST_BYTES:
                    raise FormatError(f"a chunk unpacks to more than {MOST_BYTES >> 20} MB")
            data = unpacking.unused_data or b""
        return pieces[0] if len(pieces) == 1 else b"".join(pieces)

    return unpacked


of_zstd = _bounded(zstd.ZstdDecompressor)
"""Returns what a packed chunk or message of ROS 2 unpacks to, unless it is too large."""


class _BoundedFile(zstd.ZstdFile):
    """A packed file of a bag, which rosbags unpacks into a temporary folder."""

    def __init__(self, file: BinaryIO, mode: Literal["rb"]) -> None:
        super().__init__(file, mode)
        self._most = max(SMALL_FILE, MOST_COMPRESSION * os.fstat(file.fileno()).st_size)
        self._folder = tempfile.gettempdir()
        self._room = shutil.disk_usage(self._folder).free // 2  # the rest is for others

    def read(self, size: int | None = -1) -> bytes:
        piece: bytes = super().read(size)
        if self.tell() > self._most:
            raise FormatError(
                f"a file unpacks to more than {MOST_COMPRESSION} times its size, and more than "
                f"{SMALL_FILE >> 20} MB"
            )
        if self.tell() > self._room:
            raise FormatError(
                f"a file unpacks to more than half of the free space in {self._folder}, "
                f"{self._room >> 20} MB; let TMPDIR name a folder with more space"
            )
        return piece


def _bound(connection: apsw.Connection) -> None:
    connection.limit(apsw.SQLITE_LIMIT_LENGTH, MOST_BYTES)
