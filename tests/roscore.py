"""A roscore as users start theirs, but with patience for a busy machine; and a port for it."""

from __future__ import annotations

import contextlib
import secrets
import shutil
import socket
from pathlib import Path

_PATIENT = (
    "import sys, roslaunch, roslaunch.launch; "
    "roslaunch.launch._TIMEOUT_MASTER_START = 240.0; "  # s; after 10 it would give up
    "roslaunch.main(['roscore', '--core', *sys.argv[1:]])"
)


def roscore_command(port: int) -> list[str]:
    """Return the command that starts a roscore, by the Python that it is installed for."""
    script = shutil.which("roscore")
    assert script is not None
    first = Path(script).read_text(encoding="utf-8").splitlines()[0]
    return [*first.removeprefix("#!").split(), "-c", _PATIENT, "-p", str(port)]


def free_port() -> int:
    """Return a free port that nobody gets who does not ask for it by its number.

    One that the system has chosen itself it may choose again, before the program that is to listen
    there has started: for any connection, or for another test.
    """
    while True:
        port = 20_000 + secrets.randbelow(10_000)  # the system's own are from 32,768 on
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return port


def is_missing(service: str) -> bool:
    """Return whether no node offers a service."""
    from hypermap.ros.ros1.libraries import rosgraph

    try:
        rosgraph.Master("/test").lookupService(service)
    except rosgraph.MasterError:
        return True
    return False
