"""Whole maps: into a store as the next version of a site, and out of it, any version."""

from __future__ import annotations

import time
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.history import MAP_ID
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.fleet.store import rows, tables
from hypermap.fleet.store.address import StoreError
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.sites import add_version, find_site, lock_site, oldest_version
from hypermap.formats.hmap import files_of_map, map_of_files
from hypermap.history import begun, grown

if TYPE_CHECKING:
    from psycopg import Cursor

_LAYER_TABLES = tuple(table for table in tables.ALL if table.owner == "layer_id")
Rows = Mapping[str, "list[rows.Row]"]


class SiteExists(StoreError):
    """There is a site of that name, and it must not be replaced."""


class Conflict(StoreError):
    """Someone else has changed the site, or an object of it, in the meantime."""


@dataclass(frozen=True)
class Pushed:
    """What became of a push.

    Attributes:
        version: of the site, which it now has.
        changes: how many objects, tiles, observations ... were added, changed or removed.
    """

    version: int
    changes: Mapping[str, int]


def push(
    database: Database,
    hypermap: Hypermap,
    site: str,
    *,
    update: bool = False,
    force: bool = False,
    expected: int | None = None,
    note: str = "",
    update_id: uuid.UUID | None = None,
) -> Pushed:
    """Make a map the next version of a site, or the first one of a new site.

    What is equal to the version before is not stored again. The same push again, with the same
    `update_id`, does nothing.

    Args:
        database: the store.
        hypermap: the map.
        site: the name of the site.
        update: whether there may be such a site already.
        force: whether it may hold another map, of another id.
        expected: the version that it has to have; None for any.
        note: what the history says of it.
        update_id: made by the caller, who may not hear whether the push was done.

    Raises:
        SiteExists: If there is such a site, and it is not to be updated, or holds another map.
        Conflict: If it has another version than expected.
        StoreError: If the store refuses, as for a user who may not write.
    """
    update_id = update_id or uuid.uuid4()
    hypermap = grown(hypermap, time.time())
    # Before anything is written: what cannot be stored is an error here.
    files = list(files_of_map(_skeleton(hypermap)).items())
    with database.transaction() as cursor:
        site_id, before = _locked_or_new(cursor, database, site)
        # Not before: another connection may just be writing the same.
        cursor.execute("SELECT version, outcome FROM versions WHERE update_id = %s", (update_id,))
        if done := cursor.fetchone():
            return Pushed(*done)
        _check_version(database, site, before, update, expected)
        version = before + 1
        if before and not force:
            _check_same_map(database, hypermap, site_id, before, site)
        changes = {"files": tables.FILES.replace(cursor, site_id, version, files)}
        layer_ids = _layer_ids(cursor, site_id, hypermap)
        for layer in hypermap:
            for name, count in _write_layer(cursor, layer_ids[layer.name], layer, version).items():
                changes[name] = changes.get(name, 0) + count
        _end_layers_but(cursor, site_id, list(layer_ids.values()), version)
        outcome = {name: count for name, count in changes.items() if count}
        add_version(cursor, site_id, version, update_id, note, outcome)
    return Pushed(version, outcome)


def pull(database: Database, site: str, version: int | None = None) -> Hypermap:
    """Return a version of a site as a map in memory, exactly as it was pushed.

    Raises:
        SiteNotFound: If there is no such site.
        StoreError: If it has no such version.
    """
    with database.snapshot():
        site_id, newest = find_site(database, site)
        wanted = newest if version is None else version
        first = oldest_version(database, site_id)
        if not first <= wanted <= newest:
            raise StoreError(
                f"{database.address.shown}: site {site!r} has no version {wanted}: {first} to "
                f"{newest}"
            )
        hypermap = skeleton_of(database, site_id, wanted, site)
        ids = ids_of_layers(database, site_id)
        filled = [
            read_layer(database, layer, ids[layer.name], wanted) if layer.name in ids else layer
            for layer in hypermap
        ]
    pulled = hypermap.with_layers(filled)
    if pulled.history is not None:  # which began with a skeleton
        pulled.history = begun(pulled, pulled.history)
    return pulled


def skeleton_of(database: Database, site_id: int, version: int, site: str) -> Hypermap:
    """Return the map of a version, with objects and cells left out."""
    files = valid_rows(database, tables.FILES, "name, content", site_id, version)
    return map_of_files(dict(files), f"{database.address.shown}, site {site!r}")


def ids_of_layers(database: Database, site_id: int) -> dict[str, int]:
    """Return the ids of a site's layers, also of former ones, by name."""
    return dict(database.rows("SELECT name, id FROM layers WHERE site_id = %s", site_id))


def read_layer(database: Database, layer: Layer, layer_id: int, version: int) -> Layer:
    """Return a layer of a skeleton with its content at a version."""
    if isinstance(layer, OccupancyLayer):
        return _read_occupancy(database, layer, layer_id, version)
    if isinstance(layer, SemanticLayer):
        return _read_semantic(database, layer, layer_id, version)
    return layer


