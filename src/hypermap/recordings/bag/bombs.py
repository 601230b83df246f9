"""Limits of what a small bag can unpack to: its own library, rosbags, knows none.

A bag of 800 bytes can hold a chunk that unpacks to gigabytes, and the tables of one in SQLite can
compute what they contain.
"""

from __future__ import annotations

import bz2
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import apsw
import lz4.frame  # type: ignore[import-untyped]
from rosbags.rosbag1 import reader as ros1
from rosbags.rosbag2 import storage_mcap as mcap

from hypermap.core.errors import FormatError

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

MOST_BYTES = 1 << 28  # of a chunk once it is unpacked, and of a value in a database
MOST_DEFINITION = 100_000  # characters of a connection's message definitions


def bound_chunks() -> None:
    """Let rosbags unpack no chunk that exceeds `MOST_BYTES`."""
    ros1.decompressors["bz2"] = _bounded(bz2.BZ2Decompressor)
    ros1.decompressors["lz4"] = _bounded(lz4.frame.LZ4FrameDecompressor)
    of_lz4, of_zstd = ros1.decompressors["lz4"], _bounded(zstd.ZstdDecompressor)
    mcap.DECOMPRESSORS["lz4"] = lambda data, _: of_lz4(data)
    mcap.DECOMPRESSORS["zstd"] = lambda data, _: of_zstd(data)


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
    """Return what unpacks a chunk, and refuses one that is too large."""

    def unpacked(data: bytes) -> bytes:
        unpacking = decompressor()
        content: bytes = unpacking.decompress(data, max_length=MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise FormatError(f"a chunk unpacks to more than {MOST_BYTES >> 20} MB")
        if not unpacking.eof:
            raise FormatError("a chunk is cut off")
        return content

    return unpacked


def _bound(connection: apsw.Connection) -> None:
    connection.limit(apsw.SQLITE_LIMIT_LENGTH, MOST_BYTES)
