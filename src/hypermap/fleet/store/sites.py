"""The sites of a store, and the history of each."""

from __future__ import annotations

import json
import uuid
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from hypermap.core.errors import did_you_mean
from hypermap.fleet.store.address import StoreError
from hypermap.fleet.store.database import Database

if TYPE_CHECKING:
    from psycopg import Cursor

CHANNEL = "hypermap"
"""What followers listen to: the site and version of each change, as JSON."""


class SiteNotFound(StoreError):
    """The store has no site of that name."""


@dataclass(frozen=True)
class Site:
    """A site as a list of sites shows it.

    Attributes:
        name: unique in the store.
        version: the present one; the first is 1.
        objects: how many objects of all layers there are.
        changed: when the present version was written.
    """

    name: str
    version: int
    objects: int
    changed: datetime


@dataclass(frozen=True)
class Version:
    """An entry in the history of a site.

    Attributes:
        version: its number.
        at: when it was written, by the clock of the database.
        author: the user of the database who wrote it.
        note: what the author says of it.
        outcome: what it brought, such as {"added": 3}.
    """

    version: int
    at: datetime
    author: str
    note: str
    outcome: dict[str, Any]


def list_sites(database: Database) -> list[Site]:
    """Return all sites, by name."""
    rows = database.rows(
        """SELECT sites.name, sites.version, coalesce(counted.objects, 0), versions.at
        FROM sites JOIN versions ON versions.site_id = sites.id
            AND versions.version = sites.version
        LEFT JOIN (
            SELECT layers.site_id, count(*) AS objects FROM objects
            JOIN layers ON layers.id = objects.layer_id
            WHERE objects.valid_to IS NULL GROUP BY layers.site_id
        ) AS counted ON counted.site_id = sites.id
        ORDER BY sites.name"""
    )
    return [Site(*row) for row in rows]


def history(database: Database, site: str) -> list[Version]:
    """Return the versions of a site, the newest first.

    Raises:
        SiteNotFound: If there is no such site.
    """
    number, _ = find_site(database, site)
    rows = database.rows(
        "SELECT version, at, author, note, outcome FROM versions WHERE site_id = %s "
        "ORDER BY version DESC",
        number,
    )
    return [Version(*row) for row in rows]


def find_site(database: Database, site: str) -> tuple[int, int]:
    """Return the id and the present version of a site.

    Raises:
        SiteNotFound: If there is no such site.
    """
    rows = database.rows("SELECT id, version FROM sites WHERE name = %s", site)
    if not rows:
        raise no_site(database, site)
    return rows[0]


def oldest_version(database: Database, site_id: int) -> int:
    """Return the oldest version of a site that was not removed."""
    (oldest,) = database.rows("SELECT min(version) FROM versions WHERE site_id = %s", site_id)[0]
    return 1 if oldest is None else int(oldest)


def no_site(database: Database, site: str) -> SiteNotFound:
    """Return the error that there is no site of that name."""
    known = [name for (name,) in database.rows("SELECT name FROM sites ORDER BY name LIMIT 1000")]
    return SiteNotFound(
        f"{database.address.shown}: there is no site {site!r}; {did_you_mean(site, known)}"
    )


def lock_site(cursor: Cursor[Any], site: str) -> tuple[int, int] | None:
    """Let no other write to a site until the transaction ends; return its id and version.

    Returns:
        None if there is none of that name, or this user may not write to it.
    """
    cursor.execute("SELECT id, version FROM sites WHERE name = %s FOR UPDATE", (site,))
    return cursor.fetchone()


def add_version(
    cursor: Cursor[Any],
    site_id: int,
    version: int,
    update_id: uuid.UUID,
    note: str,
    outcome: dict[str, Any],
) -> None:
    """Record a version in the history, and notify listeners once the transaction ends."""
    cursor.execute("UPDATE sites SET version = %s WHERE id = %s", (version, site_id))
    cursor.execute(
        "INSERT INTO versions (site_id, version, update_id, note, outcome) "
        "VALUES (%s, %s, %s, %s, %s::jsonb)",
        (site_id, version, update_id, note, json.dumps(outcome)),
    )
    cursor.execute(
        "SELECT pg_notify(%s, json_build_object('site', name, 'version', version)::text) "
        "FROM sites WHERE id = %s",
        (CHANNEL, site_id),
    )
