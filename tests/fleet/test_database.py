"""A connection to a store: what it does with its end, and with a server that refuses it."""

from __future__ import annotations

import gc
import socket
import sys
import threading
from pathlib import Path

import pytest

pytest.importorskip("psycopg", reason="psycopg is missing")

from hypermap.fleet.store.address import StoreAway, StoreError, parse_address
from hypermap.fleet.store.database import Database, connect

pytestmark = pytest.mark.xdist_group("store")


def test_a_forgotten_database_closes_its_connection_whatever_python_frees_first(
    store: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    complaints: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", complaints.append)
    forgotten = Database(parse_address(store))
    forgotten.itself = forgotten  # type: ignore[attr-defined]  # as maps and their layers
    gc.collect(0)
    forgotten.rows("SELECT 1")  # a connection that is younger, and freed first
    del forgotten
    gc.collect()
    assert complaints == []


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        ("the database system is starting up", StoreAway),
        ("the database system is in recovery mode", StoreAway),
        ("the database system is not yet accepting connections", StoreAway),
        ("sorry, too many clients already", StoreAway),
        ('password authentication failed for user "x"', StoreError),
    ],
)
def test_what_refuses_a_connection_for_now_is_told_from_what_refuses_it(
    message: str, kind: type[StoreError], tmp_path: Path
) -> None:
    """A follower tries again in the first case, and ends in the second."""
    fields = f"SFATAL\0VFATAL\0C57P03\0M{message}\0\0".encode()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / ".s.PGSQL.5432"))
        server.listen()

        def refuse() -> None:
            with server.accept()[0] as client:
                client.recv(1000)
                client.sendall(b"E" + (len(fields) + 4).to_bytes(4, "big") + fields)

        refusing = threading.Thread(target=refuse)
        refusing.start()
        with pytest.raises(StoreError, match=message) as refused:
            connect(parse_address(f"postgresql://owner@/store?host={tmp_path}&gssencmode=disable"))
        refusing.join()
    assert type(refused.value) is kind
