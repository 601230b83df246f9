"""Changes of single objects, by several writers at once.

An update is one transaction: a reader sees all of it or nothing. Writers to one site wait for each
other; what they have seen of an object says whether it has changed since.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from hypermap.core.errors import LayerNotFound
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.fleet.store import rows, tables
from hypermap.fleet.store.address import StoreError
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.pushing import Conflict
from hypermap.fleet.store.sites import add_version, lock_site, no_site

if TYPE_CHECKING:
    from psycopg import Cursor


@dataclass(frozen=True, eq=False)
class Update:
    """A change of some objects of a layer.

    Attributes:
        site: the name of the site.
        layer: the name of a semantic layer.
        objects: new ones, without an id or with an unused one, and those to replace.
        removed: ids of objects that are no more.
        seen: id -> the version that the writer has seen, of each object to replace or remove.
        note: what the history says of it.
        id: made by the writer, so that the same update sent twice is done once.
    """

    site: str
    layer: str
    objects: Sequence[SemanticObject] = ()
    removed: Sequence[int] = ()
    seen: Mapping[int, int] = field(default_factory=dict)
    note: str = ""
    id: uuid.UUID = field(default_factory=uuid.uuid4)


@dataclass(frozen=True)
class Applied:
    """What became of an update.

    Attributes:
        version: of the site, with the update.
        ids: of `Update.objects`, in that order.
    """

    version: int
    ids: Sequence[int]


def apply(database: Database, update: Update) -> Applied:
    """Write an update into the store; one that is there already is not written again.

    Raises:
        Conflict: If another writer has changed or removed one of its objects since, or added one
            with the id of a new one; then nothing is written.
        SiteNotFound: If there is no such site.
        LayerNotFound: If it has no such layer.
        StoreAway: If the connection is lost; try again with the same update.
        StoreError: If this user may not write to the site.
    """
    with database.transaction() as cursor:
        site_id, before = locked_site(cursor, database, update.site)
        # Not before: another connection, lost to us, may just be writing the same.
        cursor.execute(
            "SELECT version, outcome -> 'ids' FROM versions WHERE update_id = %s", (update.id,)
        )
        if done := cursor.fetchone():
            return Applied(*done)
        layer_id = layer_to_write(cursor, site_id, update.layer)
        version = before + 1
        places = _check_seen(cursor, database, layer_id, update)
        ids = _write(cursor, layer_id, version, update, places)
        outcome = {"ids": ids, "removed": len(update.removed)}
        add_version(cursor, site_id, version, update.id, update.note, outcome)
    return Applied(version, ids)


def locked_site(cursor: Cursor[Any], database: Database, site: str) -> tuple[int, int]:
    """Let no other write to a site until the transaction ends; return its id and version.

    Raises:
        SiteNotFound: If there is none.
        StoreError: If this user may not write to it.
    """
    found = lock_site(cursor, site)
    if found is not None:
        return found
    if database.rows("SELECT 1 FROM sites WHERE name = %s", site):
        raise StoreError(f"{database.address.shown}: this user may not write to site {site!r}")
    raise no_site(database, site)


def layer_to_write(cursor: Cursor[Any], site_id: int, layer: str) -> int:
    """Return the id of a semantic layer.

    Raises:
        LayerNotFound: If the site has none of that name.
    """
    cursor.execute(
        "SELECT name, id FROM layers WHERE site_id = %s AND kind = 'SemanticLayer'", (site_id,)
    )
    ids = dict(cursor.fetchall())
    if layer not in ids:
        raise LayerNotFound(layer, ids)
    return int(ids[layer])


def _check_seen(
    cursor: Cursor[Any], database: Database, layer_id: int, update: Update
) -> dict[int, int]:
    """Return the positions of objects to replace, by id, if they have not changed since.

    Raises:
        Conflict: If they have.
    """
    given = [item.id for item in update.objects if item.id is not None]
    cursor.execute(
        "SELECT id, position, valid_from FROM objects WHERE layer_id = %s AND valid_to IS NULL "
        "AND id = ANY (%s)",
        (layer_id, [*given, *update.removed, *update.seen]),
    )
    now = {number: (position, version) for number, position, version in cursor.fetchall()}
    for number in sorted({*given, *update.removed, *update.seen}):
        version = now[number][1] if number in now else None
        if version != update.seen.get(number):
            what = "removed" if version is None else f"changed, in version {version}"
            raise Conflict(
                f"{database.address.shown}: object {number} of layer {update.layer!r} of site "
                f"{update.site!r} was {what}, by someone else; read it again"
            )
    return {number: position for number, (position, _) in now.items()}


def _write(
    cursor: Cursor[Any], layer_id: int, version: int, update: Update, places: Mapping[int, int]
) -> list[int]:
    """Write the objects of an update, and return their ids."""
    cursor.execute("SELECT next_id, next_position FROM layers WHERE id = %s", (layer_id,))
    next_id, next_position = cursor.fetchone() or (0, 0)
    given = [item.id + 1 for item in update.objects if item.id is not None]
    next_id = max([next_id, *given])
    numbered, positions = [], []
    for item in update.objects:
        if item.id is None:
            item, next_id = item.with_id(next_id), next_id + 1
        place = places.get(item.id or 0)
        if place is None:
            place, next_position = next_position, next_position + 1
        numbered.append(item)
        positions.append(place)
    cursor.execute(
        "UPDATE layers SET next_id = %s, next_position = %s WHERE id = %s",
        (next_id, next_position, layer_id),
    )
    cursor.execute(
        "UPDATE objects SET valid_to = %s WHERE layer_id = %s AND valid_to IS NULL "
        "AND id = ANY (%s)",
        (version, layer_id, list(update.removed)),
    )
    table = ObjectTable.of(numbered)
    objects = rows.rows_of_objects(table, np.array(positions, dtype=np.int64))
    tables.OBJECTS.put(cursor, layer_id, version, objects)
    return [int(number) for number in table.ids]
