"""A store of 10,000,000 objects on 1,000 sites: the questions of `hypermap bench fleet`, explained.

    python benchmarks/large_store.py [SITES] [ADDRESS]

A private server is filled by pushes of 200 sites; copies of these, made within the database, are
the others. With an address, a store that an earlier run has begun to fill is filled further.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from suite import fleet
from suite.race import Figure, Settings

from hypermap.fleet.store import finding
from hypermap.fleet.store.address import parse_address
from hypermap.fleet.store.database import Database
from hypermap.testing.postgres import private_server

PUSHED, OBJECTS = 200, 10_000
POINT = "ST_SetSRID(ST_MakePoint(20.3, 12.2), 990001)"
NOW = "SELECT id, ST_AsBinary(shape) FROM objects WHERE layer_id = 4 AND valid_to IS NULL AND"


@contextlib.contextmanager
def store(address: str | None) -> Iterator[str]:
    """Give the address of a store with the sites that are pushed."""
    if address is not None:
        yield address
        return
    with private_server(fleet.SETTINGS) as server:
        yield fleet._filled(server, PUSHED, OBJECTS)


def fill(database: Database, sites: int) -> None:
    """Copy sites within the database until there are so many."""
    connection = database.connected()
    (there,) = connection.execute("SELECT max(id) FROM sites").fetchall()[0]
    for number in range(there + 1, sites + 1):
        source = (number - 1) % PUSHED + 1
        with connection.transaction():
            for statement in _copies():
                connection.execute(statement, {"new": number, "old": source})
        if number % 50 == 0:
            print(f"{number} sites", flush=True)
    connection.execute("VACUUM ANALYZE")


def _copies() -> Iterator[str]:
    """Yield the statements that copy a site with its one layer, both of which have its number."""
    yield (
        "INSERT INTO sites (id, name, version) OVERRIDING SYSTEM VALUE "
        "VALUES (%(new)s, 'site ' || %(new)s - 1, 1)"
    )
    yield (
        "INSERT INTO versions SELECT %(new)s, version, at, author, note, gen_random_uuid(), "
        "outcome FROM versions WHERE site_id = %(old)s"
    )
    yield (
        "INSERT INTO layers (id, site_id, name, kind, frame_id, next_id, next_position) "
        "OVERRIDING SYSTEM VALUE SELECT %(new)s, %(new)s, name, kind, frame_id, next_id, "
        "next_position FROM layers WHERE id = %(old)s"
    )
    for table, owner in (("files", "site_id"), ("objects", "layer_id")):
        columns = _COLUMNS[table]
        yield (
            f"INSERT INTO {table} ({owner}, {columns}) SELECT %(new)s, {columns} FROM {table} "
            f"WHERE {owner} = %(old)s"
        )


_COLUMNS = {
    "files": "name, content, valid_from",
    "objects": "id, position, name, shape, footprint, area, x, y, tags, confidence, existence, "
    "first_seen, last_seen, attributes, valid_from",
}


def explain(database: Database) -> None:
    """Print how the database answers each question."""
    asked: list[tuple[str, Any]] = [
        (f"{NOW} shape && {POINT}", ()),
        (f"{NOW} name = 'thing 7' ORDER BY shape <-> {POINT} LIMIT 10", ()),
        (
            finding._QUESTION,
            {"x": 0.0, "y": 0.0, "names": [fleet.RARE], "before": None, "wall": 0.5},
        ),
    ]
    for question, values in asked:
        rows = database.connected().execute(f"EXPLAIN (ANALYZE, BUFFERS) {question}", values)
        print("\n".join(line for (line,) in rows.fetchall()), "\n")


def main(sites: int = 1000, address: str | None = None) -> None:
    """Fill a store, ask it, and print all."""
    with store(address) as filled:
        database = Database(parse_address(filled))
        settings = Settings(None, 5, False, Path())
        begin = time.monotonic()
        fill(database, sites)
        print(f"filled in {time.monotonic() - begin:.0f} s")
        size = database.rows("SELECT pg_size_pretty(pg_database_size(current_database()))")[0][0]
        print(f"{size} on disk")
        for row in fleet._questions(filled, f"{sites * OBJECTS:,} objects", settings):
            if isinstance(row, Figure):
                print(f"{row.work}: {row.values[0]:.2f} {row.unit}, asked {row.asked:.2f}")
        explain(database)
        database.close()


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 1000, sys.argv[2] if len(sys.argv) > 2 else None
    )
