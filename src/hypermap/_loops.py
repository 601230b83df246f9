"""The decorators of compiled loops: one place for what they have in common.

Compiling takes seconds on each machine, so loops work with scalars and with arrays that are made,
sorted and filled outside: numba compiles again what it needs of numpy, and code that counts who
refers to an array makes up a fifth of a loop.
"""

from __future__ import annotations

import gc
import logging
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit
from numba.core import event

from hypermap._compiled import has_own_place

# A division by zero gives infinity, as numpy's does, and so takes no code to raise an error.
_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_EVERY = 5.0  # seconds between two lines about what is compiled

Function = TypeVar("Function", bound=Callable[..., Any])

_log = logging.getLogger(__name__)
_folders: set[Path] = set()


def loop(*, allocates: bool = False, **options: Any) -> Callable[[Function], Function]:
    """Return the decorator of a function that is compiled when it is first called, and kept.

    Args:
        allocates: whether it makes arrays, returns any, or calls a loop that does; otherwise their
            memory is never given back. Others are called with arrays to fill.
        options: of numba.
    """
    options |= _OPTIONS | {"_nrt": allocates}  # "NumPy runtime", numba's name for that count
    decorate: Any = njit(**options)

    def decorated(function: Function) -> Function:
        dispatcher = decorate(function)
        folder = Path(dispatcher.stats.cache_path)
        _folders.add(folder)
        if not has_own_place():
            _borrow(function, folder)
        return cast(Function, dispatcher)

    return decorated


def inner_loop(*, allocates: bool = False, **options: Any) -> Callable[[Function], Function]:
    """Return the decorator of a function that only compiled functions call."""
    return loop(allocates=allocates, no_cpython_wrapper=True, **options)


def cache_folder() -> Path:
    """Return the folder below which the loops that are loaded so far are kept."""
    return Path(os.path.commonpath(_folders))


def compiled_count() -> int:
    """Return how many loops this process has compiled, and not found in the cache."""
    return _listener.count


def _borrow(function: Callable[..., Any], folder: Path) -> None:
    """Copy what an administrator has compiled next to the code, where the user cannot write.

    numba takes no folder in which it cannot write, and would compile everything again.
    """
    source = Path(function.__code__.co_filename)
    shared = source.parent / "__pycache__"
    if shared == folder:
        return
    # Data first: an index must not name what is not there yet.
    for file in sorted(shared.glob(f"{source.stem}.{function.__qualname__}-*.nb[ci]")):
        mine = folder / file.name
        try:
            if not mine.exists() or mine.stat().st_mtime < file.stat().st_mtime:
                partial = mine.with_name(f"{mine.name}.{os.getpid()}")
                shutil.copy2(file, partial)
                partial.replace(mine)
        except OSError as error:  # it is compiled then
            _log.debug("%s: cannot be copied: %s", file, error)


class _Listener(event.Listener):
    """Says that loops are being compiled, which takes its time.

    Python's search for cyclic garbage rests meanwhile, which else takes a sixth of that time.
    """

    def __init__(self) -> None:
        self.count = 0
        self._told = 0.0
        self._depth = 0
        self._is_collecting = False

    def on_start(self, event: Any) -> None:
        """Say it before the first one."""
        if self._depth == 0:
            self._is_collecting = gc.isenabled()
            gc.disable()
        self._depth += 1
        if _is_ours(event) and not self._told:
            self._told = time.monotonic()
            _log.info("compiling for this machine, once: about 10 s")

    def on_end(self, event: Any) -> None:
        """Say now and then how many there are."""
        self._depth -= 1
        if self._depth == 0 and self._is_collecting:
            gc.enable()
        if not _is_ours(event):
            return
        self.count += 1
        if time.monotonic() - self._told > _EVERY:
            self._told = time.monotonic()
            _log.info("compiling: %d functions so far", self.count)


def _is_ours(event: Any) -> bool:
    return str(event.data["dispatcher"].py_func.__module__).startswith("hypermap.")


_listener = _Listener()
event.register("numba:compile", _listener)  # type: ignore[no-untyped-call]
