"""One private PostgreSQL server for all tests of the store, without a port; skipped without it."""

from __future__ import annotations

import itertools
import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

_PROGRAMS = Path("/usr/lib/postgresql/15/bin")
_SETTINGS = (
    "-c listen_addresses='' -c fsync=off -c full_page_writes=off -c max_connections=40 "
    "-c shared_buffers=64MB"
)
_NUMBERS = itertools.count()


class Server:
    """A server of its own user in a folder of its own; `stop` and `start` are a loss of power."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._run(
            "initdb",
            "-D",
            self._data,
            "-A",
            "trust",
            "-U",
            "owner",
            "--no-sync",
            "-E",
            "UTF8",
            "--locale=C",
        )

    @property
    def _data(self) -> str:
        return str(self.folder / "data")

    def start(self) -> None:
        options = f"{_SETTINGS} -c unix_socket_directories={self.folder}"
        log = str(self.folder / "log")
        self._run("pg_ctl", "-D", self._data, "-w", "-s", "-l", log, "-o", options, "start")

    def stop(self) -> None:
        self._run("pg_ctl", "-D", self._data, "-w", "-s", "-m", "immediate", "stop")

    def address(self, database: str, user: str = "owner") -> str:
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
        assert done.returncode == 0, (self.folder / "log").read_text()


def _as_nobody() -> dict[str, Any]:
    """Return how to start what refuses to run as root."""
    if os.getuid() != 0:
        return {}
    nobody = pwd.getpwnam("nobody")
    return {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    """A running server with the store "store"."""
    if not (_PROGRAMS / "postgres").exists():
        pytest.skip("PostgreSQL 15 is missing (sudo scripts/postgres.sh)")
    if not Path("/usr/share/postgresql/15/extension/postgis.control").exists():
        pytest.skip("PostGIS is missing (sudo scripts/postgres.sh)")
    psycopg = pytest.importorskip("psycopg", reason="psycopg is missing")
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.migrating import migrate

    # A socket's path must be short, and root's folders are closed to others.
    folder = Path(tempfile.mkdtemp(prefix="hypermap-pg-", dir="/tmp"))
    if os.getuid() == 0:
        shutil.chown(folder, "nobody")
    started = Server(folder)
    try:
        started.start()
        with psycopg.connect(started.address("postgres"), autocommit=True) as connection:
            connection.execute("CREATE DATABASE store")
        migrate(parse_address(started.address("store")))
        yield started
    finally:
        if (folder / "data" / "postmaster.pid").exists():
            started.stop()
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def store(server: Server) -> str:
    """The address of a store that all tests share; each takes sites of its own."""
    return server.address("store")


@pytest.fixture
def site() -> str:
    """The name of a site that no other test has."""
    return f"site {next(_NUMBERS)}"


@pytest.fixture
def database(store: str) -> Iterator[Any]:
    """A connection to the store."""
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database

    opened = Database(parse_address(store))
    yield opened
    opened.close()
