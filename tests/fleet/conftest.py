"""One private PostgreSQL server for all tests of the store; they are skipped without it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import pytest

_SETTINGS = "-c fsync=off -c full_page_writes=off -c max_connections=40 -c shared_buffers=64MB"
_NUMBERS = itertools.count()


@pytest.fixture(scope="session")
def server() -> Iterator[Any]:
    """A running server with the store "store"."""
    psycopg = pytest.importorskip("psycopg", reason="psycopg is missing")
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.migrating import migrate
    from hypermap.testing.postgres import private_server, why_no_server

    if (reason := why_no_server()) is not None:
        pytest.skip(reason)
    with private_server(_SETTINGS) as started:
        with psycopg.connect(started.address("postgres"), autocommit=True) as connection:
            connection.execute("CREATE DATABASE store")
        migrate(parse_address(started.address("store")))
        yield started


@pytest.fixture(scope="session")
def store(server: Any) -> str:
    """The address of a store that all tests share; each takes sites of its own."""
    address: str = server.address("store")
    return address


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
