"""What the service asks the store: collections, which are layers of sites, and their features."""

from __future__ import annotations

import contextlib
import queue
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hypermap.fleet.store.address import Address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.rows import OBJECT, Row, table_of
from hypermap.formats.semantic.geojson import feature_of
from hypermap.text import fit_for_json

_CONNECTIONS = 4
_WHERE = """
FROM objects WHERE layer_id = %(layer_id)s::integer AND valid_to IS NULL
AND (%(box)s::float8[] IS NULL OR (
    shape && ST_MakeEnvelope((%(box)s::float8[])[1], (%(box)s::float8[])[2],
        (%(box)s::float8[])[3], (%(box)s::float8[])[4], 990001)
    AND ST_Intersects(shape, ST_MakeEnvelope((%(box)s::float8[])[1], (%(box)s::float8[])[2],
        (%(box)s::float8[])[3], (%(box)s::float8[])[4], 990001))))
AND (%(name)s::text IS NULL OR name = %(name)s::text)
AND (%(tag)s::text IS NULL OR %(tag)s::text = ANY (tags))
AND (%(begin)s::float8 IS NULL OR last_seen >= %(begin)s::float8)
AND (%(end)s::float8 IS NULL OR first_seen <= %(end)s::float8)
"""


@dataclass(frozen=True)
class Filter:
    """Which features of a collection are wanted; None for any.

    Attributes:
        box: x0, y0, x1, y1 that their shapes meet [m].
        name: their name.
        tag: one of their tags.
        begin: seen then or later [s].
        end: seen then or before [s].
    """

    box: Sequence[float] | None = None
    name: str | None = None
    tag: str | None = None
    begin: float | None = None
    end: float | None = None


@dataclass(frozen=True)
class Collection:
    """A semantic layer of a site.

    Attributes:
        id: how addresses name it, SITE:LAYER.
        site: the name of the site.
        layer: the name of the layer.
        layer_id: of the layer in the store.
        frame_id: of its coordinates.
        version: of the site.
        box: x0, y0, x1, y1 around its objects [m]; None if there are none.
    """

    id: str
    site: str
    layer: str
    layer_id: int
    frame_id: str
    version: int
    box: Sequence[float] | None


class Connections:
    """Some connections to a store, of which each request takes one."""

    def __init__(self, address: Address) -> None:
        self._free: queue.LifoQueue[Database] = queue.LifoQueue()
        for _ in range(_CONNECTIONS):
            self._free.put(Database(address))

    @contextlib.contextmanager
    def one(self) -> Iterator[Database]:
        """Give a connection that no other request has."""
        database = self._free.get()
        try:
            yield database
        finally:
            self._free.put(database)

    def close(self) -> None:
        """Close the connections that no request has."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._free.get_nowait().close()


def collections(database: Database, wanted: str | None = None) -> list[Collection]:
    """Return all semantic layers of all sites, or the one with an id, if there is such."""
    rows = database.rows(
        """SELECT sites.name || ':' || layers.name, sites.name, layers.name, layers.id,
            layers.frame_id, sites.version, ST_XMin(box.extent), ST_YMin(box.extent),
            ST_XMax(box.extent), ST_YMax(box.extent)
        FROM layers JOIN sites ON sites.id = layers.site_id
        CROSS JOIN LATERAL (
            SELECT ST_Extent(shape) AS extent FROM objects
            WHERE layer_id = layers.id AND valid_to IS NULL
        ) AS box
        WHERE layers.kind = 'SemanticLayer'
            AND (%(wanted)s::text IS NULL
                OR sites.name || ':' || layers.name = %(wanted)s::text)
        ORDER BY sites.name, layers.name""",
        wanted=wanted,
    )
    return [
        Collection(name, site, layer, layer_id, frame_id, version, None if None in box else box)
        for name, site, layer, layer_id, frame_id, version, *box in rows
    ]


def features(
    database: Database, collection: Collection, wanted: Filter, limit: int, offset: int
) -> tuple[list[dict[str, Any]], int]:
    """Return some features in the order of the layer, and how many match in all."""
    asked: dict[str, Any] = {
        "layer_id": collection.layer_id,
        "box": None if wanted.box is None else list(wanted.box),
        "name": wanted.name,
        "tag": wanted.tag,
        "begin": wanted.begin,
        "end": wanted.end,
    }
    with database.snapshot():
        ((count,),) = database.rows(f"SELECT count(*) {_WHERE}", **asked)
        page = f"SELECT {OBJECT} {_WHERE} ORDER BY position LIMIT %(limit)s OFFSET %(offset)s"
        rows = database.rows(page, **asked, limit=limit, offset=offset)
    return _features(rows), count


def feature(
    database: Database, collection: Collection, number: int
) -> tuple[dict[str, Any], int] | None:
    """Return the feature of an object and the version that it is of; None if there is none."""
    rows = database.rows(
        f"SELECT {OBJECT} FROM objects WHERE layer_id = %s AND valid_to IS NULL AND id = %s",
        collection.layer_id,
        number,
    )
    return (_features(rows)[0], rows[0][-1]) if rows else None


def _features(rows: Sequence[Row]) -> list[dict[str, Any]]:
    table = table_of(rows)
    found = [feature_of(table.object(row)) for row in range(len(table))]
    return [fit_for_json(each) for each in found]
