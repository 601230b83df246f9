"""A private PostgreSQL server for tests and benchmarks: in a folder of its own, without a port."""

from __future__ import annotations

import contextlib
import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PROGRAMS = Path("/usr/lib/postgresql/15/bin")
_POSTGIS = Path("/usr/share/postgresql/15/extension/postgis.control")
_WAIT = ("-w", "-t", "240", "-s")  # s; the machine may be busy


class PrivateServer:
    """A server whose user is `owner`, who needs no password."""

    def __init__(self, folder: Path, settings: str = "") -> None:
        self.folder = folder
        self._settings = f"-c listen_addresses='' -c unix_socket_directories={folder} {settings}"
        options = "-A trust -U owner --no-sync -E UTF8 --locale=C"
        self._run("initdb", "-D", self._data, *options.split())

    @property
    def _data(self) -> str:
        return str(self.folder / "data")

    def start(self) -> None:
        """Start it, and wait until it answers."""
        log = str(self.folder / "log")
        self._run("pg_ctl", "-D", self._data, *_WAIT, "-l", log, "-o", self._settings, "start")

    def stop(self) -> None:
        """End it at once, as a loss of power does."""
        self._run("pg_ctl", "-D", self._data, *_WAIT, "-m", "immediate", "stop")

    def address(self, database: str, user: str = "owner") -> str:
        """Return the address of one of its databases."""
        return f"postgresql://{user}@/{database}?host={self.folder}"

    def _run(self, program: str, *arguments: str) -> None:
        done = subprocess.run(
            [_PROGRAMS / program, *arguments],
            check=False,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,  # a server that stays would hold a pipe open
            stderr=subprocess.DEVNULL,
            cwd="/",
            **_as_nobody(),
        )
        if done.returncode != 0:
            log = self.folder / "log"
            raise RuntimeError(f"{program} failed: {log.read_text() if log.exists() else ''}")


def why_no_server() -> str | None:
    """Return what is missing for a server; None if nothing is."""
    if not (_PROGRAMS / "postgres").exists():
        return "PostgreSQL 15 is missing (sudo scripts/postgres.sh)"
    if not _POSTGIS.exists():
        return "PostGIS is missing (sudo scripts/postgres.sh)"
    return None


@contextlib.contextmanager
def private_server(settings: str = "") -> Iterator[PrivateServer]:
    """Run a server with further settings, such as "-c fsync=off"; its data ends with it."""
    # A socket's path must be short, and root's folders are closed to others.
    folder = Path(tempfile.mkdtemp(prefix="hypermap-pg-", dir="/tmp"))
    if os.getuid() == 0:
        shutil.chown(folder, "nobody")
    server = PrivateServer(folder, settings)
    try:
        server.start()
        yield server
    finally:
        if (folder / "data" / "postmaster.pid").exists():
            server.stop()
        shutil.rmtree(folder, ignore_errors=True)


def _as_nobody() -> dict[str, Any]:
    """Return how to start what refuses to run as root."""
    if os.getuid() != 0:
        return {}
    nobody = pwd.getpwnam("nobody")
    return {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
