"""The tables whose rows are valid from one version of a site to another, and how they change."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from psycopg import sql

if TYPE_CHECKING:
    from psycopg import Cursor

SRID = 990001
"""The coordinate system of all shapes: meters on the floor of one site."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table of rows that versions bring and replace.

    Attributes:
        name: of the table.
        owner: the column that says whose the rows are, `site_id` or `layer_id`.
        key: the columns by which a row of an owner is known.
        columns: name -> type in SQL, but for the owner and the versions.
    """

    name: str
    owner: str
    key: tuple[str, ...]
    columns: Mapping[str, str]

    def replace(
        self, cursor: Cursor[Any], owner: int, version: int, rows: Iterable[tuple[Any, ...]]
    ) -> int:
        """Let an owner have just these rows from a version on; equal rows stay as they are.

        Args:
            cursor: in a transaction.
            owner: the id of the site or layer.
            version: the new version.
            rows: values in the order of `columns`.

        Returns:
            How many rows were added, changed or removed.
        """
        self._bring(cursor, rows)
        ended = cursor.execute(self._statement(_END_OTHERS), (version, owner)).rowcount
        added = cursor.execute(self._statement(_ADD_MISSING), (owner, version, owner)).rowcount
        return max(ended, added)

    def put(
        self, cursor: Cursor[Any], owner: int, version: int, rows: Iterable[tuple[Any, ...]]
    ) -> None:
        """Let an owner have these rows from a version on, instead of those with the same keys."""
        self._bring(cursor, rows)
        cursor.execute(self._statement(_END_REPLACED), (version, owner))
        cursor.execute(self._statement(_ADD_ALL), (owner, version))

    def add(
        self, cursor: Cursor[Any], owner: int, version: int, rows: Iterable[tuple[Any, ...]]
    ) -> None:
        """Let an owner have these rows, of new keys, from a version on."""
        self._bring(cursor, rows)
        cursor.execute(self._statement(_ADD_ALL), (owner, version))

    def _bring(self, cursor: Cursor[Any], rows: Iterable[tuple[Any, ...]]) -> None:
        """Copy rows into a table of this session alone, which stays for the next time."""
        cursor.execute(self._statement(_INCOMING))
        cursor.execute(self._statement("DELETE FROM pg_temp.{incoming}"))
        copying = self._statement("COPY pg_temp.{incoming} FROM STDIN (FORMAT BINARY)")
        with cursor.copy(copying) as copy:
            copy.set_types([_COPIED_AS.get(kind, kind) for kind in self.columns.values()])
            for row in rows:
                copy.write_row(row)

    @functools.cache  # noqa: B019 - the tables are those of this module
    def _statement(self, text: str) -> sql.Composed:
        """Return a statement with the names of this table, all of which stand in this module."""
        names = [sql.Identifier(name) for name in self.columns]
        key = [sql.Identifier(name) for name in self.key]
        each = sql.SQL(", ")

        def of(table: str, columns: list[sql.Identifier]) -> sql.Composed:
            return each.join(sql.SQL(table) + column for column in columns)

        types = [sql.Identifier(name) + sql.SQL(f" {kind}") for name, kind in self.columns.items()]
        same_key = sql.SQL(" AND ").join(
            sql.SQL("old.") + column + sql.SQL(" = new.") + column for column in key
        )
        return sql.SQL(text).format(
            table=sql.Identifier("hypermap", self.name),
            incoming=sql.Identifier(f"incoming_{self.name}"),
            owner=sql.Identifier(self.owner),
            types=each.join(types),
            columns=each.join(names),
            new=of("new.", names),
            old=of("old.", names),
            same_key=same_key if key else sql.SQL("true"),
        )


_INCOMING = """
CREATE TEMPORARY TABLE IF NOT EXISTS {incoming} ({types}) ON COMMIT DELETE ROWS"""
_END_OTHERS = """
UPDATE {table} AS old SET valid_to = %s
WHERE old.{owner} = %s AND old.valid_to IS NULL AND NOT EXISTS (
    SELECT FROM pg_temp.{incoming} AS new
    WHERE {same_key} AND ({new}) IS NOT DISTINCT FROM ({old})
)"""
_ADD_MISSING = """
INSERT INTO {table} ({owner}, {columns}, valid_from)
SELECT %s, {new}, %s FROM pg_temp.{incoming} AS new
WHERE NOT EXISTS (
    SELECT FROM {table} AS old
    WHERE old.{owner} = %s AND old.valid_to IS NULL AND {same_key}
)"""
_END_REPLACED = """
UPDATE {table} AS old SET valid_to = %s FROM pg_temp.{incoming} AS new
WHERE old.{owner} = %s AND old.valid_to IS NULL AND {same_key}"""
_ADD_ALL = """
INSERT INTO {table} ({owner}, {columns}, valid_from)
SELECT %s, {new}, %s FROM pg_temp.{incoming} AS new"""

# What psycopg passes on as it is, because `rows` has put it into binary form.
_COPIED_AS = {"geometry": "bytea", "text[]": "bytea", "float8[]": "bytea"}

FILES = Table("files", "site_id", ("name",), {"name": "text", "content": "bytea"})
GRIDS = Table(
    "grids",
    "layer_id",
    (),
    {
        "width": "integer",
        "height": "integer",
        "resolution": "float8",
        "x": "float8",
        "y": "float8",
        "yaw": "float8",
        "kind": "text",
    },
)
TILES = Table(
    "tiles",
    "layer_id",
    ("tile_row", "tile_col"),
    {"tile_row": "integer", "tile_col": "integer", "cells": "bytea"},
)
OBJECTS = Table(
    "objects",
    "layer_id",
    ("id",),
    {
        "id": "integer",
        "position": "bigint",
        "name": "text",
        "shape": "geometry",
        "footprint": "bytea",
        "area": "float8",
        "x": "float8",
        "y": "float8",
        "tags": "text[]",
        "confidence": "float8[]",
        "existence": "float8",
        "first_seen": "float8",
        "last_seen": "float8",
        "attributes": "text",
    },
)
VIEWS = Table(
    "views",
    "layer_id",
    ("number",),
    {"number": "integer", "stamp": "float8", "pose": "bytea", "area": "bytea"},
)
OBSERVATIONS = Table(
    "observations",
    "layer_id",
    ("number",),
    {
        "number": "integer",
        "object_id": "integer",
        "view": "integer",
        "score": "float8",
        "lowest": "float8",
        "highest": "float8",
        "footprint": "bytea",
    },
)
PICTURES = Table(
    "pictures", "layer_id", ("object_id",), {"object_id": "integer", "content": "bytea"}
)
ALL = (FILES, GRIDS, TILES, OBJECTS, VIEWS, OBSERVATIONS, PICTURES)
"""All tables of versions."""