def has_changed(database: Database, layer_id: int, version: int) -> bool:
    """Return whether anything in a layer has changed since a version of the site."""
    return any(
        database.rows(
            f"SELECT EXISTS (SELECT 1 FROM {table.name} WHERE layer_id = %s AND valid_from > %s) "
            f"OR EXISTS (SELECT 1 FROM {table.name} WHERE layer_id = %s AND valid_to > %s)",
            *(layer_id, version),
            *(layer_id, version),
        )[0][0]
        for table in _LAYER_TABLES
    )


def valid_rows(
    database: Database, table: tables.Table, columns: str, owner: int, version: int, order: str = ""
) -> list[rows.Row]:
    """Return the rows of an owner that were valid at a version.

    Args:
        database: the store.
        table: of versions.
        columns: words of ours, as all but the values is.
        owner: the id of the site or layer.
        version: of the site.
        order: a column to sort by.
    """
    # Two questions, as each can use an index.
    chosen = f"{columns}, {order} AS place" if order else columns
    each = f"SELECT {chosen} FROM {table.name} WHERE {table.owner} = %s AND valid_from <= %s AND "
    question = f"{each} valid_to IS NULL UNION ALL {each} valid_to > %s"
    if order:
        question = f"SELECT * FROM ({question}) AS valid ORDER BY place"
    found = database.rows(question, owner, version, owner, version, version)
    return [row[:-1] for row in found] if order else found


def _skeleton(hypermap: Hypermap) -> Hypermap:
    """Return the map without what the tables keep in rows."""
    return hypermap.with_layers(_emptied(layer) for layer in hypermap)


def _emptied(layer: Layer) -> Layer:
    if isinstance(layer, SemanticLayer):
        return SemanticLayer(
            layer.name, layer.frame_id, settings=layer.settings, rejected=layer.rejected
        )
    if isinstance(layer, OccupancyLayer):
        return OccupancyLayer(layer.name, layer.frame_id, settings=layer.settings)
    return layer


def _locked_or_new(cursor: Cursor[Any], database: Database, site: str) -> tuple[int, int]:
    """Let no other write to a site until the transaction ends; return its id and version.

    A site that is not there yet is made, with version 0.

    Raises:
        StoreError: If it has no name, or this user may not write to it.
    """
    where = database.address.shown
    if not site:
        raise StoreError(f"{where}: a site needs a name")
    if found := lock_site(cursor, site):
        return found
    cursor.execute(
        "INSERT INTO sites (name, version) VALUES (%s, 0) ON CONFLICT (name) DO NOTHING "
        "RETURNING id, version",
        (site,),
    )
    # Another may have made it in the meantime; else it is there, and not ours to write.
    if found := cursor.fetchone() or lock_site(cursor, site):
        return found
    raise StoreError(f"{where}: this user may not write to site {site!r}")


def _check_version(
    database: Database, site: str, version: int, update: bool, expected: int | None
) -> None:
    """Raise an error if a site must not be replaced; version 0 is that of a new one."""
    where = database.address.shown
    if not version and expected is not None:
        raise Conflict(f"{where}: there is no site {site!r} yet, nor its version {expected}")
    if version and not update:
        raise SiteExists(
            f"{where}: site {site!r} exists already, with version {version}; give --update to "
            "make the map its next version, or another name"
        )
    if version and expected is not None and version != expected:
        raise Conflict(f"{where}: site {site!r} has version {version} by now, not {expected}")


def _check_same_map(
    database: Database, hypermap: Hypermap, site_id: int, version: int, site: str
) -> None:
    """Raise a SiteExists if a site holds a map of another id."""
    there = skeleton_of(database, site_id, version, site).metadata.get(MAP_ID)
    given = hypermap.metadata.get(MAP_ID)
    if there is not None and there != given:
        raise SiteExists(
            f"{database.address.shown}: site {site!r} has another map, with the id {there}, not "
            f"{given or 'one without an id'}; give --another-map to replace it, or another name"
        )


def _layer_ids(cursor: Cursor[Any], site_id: int, hypermap: Hypermap) -> dict[str, int]:
    """Return the ids of the map's layers, made where they are new."""
    for layer in hypermap:
        cursor.execute(
            "INSERT INTO layers (site_id, name, kind, frame_id) VALUES (%s, %s, %s, %s) "
            "ON CONFLICT (site_id, name) DO UPDATE "
            "SET kind = EXCLUDED.kind, frame_id = EXCLUDED.frame_id",
            (site_id, layer.name, layer.class_name, layer.frame_id),
        )
    found = cursor.execute("SELECT name, id FROM layers WHERE site_id = %s", (site_id,)).fetchall()
    return {name: number for name, number in found if name in hypermap}


