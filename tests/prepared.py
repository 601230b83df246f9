"""The program `hypermap` as processes that start quickly: copies of one that has imported all.

Python takes a second to import what a command needs, and hundreds of tests start one. A copy (by
fork) starts in a tenth of that, and is a process like any other: it has an identity, signals,
streams, an environment and an exit code of its own, and waits for its threads at its end. Whoever
tests the start itself, or what is read from the environment by an import, starts a new Python
instead.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

_PROGRAM = Path(__file__).with_name("prepared_program.py")
# Of the process that all tests copy: none that a test has set. Threads would be missing in copies.
_ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
_STARTED = struct.Struct("i")
_GRACE = 5.0  # seconds in which a copy says that it runs, though the original is gone


class Command:
    """A running `hypermap`, used as a `subprocess.Popen` of text.

    Attributes:
        args: the words after `hypermap`, or after another program.
        pid: of the process.
        stdin: what it reads, if that is a pipe; likewise `stdout` and `stderr`.
        returncode: the exit code, or the negative number of the signal that ended it; None until
            that is known.

    Args:
        packages: what the process that is copied has imported: all their modules.
        program: what runs instead of `hypermap`, as words after `python`.
    """

    def __init__(
        self,
        *words: object,
        stdin: int | IO[Any] = subprocess.DEVNULL,
        stdout: int | IO[Any] | None = None,
        stderr: int | IO[Any] | None = None,
        cwd: str | Path | None = None,
        env: Mapping[str, str] | None = None,
        start_new_session: bool = False,
        packages: tuple[str, ...] = ("hypermap",),
        program: tuple[str, ...] = ("-m", "hypermap"),
    ) -> None:
        self.args = list(map(str, words))
        self.returncode: int | None = None
        with contextlib.ExitStack() as theirs:
            read, self.stdin = _end(stdin, 0, "w", theirs)
            write, self.stdout = _end(stdout, 1, "r", theirs)
            other, self.stderr = (
                (write, None) if stderr == subprocess.STDOUT else _end(stderr, 2, "r", theirs)
            )
            job = {
                "program": program,
                "words": self.args,
                "folder": str(Path.cwd() if cwd is None else cwd),
                "environment": dict(os.environ if env is None else env),
                "is_session": start_new_session,
            }
            self._status, status = socket.socketpair()
            theirs.callback(status.close)
            files = [status.fileno(), read, write, other]
            self.pid = _started(json.dumps(job).encode(), files, self._status, packages)

    def poll(self) -> int | None:
        """Return the exit code; None while it runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(timeout=0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end, and return the exit code.

        Raises:
            subprocess.TimeoutExpired: If it does not end in that many seconds.
        """
        if self.returncode is None:
            if not select.select([self._status], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            (status,) = _STARTED.unpack(self._status.recv(_STARTED.size))
            self._status.close()
            self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Return what it writes until it ends on standard output and error, if these are pipes.

        Raises:
            subprocess.TimeoutExpired: If it does not end in that many seconds.
        """
        if self.stdin is not None:
            self.stdin.close()
        said = ["", ""]

        def read(number: int, stream: IO[str]) -> None:
            with stream:
                said[number] = stream.read()

        streams = [(i, s) for i, s in enumerate((self.stdout, self.stderr)) if s and not s.closed]
        readers = [threading.Thread(target=read, args=each, daemon=True) for each in streams]
        for reader in readers:
            reader.start()
        end = None if timeout is None else time.monotonic() + timeout
        self.wait(timeout)
        for reader in readers:
            reader.join(None if end is None else max(0.0, end - time.monotonic()))
        return said[0], said[1]

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)

    def __enter__(self) -> Command:
        return self

    def __exit__(self, *_: object) -> None:
        for stream in (self.stdin, self.stdout, self.stderr):
            if stream is not None:
                stream.close()
        self.wait()


def run(
    *words: object,
    cwd: str | Path | None = None,
    env: Mapping[str, str] | None = None,
    timeout: float | None = None,
    **options: Any,
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, and return what it wrote; `options` are those of `Command`.

    Raises:
        subprocess.TimeoutExpired: If it does not end in that many seconds.
    """
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    command = Command(*words, cwd=cwd, env=env, **pipes, **options)
    try:
        out, err = command.communicate(timeout)
    except BaseException:
        command.kill()
        command.wait()
        raise
    return subprocess.CompletedProcess(command.args, command.wait(), out, err)


def _end(
    given: int | IO[Any] | None, standard: int, mode: str, theirs: contextlib.ExitStack
) -> tuple[int, IO[str] | None]:
    """Return the file that the process gets, and our end of it if it is a pipe."""
    if given == subprocess.PIPE:
        reading, writing = os.pipe()
        their, our = (reading, writing) if mode == "w" else (writing, reading)
        theirs.callback(os.close, their)
        return their, os.fdopen(our, mode, encoding="utf-8")
    if given == subprocess.DEVNULL:
        their = os.open(os.devnull, os.O_RDWR)
        theirs.callback(os.close, their)
        return their, None
    if given is None:
        return standard, None
    return (given if isinstance(given, int) else given.fileno()), None


def _started(job: bytes, files: list[int], status: socket.socket, packages: tuple[str, ...]) -> int:
    """Ask the original for a copy, and return which process that is.

    Where somebody has killed the original, as one who ends all that is called `hypermap` does,
    another one is asked.
    """
    for _ in range(3):
        channel = _original(packages)
        with contextlib.suppress(ConnectionError):
            socket.send_fds(channel, [job], files)
            select.select([status, channel], [], [])
            if select.select([status], [], [], _GRACE)[0]:
                return int(_STARTED.unpack(status.recv(_STARTED.size))[0])
        _original.cache_clear()
    raise RuntimeError("the process whose copies run commands was killed three times")


@functools.cache
def _original(packages: tuple[str, ...]) -> socket.socket:
    """Return a channel to the process of which commands are copies, started when first needed.

    It has imported all modules of these packages, and serves all workers of a run of tests. It
    ends when none of them can ask any more.
    """
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", os.getpid())
    key = repr((run, sys.executable, str(_PROGRAM), packages))
    name = f"\0hypermap-{hashlib.sha256(key.encode()).hexdigest()}"
    while True:
        ours, listening = _socket(), _socket()
        with listening:
            try:
                ours.connect(name)
            except ConnectionError:  # nobody has started it, or it has ended
                ours.close()
            else:
                atexit.register(ours.close)
                return ours
            with contextlib.suppress(OSError):  # another worker was faster
                listening.bind(name)
                listening.listen()
            if listening.getsockname():
                _start(listening, packages)


def _socket() -> socket.socket:
    """Return a socket that waits, also after rospy has set a timeout for all that are made."""
    made = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    made.setblocking(True)
    return made


def _start(listening: socket.socket, packages: tuple[str, ...]) -> None:
    process = subprocess.Popen(
        [sys.executable, "-X", "faulthandler", str(_PROGRAM), str(listening.fileno()), *packages],
        pass_fds=[listening.fileno()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        cwd=_PROGRAM.parent,
        env=_ENVIRONMENT,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )

    def end() -> None:  # after the channel is closed
        with contextlib.suppress(subprocess.TimeoutExpired):  # others may go on with it
            process.wait(1.0)

    atexit.register(end)
