"""A disk that fails below SQLite: at its n-th read, write, sync, truncation or removal.

SQLite reaches files through a table of C functions, its VFS. Those of the library that Python's
sqlite3 uses are replaced in this process, by functions that count and then do what they replace.

Source: sqlite.org/vfs.html and sqlite3.h; SQLite's own tests of I/O errors do the same.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sqlite3
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, c_int, c_int64, c_void_p
from pathlib import Path
from typing import Any, Literal

DiskFault = Literal["once", "for good", "kill"]

# Names, types of the arguments, and the code of an error (0 for what does not fail).
_FILE = c_void_p
_OF_FILES: dict[str, tuple[tuple[Any, ...], int]] = {
    "xClose": ((_FILE,), 0),
    "xRead": ((_FILE, c_void_p, c_int, c_int64), 10 | 1 << 8),
    "xWrite": ((_FILE, c_void_p, c_int, c_int64), 10 | 3 << 8),
    "xTruncate": ((_FILE, c_int64), 10 | 6 << 8),
    "xSync": ((_FILE, c_int), 10 | 4 << 8),
}
# Names are pointers here: SQLite keeps the one that it gives.
_OPEN = (c_void_p, c_void_p, _FILE, c_int, c_void_p)
_DELETE = (c_void_p, c_void_p, c_int)
_CANNOT_OPEN, _CANNOT_DELETE = 14, 10 | 10 << 8
_METHODS = 19  # functions of a file, in the newest version

_LIBRARY = "libsqlite3.so.0"


def is_reachable() -> bool:
    """Return whether Python's sqlite3 uses the system's library; some have one built in."""
    sqlite3.connect(":memory:").close()  # so that it is loaded
    maps = Path("/proc/self/maps")
    return maps.exists() and f"/{_LIBRARY}" in maps.read_text(encoding="utf-8")


class _Methods(ctypes.Structure):
    """sqlite3_io_methods."""

    _fields_ = (("version", c_int), ("functions", c_void_p * _METHODS))


class _Vfs(ctypes.Structure):
    """sqlite3_vfs, as far as it is needed."""

    _fields_ = (
        ("version", c_int),
        ("file_size", c_int),
        ("longest_path", c_int),
        ("next", c_void_p),
        ("name", c_void_p),
        ("data", c_void_p),
        ("xOpen", c_void_p),
        ("xDelete", c_void_p),
    )


class FailingDisk:
    """Counts what SQLite does with files, and lets one of the operations be the fault.

    Nothing is heard unless the library `is_reachable`. It holds for all files of SQLite in this
    process, for ever: make it in a process of its own.

    Attributes:
        count: of the operations so far.

    Args:
        at: number of the operation, from 0; None for none of them.
        fault: what happens there: it fails, it and all later ones do, or the process is killed.
    """

    def __init__(self, at: int | None = None, fault: DiskFault = "once") -> None:
        self.count = 0
        self._at, self._fault = at, fault
        self._kept: list[Any] = []  # what C refers to
        self._tables: dict[int, _Methods] = {}  # by the address of those that they replace
        library = ctypes.CDLL(_LIBRARY)
        library.sqlite3_vfs_find.restype = POINTER(_Vfs)
        vfs = library.sqlite3_vfs_find(None).contents
        opened = CFUNCTYPE(c_int, *_OPEN)(vfs.xOpen)

        def open_file(*arguments: Any) -> int:
            code = _CANNOT_OPEN if self._fails() else opened(*arguments)
            if code == 0:
                self._watch(arguments[2])
            return int(code)

        vfs.xOpen = self._pointer(open_file, _OPEN)
        vfs.xDelete = self._watched(vfs.xDelete, _DELETE, _CANNOT_DELETE)

    def _watch(self, file: int) -> None:
        """Put our functions in place of those of an open file."""
        methods = ctypes.cast(file, POINTER(c_void_p))
        original = methods[0] or 0
        if original not in self._tables:
            table = _Methods.from_buffer_copy(_Methods.from_address(original))
            self._tables[original] = table
            for number, (types, code) in enumerate(_OF_FILES.values()):
                if code:
                    table.functions[number] = self._watched(table.functions[number], types, code)
        methods[0] = ctypes.addressof(self._tables[original])

    def _watched(self, original: int | None, types: tuple[Any, ...], code: int) -> int:
        call = CFUNCTYPE(c_int, *types)(original or 0)
        return self._pointer(lambda *given: code if self._fails() else call(*given), types)

    def _pointer(self, function: Callable[..., int], types: tuple[Any, ...]) -> int:
        made = CFUNCTYPE(c_int, *types)(function)
        self._kept.append(made)
        return ctypes.cast(made, c_void_p).value or 0

    def _fails(self) -> bool:
        number, self.count = self.count, self.count + 1
        if self._at is None or number < self._at or (number > self._at and self._fault == "once"):
            return False
        if self._fault == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        return True