def add_layer(cursor: Cursor[Any], database: Database, site: str, layer: Layer) -> int:
    """Add an empty layer to a site, as a part of its next version; return its id.

    Args:
        cursor: in a transaction of this database.
        database: the store.
        site: the name of the site, which the transaction has locked.
        layer: of a name that the site has not.
    """
    site_id, version = find_site(database, site)
    before = skeleton_of(database, site_id, version, site)
    after = before.with_layers([*before, layer])
    tables.FILES.replace(cursor, site_id, version + 1, files_of_map(after).items())
    return _layer_ids(cursor, site_id, after)[layer.name]


def _write_layer(cursor: Cursor[Any], layer_id: int, layer: Layer, version: int) -> dict[str, int]:
    """Write what a layer holds in rows; return how many changed, by table."""
    content = _content(cursor, layer_id, layer)
    return {
        table.name: table.replace(cursor, layer_id, version, content.get(table.name, ()))
        for table in _LAYER_TABLES
    }


def _content(cursor: Cursor[Any], layer_id: int, layer: Layer) -> dict[str, Any]:
    if isinstance(layer, OccupancyLayer) and layer.grid is not None and layer.cells is not None:
        grid = [rows.row_of_grid(layer.grid, layer.cells)]
        return {"grids": grid, "tiles": rows.rows_of_cells(layer.cells)}
    if not isinstance(layer, SemanticLayer):
        return {}
    table, evidence = layer.table, layer.evidence()
    positions = _positions(cursor, layer_id, table.ids)
    cursor.execute(
        "UPDATE layers SET next_id = greatest(next_id, %s), "
        "next_position = greatest(next_position, %s) WHERE id = %s",
        (layer.next_id, int(positions.max(initial=-1)) + 1, layer_id),
    )
    content: dict[str, Any] = {
        "objects": rows.rows_of_objects(table, positions),
        "pictures": rows.rows_of_pictures(layer.pictures_by_id()),
    }
    if evidence is not None:
        content["views"] = rows.rows_of_views(evidence)
        content["observations"] = rows.rows_of_observations(evidence)
    return content


def _positions(cursor: Cursor[Any], layer_id: int, ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return places in the order of the layer that leave most rows of the store as they are."""
    cursor.execute(
        "SELECT id, position FROM objects WHERE layer_id = %s AND valid_to IS NULL", (layer_id,)
    )
    known = dict(cursor.fetchall())
    free = max(known.values(), default=-1) + 1
    kept = np.array([known.get(number, -1) for number in ids.tolist()], dtype=np.int64)
    new = np.flatnonzero(kept < 0)
    kept[new] = free + np.arange(len(new))
    return kept if (np.diff(kept) > 0).all() else np.arange(len(ids))


def _end_layers_but(
    cursor: Cursor[Any], site_id: int, layer_ids: Sequence[int], version: int
) -> None:
    """End the content of layers that the map has no more."""
    cursor.execute(
        "SELECT id FROM layers WHERE site_id = %s AND NOT id = ANY (%s)", (site_id, layer_ids)
    )
    for (layer_id,) in cursor.fetchall():
        for table in _LAYER_TABLES:
            table.replace(cursor, layer_id, version, ())


def _read_occupancy(
    database: Database, layer: OccupancyLayer, layer_id: int, version: int
) -> OccupancyLayer:
    columns = ", ".join(tables.GRIDS.columns)
    found = valid_rows(database, tables.GRIDS, columns, layer_id, version)
    if not found:
        return layer
    grid, kind = rows.grid_of(found[0])
    tiles = valid_rows(database, tables.TILES, "tile_row, tile_col, cells", layer_id, version)
    cells = rows.cells_of(tiles, grid, kind, UNKNOWN)
    return OccupancyLayer(layer.name, layer.frame_id, grid, cells, layer.settings)


def _read_semantic(
    database: Database, layer: SemanticLayer, layer_id: int, version: int
) -> SemanticLayer:
    found = valid_rows(database, tables.OBJECTS, rows.OBJECT, layer_id, version, "position")
    views = valid_rows(
        database, tables.VIEWS, "number, stamp, pose, area", layer_id, version, "number"
    )
    observations = valid_rows(
        database,
        tables.OBSERVATIONS,
        "object_id, view, score, lowest, highest, footprint",
        layer_id,
        version,
        "number",
    )
    pictures = valid_rows(database, tables.PICTURES, "object_id, content", layer_id, version)
    next_ids = database.rows("SELECT next_id FROM layers WHERE id = %s", layer_id)
    filled = SemanticLayer.of_table(
        layer.name,
        layer.frame_id,
        rows.table_of(found),
        layer.settings,
        layer.rejected,
        rows.evidence_of(views, observations) if views else None,
        next_ids[0][0],
    )
    filled.kept_pictures = rows.pictures_of(pictures)
    return filled
