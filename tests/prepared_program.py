"""Imports what commands need, and runs each command that it is asked for in a copy of itself.

It serves all workers of a run of tests, and ends when nobody can ask any more. See `prepared.py`.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import pkgutil
import runpy
import select
import signal
import socket
import struct
import sys
import tempfile
import threading
import types
from pathlib import Path
from typing import Any

# These need ROS, or start threads: left out unless they are asked for by name.
APART = ("hypermap.ros.ros1", "hypermap.ros.ros2", "hypermap.ros.rviz", "hypermap.viewer.logs")


def import_all(packages: list[str]) -> None:
    """Import the modules of packages.

    Not all can be: some need libraries that are not here, or a program around them. A command that
    does not find a module here imports it itself.
    """
    apart = tuple(set(APART) - set(packages))
    for package in packages:
        try:
            folder = importlib.import_module(package).__path__
        except ImportError:  # as for tools of ROS
            continue
        for module in pkgutil.walk_packages(folder, f"{package}."):
            if not module.name.startswith((*apart, "hypermap.__main__")):
                with contextlib.suppress(Exception):
                    importlib.import_module(module.name)
    # Numba imports a third of a second's worth when the first loop runs.
    from numba.core.registry import cpu_target

    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()


def next_job(listening: socket.socket) -> dict[str, Any]:
    """Return the next job, in the process that is to do it."""
    channels: list[socket.socket] = []
    while True:
        for channel in select.select([listening, *channels], [], [])[0]:
            if channel is listening:
                channels.append(accepted(listening))
                continue
            text, fds = received(channel)
            if not text:
                channels.remove(channel)
                channel.close()
                if not channels:
                    sys.exit()
            elif os.fork() == 0:
                for each in (listening, *channels):
                    each.close()
                return begun(text, fds)
            for fd in fds:
                os.close(fd)


def accepted(listening: socket.socket) -> socket.socket:
    """Return the channel of who wants to ask, which must be the one that started this process."""
    channel, _ = listening.accept()
    ids = struct.Struct("3i")  # process, user, group
    _, user, _ = ids.unpack(channel.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, ids.size))
    if user != os.getuid():
        channel.shutdown(socket.SHUT_RDWR)
    return channel


def received(channel: socket.socket) -> tuple[bytes, list[int]]:
    """Return a job and the files that come with it; none if nobody can ask any more."""
    try:
        text, fds, _, _ = socket.recv_fds(channel, 1 << 20, 4)
    except ConnectionError:
        return b"", []
    return text, fds


def begun(text: bytes, fds: list[int]) -> dict[str, Any]:
    """Return a job in its own process, with its streams."""
    status, *streams = fds
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    job: dict[str, Any] = json.loads(text)
    report_start_and_end(status, streams, is_session=job["is_session"])
    os.close(status)
    for standard, stream in enumerate(streams):
        os.dup2(stream, standard)
    for stream in set(streams):
        os.close(stream)
    sys.stdin = os.fdopen(0, closefd=False)
    sys.stdout = os.fdopen(1, "w", closefd=False)
    if job["environment"].get("PYTHONUNBUFFERED"):
        sys.stdout.reconfigure(write_through=True)
    sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
    return job


def report_start_and_end(status: int, streams: list[int], *, is_session: bool) -> None:
    """Return in a new process, which has written its number; this one writes how that has ended."""
    number = struct.Struct("i")
    child = os.fork()
    if not child:
        if is_session:
            os.setsid()  # before anyone knows the number, and sends a signal to all of the session
        os.write(status, number.pack(os.getpid()))
        return
    for stream in set(streams):
        os.close(stream)
    os.write(status, number.pack(os.waitpid(child, 0)[1]))
    os._exit(0)


def run(program: list[str]) -> None:
    """Run a program as Python does that is given these words: "-m" and a module, or others."""
    if program[0] == "-m":
        runpy.run_module(program[1], run_name="__main__", alter_sys=True)
        return
    sys.argv[0] = program[0]
    if program[0] == "-c":
        main = sys.modules["__main__"] = types.ModuleType("__main__")
        exec(program[1], vars(main))
    else:
        sys.path.insert(0, str(Path(program[0]).parent))
        runpy.run_path(program[0], run_name="__main__")


def run_to_its_end(program: list[str]) -> None:
    """Run a program and end this process, without taking apart all that is imported.

    That takes three times as long as a short command. What else Python does at an end is done here:
    it waits for threads, calls the functions of `atexit` and writes what is left to be written.
    Where it would also have to say what went wrong, it ends by itself.
    """
    code: object = 0
    try:
        run(program)
    except SystemExit as ended:
        code = ended.code or 0
    if isinstance(code, int):
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        with contextlib.suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    sys.exit(code)  # type: ignore[arg-type]


if __name__ == "__main__":
    gc.disable()  # imports drop little of what they make; to look for it took a fourth of the time
    import_all(sys.argv[2:])
    gc.freeze()  # else each copy looks at all objects, which copies the memory they lie in
    gc.enable()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for those that report an end
    job = next_job(socket.socket(fileno=int(sys.argv[1])))
    os.chdir(job["folder"])
    os.environ.clear()
    os.environ.update(job["environment"])
    tempfile.tempdir = None  # to be found in this environment
    sys.path[1:1] = filter(None, job["environment"].get("PYTHONPATH", "").split(os.pathsep))
    sys.argv[1:] = job["words"]
    if "rospy" in sys.modules:
        sys.modules["rospy"].names.reload_mappings(sys.argv)  # which it has read when imported
    run_to_its_end(job["program"])
