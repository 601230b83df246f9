"""The decorators of compiled loops: one place for what they have in common.

Compiling takes seconds on each machine, so loops work with scalars and with arrays that are made,
sorted and filled outside: numba compiles again what it needs of numpy, and code that counts who
refers to an array makes up a fifth of a loop.
"""

from __future__ import annotations

import functools
import gc
import logging
import os
import pickle
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit
from numba.core import event

from hypermap._compiled import has_own_place

# A division by zero gives infinity, as numpy's does, and so takes no code to raise an error.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}
_EVERY = 5.0  # seconds between two lines about what is compiled

Function = TypeVar("Function", bound=Callable[..., Any])

_log = logging.getLogger(__name__)
_folders: set[Path] = set()


def loop(*, allocates: bool = False, **options: Any) -> Callable[[Function], Function]:
    """Return the decorator of a function that is compiled when it is first called, and kept.

    Args:
        allocates: whether it makes arrays, returns any, or calls a loop that does; otherwise their
            memory is never given back. Others are called with arrays to fill.
        options: of numba. One with `fastmath` that others call takes `forceinline`, too: otherwise
            the process that compiles it runs another copy of it than those that load it, and rounds
            differently.
    """
    options |= _OPTIONS | {"_nrt": allocates}  # "NumPy runtime", numba's name for that count
    decorate: Any = njit(**options)

    def decorated(function: Function) -> Function:
        dispatcher = decorate(function)
        if _is_kept(dispatcher):
            _ignore_unreadable_index(dispatcher)
            _go_on_if_full(dispatcher)
            folder = Path(dispatcher.stats.cache_path)
            _folders.add(folder)
            if not has_own_place():
                _borrow(function, folder)
        return cast(Function, dispatcher)

    return decorated


def inner_loop(*, allocates: bool = False, **options: Any) -> Callable[[Function], Function]:
    """Return the decorator of a function that only compiled functions call."""
    return loop(allocates=allocates, no_cpython_wrapper=True, **options)


def cache_folder() -> Path | None:
    """Return the common folder of the compiled loops that are loaded so far; None without any."""
    return Path(os.path.commonpath(_folders)) if _folders else None


def compiled_count() -> int:
    """Return how many loops this process has compiled, and not found in the cache."""
    return _listener.count


def _is_kept(dispatcher: Any) -> bool:
    """Let numba keep a compiled loop; return whether there is a folder for it."""
    try:
        dispatcher.enable_caching()
    except RuntimeError as error:  # no folder can be written to
        _log.debug("%s", error)
        _tell_that_none_is_kept()
        return False
    return True


@functools.cache
def _tell_that_none_is_kept() -> None:
    _log.warning(
        "no folder for compiled code can be written to, so that each start compiles it again, for "
        "up to 10 s; set NUMBA_CACHE_DIR to a folder of your own"
    )


def _ignore_unreadable_index(dispatcher: Any) -> None:
    """Let numba compile a loop again if its cache names a class that was renamed or removed.

    numba unpickles the types in the index before it looks whether the source has changed, so an
    update of the package would end in an AttributeError.
    """
    file = dispatcher._cache._cache_file
    load_index = file._load_index

    def load_readable_index() -> dict[Any, str]:
        try:
            return cast("dict[Any, str]", load_index())
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError) as error:
            _log.debug("%s: cannot be read: %s", file._index_path, error)
            return {}

    file._load_index = load_readable_index


def _go_on_if_full(dispatcher: Any) -> None:
    """Let a loop that cannot be kept, as on a full disk, be compiled again by the next process."""
    save = dispatcher._cache.save_overload

    def save_if_possible(*arguments: Any) -> None:
        try:
            save(*arguments)
        except OSError as error:
            reason = error.strerror or str(error)
            _log.debug("%s: cannot keep a loop: %s", dispatcher.stats.cache_path, reason)

    dispatcher._cache.save_overload = save_if_possible


def _borrow(function: Callable[..., Any], folder: Path) -> None:
    """Copy the loops that an administrator has compiled next to the code to the user's cache.

    numba does not use a folder that it cannot write to, and would compile everything again.
    """
    source = Path(function.__code__.co_filename)
    shared = source.parent / "__pycache__"
    if shared == folder:
        return
    # Data first: an index must not name missing files.
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
    """Logs that loops are being compiled, which takes a while.

    Garbage collection is off meanwhile, which would take a sixth of the time.
    """

    def __init__(self) -> None:
        self.count = 0
        self._last_log = 0.0
        self._depth = 0
        self._is_collecting = False

    def on_start(self, event: Any) -> None:
        """Log the first one."""
        if self._depth == 0:
            self._is_collecting = gc.isenabled()
            gc.disable()
        self._depth += 1
        if _is_ours(event) and not self._last_log:
            self._last_log = time.monotonic()
            _log.info("compiling for this machine, once: about 10 s")

    def on_end(self, event: Any) -> None:
        """Log the number now and then."""
        self._depth -= 1
        if self._depth == 0 and self._is_collecting:
            gc.enable()
        if not _is_ours(event):
            return
        self.count += 1
        if time.monotonic() - self._last_log > _EVERY:
            self._last_log = time.monotonic()
            _log.info("compiling: %d functions so far", self.count)


def _is_ours(event: Any) -> bool:
    return str(event.data["dispatcher"].py_func.__module__).startswith("hypermap.")


_listener = _Listener()
event.register("numba:compile", _listener)  # type: ignore[no-untyped-call]
