"""Zip archives: reads the members into a store in memory, and writes a store."""

from __future__ import annotations

import io
import os
import shutil
import stat
import struct
import zipfile
import zlib
from collections.abc import Container, Mapping
from pathlib import Path
from typing import BinaryIO

from hypermap.core.errors import FormatError, HypermapError
from hypermap.formats import limits
from hypermap.formats.atomic import Before, nothing_before, write_file
from hypermap.formats.store import MemoryStore, open_file, safe_name

EXPENDABLE = "history."
"""How the names of files begin without which a map opens, if they are damaged."""

_NO_TIME = (1980, 1, 1, 0, 0, 0)  # the zip format's zero
_ENCRYPTED = 0x1
_LEVEL, _FAST_LEVEL = 6, 1  # large files: a third of the time, an eighth more
_COMPRESSED_ALREADY = (b"\x89PNG", b"\xff\xd8\xff", b"PAR1")
_PIECE = 1 << 20  # bytes
_END_OF_DIRECTORY = b"PK\x05\x06"
_ZIP64_LOCATOR, _ZIP64_END = b"PK\x06\x07", b"PK\x06\x06"
_LONGEST_END = 56 + 20 + 22 + 0xFFFF  # bytes, with ZIP64's and a comment


def read_archive(path: str | Path) -> MemoryStore:
    """Return the files of a zip archive.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is not an intact zip archive, exceeds the limits, or has a name that
            leads out of it.
    """
    path = Path(path)
    with open_file(path, limits.MAX_ARCHIVE_BYTES) as file:
        return _files_in(file, path)


def _files_in(file: BinaryIO, path: Path) -> MemoryStore:
    store = MemoryStore(where=str(path), folder=path.absolute().parent)
    try:
        start = file.read(2)
        if start != b"PK":
            raise FormatError("is not a zip archive" if start else "is empty")
        _check_member_count(file)
        with zipfile.ZipFile(file) as archive:
            members = [info for info in archive.infolist() if not info.filename.endswith("/")]
            _check_members(members)
            for info in members:
                name = safe_name(info.filename)
                try:
                    store.files[name] = _unpacked(archive, info)
                except _BROKEN as error:
                    if not name.startswith(EXPENDABLE):
                        raise
                    store.damaged[name] = str(error) or type(error).__name__
            return store
    except FormatError as error:
        raise FormatError(str(error), path=path) from error
    except _BROKEN as error:
        reason = str(error) or type(error).__name__
        raise FormatError(f"is not an intact zip archive: {reason}", path=path) from error


def packed_archive(files: Mapping[str, bytes], path: str | Path) -> bytes:
    """Return a zip archive; the same files give the same bytes each time.

    Raises:
        HypermapError: If it would be too large to read again; the message names the path.
    """
    total = sum(map(len, files.values()))
    largest = max(map(len, files.values()), default=0)
    if total > limits.MAX_ARCHIVE_BYTES or largest > limits.MAX_FILE_BYTES:
        raise HypermapError(
            f"{path}: the map is too large to be saved: {total} bytes, {largest} in one file"
        )
    stored = {name for name, content in files.items() if content.startswith(_COMPRESSED_ALREADY)}
    packed, members = _pack(files, stored)
    bombs = {info.filename for info in members if _is_bomb(info)}
    if bombs:  # reading would take them for bombs
        packed, _ = _pack(files, stored | bombs)
    return packed


def write_archive(
    path: str | Path, files: Mapping[str, bytes], before: Before = nothing_before
) -> None:
    """Write a zip archive, as `packed_archive` returns it.

    Raises:
        FileMissing: If the folder does not exist.
        HypermapError: If it cannot be written or would be too large to read again; the old
            file then remains.
    """
    write_file(path, packed_archive(files, path), before)


# Errors of zipfile and zlib for damaged archives, found by experiment
_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    NotImplementedError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
)


def _check_member_count(file: BinaryIO) -> None:
    """Check the size of the directory before zipfile creates an object for each entry."""
    file.seek(max(0, file.seek(0, os.SEEK_END) - _LONGEST_END))
    packed = file.read()
    end = packed.rfind(_END_OF_DIRECTORY)
    if end < 0 or len(packed) < end + 22:
        raise zipfile.BadZipFile("its end is missing")
    count, size = struct.unpack_from("<HI", packed, end + 10)
    locator, record = end - 20, end - 20 - 56
    if packed[max(locator, 0) :].startswith(_ZIP64_LOCATOR):  # whose numbers count then
        if record < 0 or not packed[record:].startswith(_ZIP64_END):
            raise zipfile.BadZipFile("its end is damaged")
        count, size = struct.unpack_from("<QQ", packed, record + 32)
    if count > limits.MAX_MEMBERS or size > limits.MAX_MEMBERS * 512:
        raise FormatError(f"has more than {limits.MAX_MEMBERS} members")


def _check_members(members: list[zipfile.ZipInfo]) -> None:
    """Refuse members that are encrypted, ambiguous, compressed unusually, or too large."""
    if len(members) > limits.MAX_MEMBERS:
        raise FormatError(f"has more than {limits.MAX_MEMBERS} members")
    seen: set[str] = set()
    for info in members:
        name = safe_name(info.filename)
        if name in seen:
            raise FormatError("appears twice", key=name)
        seen.add(name)
        if info.flag_bits & _ENCRYPTED:
            raise FormatError("is encrypted", key=name)
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise FormatError("is packed by another method than deflate", key=name)
        if info.file_size > limits.MAX_FILE_BYTES:
            raise FormatError(
                f"unpacks to {info.file_size} bytes, more than the {limits.MAX_FILE_BYTES} "
                "that are allowed",
                key=name,
            )
        if _is_bomb(info):
            raise FormatError(
                f"unpacks to more than {limits.MAX_COMPRESSION} times its size", key=name
            )
    total = sum(info.file_size for info in members)
    if total > limits.MAX_ARCHIVE_BYTES:
        raise FormatError(
            f"unpacks to {total} bytes, more than the {limits.MAX_ARCHIVE_BYTES} that are allowed"
        )


def _unpacked(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    """Return a member's content, read in pieces: `ZipFile.read` would hold it twice."""
    content = io.BytesIO()
    with archive.open(info) as member:
        shutil.copyfileobj(member, content, _PIECE)
    return content.getvalue()


def _pack(
    files: Mapping[str, bytes], stored: Container[str]
) -> tuple[bytes, list[zipfile.ZipInfo]]:
    """Return a zip archive and its members; those named in `stored` are not compressed."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name, _NO_TIME)
            info.create_system = 3  # Unix, wherever this runs
            info.external_attr = (stat.S_IFREG | 0o644) << 16
            method = zipfile.ZIP_STORED if name in stored else zipfile.ZIP_DEFLATED
            level = _LEVEL if len(content) <= limits.SMALL_FILE_BYTES else _FAST_LEVEL
            archive.writestr(info, content, method, level)
        members = archive.infolist()
    return packed.getvalue(), members


def _is_bomb(info: zipfile.ZipInfo) -> bool:
    """Return whether a member is so large unpacked that reading refuses it."""
    return (
        info.file_size > limits.SMALL_FILE_BYTES
        and info.file_size > limits.MAX_COMPRESSION * info.compress_size
    )
