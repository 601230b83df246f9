"""Hears of changes that others make to sites, at the moment they are made."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator

from hypermap.fleet.store.address import Address, StoreAway
from hypermap.fleet.store.database import connect, psycopg
from hypermap.fleet.store.sites import CHANNEL

_PATIENCE = 1.0  # s between two looks at whether to end, and between two tries to connect


def follow(address: Address, ended: threading.Event) -> Iterator[int]:
    """Yield the version of a site whenever another has written one, until the event is set.

    The present version comes first. After a lost connection, which is made again, it comes again:
    what was written in between is in it.

    Args:
        address: of a site.
        ended: ends it, within a second.

    Raises:
        StoreError: If the database refuses the connection.
    """
    while not ended.is_set():
        try:
            yield from _until_lost(address, ended)
        except StoreAway:  # noqa: PERF203 - it is made again
            ended.wait(_PATIENCE)


def _until_lost(address: Address, ended: threading.Event) -> Iterator[int]:
    with connect(address) as connection:
        try:
            connection.execute(f"LISTEN {CHANNEL}")
            found = connection.execute(
                "SELECT version FROM sites WHERE name = %s", (address.site,)
            ).fetchone()
            if found is not None:
                yield found[0]
            while not ended.is_set():
                for notice in connection.notifies(timeout=_PATIENCE):
                    change = json.loads(notice.payload)
                    if change["site"] == address.site:
                        yield change["version"]
                    if ended.is_set():
                        return
        except psycopg.OperationalError:
            raise StoreAway(f"{address.shown}: the connection is lost") from None
