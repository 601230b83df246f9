"""Faults on the way of a save: at its n-th operation on files, in a process of its own.

Python tells an audit hook before it opens, renames, removes or locks anything; what it does not
tell of, as fsync, is wrapped. So the operations of a save can be counted, and at each of them the
process may be killed, or the operation fail, or files be gone.

Source: the crash tests of SQLite (sqlite.org/testing.html, section 3), which do the same by a file
system of their own.
"""

from __future__ import annotations

import contextlib
import errno
import gc
import importlib
import os
import pickle
import resource
import select
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

Fault = Literal["kill", "EIO", "vanish", "sweep"]

NOBODY = 65534
_PATIENCE = 300  # seconds, until a save counts as hanging
_WATCHED = {
    "open",
    "os.rename",
    "os.remove",
    "os.mkdir",
    "os.rmdir",
    "os.link",
    "os.symlink",
    "os.chmod",
    "os.chown",
    "os.truncate",
    "os.scandir",
    "os.listdir",
    "fcntl.flock",
}


@dataclass(frozen=True)
class Outcome:
    """How a process ended that was to do something.

    Attributes:
        value: what it returned; None if it did not.
        error: what it raised, as text; empty if nothing.
        is_ours: whether that was a HypermapError.
        signal: by which it was killed; 0 if it was not.
        operations: how many operations on files it did; 0 if it was killed.
    """

    value: Any = None
    error: str = ""
    is_ours: bool = False
    signal: int = 0
    operations: int = 0

    @property
    def fall(self) -> str:
        """In words, how it ended as none may, whatever was done to it; empty if it did not."""
        if self.signal == signal.SIGABRT:
            return "hangs"
        if self.signal not in (0, signal.SIGKILL, signal.SIGXFSZ):
            return f"died of signal {self.signal}"
        return f"raised {self.error}" if self.error and not self.is_ours else ""


def in_a_process(work: Callable[[], Any], prepare: Callable[[], Any] = lambda: None) -> Outcome:
    """Do something in a process that is forked for it; `prepare` comes first, and must succeed."""
    with tempfile.TemporaryFile() as kept:
        child = os.fork()
        if child == 0:
            _be_the_child(work, prepare, kept.fileno())
        status = _status(child)
        kept.seek(0)
        if os.WIFSIGNALED(status):
            return Outcome(signal=os.WTERMSIG(status))
        content = kept.read()
    return pickle.loads(content) if content else Outcome(error="it ended without a word")


def _be_the_child(work: Callable[[], Any], prepare: Callable[[], Any], kept: int) -> None:
    gc.freeze()  # else the collector looks at all objects, and copies their memory
    from hypermap import HypermapError

    counted: Any = None
    try:
        silence = os.open(os.devnull, os.O_RDWR)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        counted = prepare()
        outcome = Outcome(work(), operations=getattr(counted, "count", 0))
    except BaseException as error:
        if counted is not None:
            counted.is_armed = False
        last = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {error} ({Path(last.filename).name}:{last.lineno})"
        is_ours = isinstance(error, HypermapError)
        outcome = Outcome(error=text, is_ours=is_ours, operations=getattr(counted, "count", 0))
    if counted is not None:
        counted.is_armed = False
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    with contextlib.suppress(OSError):
        os.write(kept, pickle.dumps(outcome))
    os._exit(0)


def _status(child: int) -> int:
    """Wait for a process, but not for ever; what hangs is killed."""
    handle = os.pidfd_open(child)
    has_ended = select.select([handle], [], [], _PATIENCE)[0]
    os.close(handle)
    if not has_ended:
        os.kill(child, signal.SIGABRT)
    return os.waitpid(child, 0)[1]


def import_what_it_needs(work: Callable[[], Any]) -> None:
    """Import here what a work imports, so that processes forked later need not; it is done once.

    The work itself is done elsewhere: its threads would not survive a fork.
    """

    def named() -> list[str]:
        work()
        return list(sys.modules)

    outcome = in_a_process(named)
    if outcome.error or outcome.signal:
        raise RuntimeError(str(outcome))
    for name in outcome.value:
        with contextlib.suppress(Exception):  # some are made up by others
            importlib.import_module(name)


class Operations:
    """Counts the operations on files of a folder, and lets one of them be the fault.

    Args:
        folder: whose files are meant.
        at: number of the operation, from 0; None for none of them.
        fault: what happens there: the process is killed, the operation fails as on a broken disk,
            all that was saved before vanishes, or all temporary files do.
    """

    def __init__(self, folder: Path, at: int | None = None, fault: Fault = "kill") -> None:
        self.count = 0
        self.is_armed = True
        self._folder, self._at, self._fault = str(folder), at, fault
        sys.addaudithook(self._hear)
        fsync = os.fsync

        def watched_fsync(handle: Any) -> None:
            self._operation()
            fsync(handle)

        os.fsync = watched_fsync  # type: ignore[assignment]  # this process is its own

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.is_armed or event not in _WATCHED:
            return
        place = arguments[0]
        if isinstance(place, int):  # a handle, also of the terminal
            with contextlib.suppress(OSError):
                place = Path(f"/proc/self/fd/{place}").readlink()
        if isinstance(place, int) or os.fsdecode(place or "").startswith(self._folder):
            self._operation()

    def _operation(self) -> None:
        if not self.is_armed:
            return
        number, self.count = self.count, self.count + 1
        if number != self._at:
            return
        if self._fault == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if self._fault == "EIO":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        self.is_armed = False
        for path in sorted(Path(self._folder).rglob("*")):
            is_temporary = path.name.startswith(".hypermap-")
            if path.is_file() and is_temporary == (self._fault == "sweep"):
                path.unlink()
        self.is_armed = True


def full_disk(most_bytes: int, *, kills: bool = False) -> None:
    """Let no file of this process grow beyond so many bytes, as on a full disk.

    Args:
        most_bytes: the limit.
        kills: whether the process dies in the middle of the write, as by a power cut.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL if kills else signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, resource.RLIM_INFINITY))


def read_only(folder: Path) -> None:
    """Be somebody who may read a folder, but not write in it."""
    for path in [folder, *folder.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    if os.getuid() == 0:
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)


def fresh(folder: Path, like: Path | None = None) -> Path:
    """Return a folder that is empty, or a copy of another."""
    shutil.rmtree(folder, ignore_errors=True)
    if like is None:
        folder.mkdir(parents=True)
    else:
        shutil.copytree(like, folder, symlinks=True)
    return folder
