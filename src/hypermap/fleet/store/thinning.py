"""Old versions of sites are removed, with the rows that only they need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from psycopg import sql

from hypermap.fleet.store import tables
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.updates import locked_site

if TYPE_CHECKING:
    from psycopg import Cursor

DAY = 86400.0
"""How much of a site's history always stays [s]: by it, what a robot sends twice is known."""

_SIZES = " UNION ALL ".join(
    f"SELECT valid_to, sum(pg_column_size({table.name}.*)) FROM {table.name} "
    f"WHERE {table.owner} = ANY (%({table.owner})s) AND valid_to IS NOT NULL GROUP BY valid_to"
    for table in tables.ALL
)
_REMOVE = "DELETE FROM {table} WHERE {owner} = ANY (%s) AND valid_to IS NOT NULL AND valid_to <= %s"
# Robots' observations become history one by one, and their views with the last of them.
_REMOVE_VIEWS = """
DELETE FROM views WHERE layer_id = ANY (%s) AND valid_to IS NULL AND NOT EXISTS (
    SELECT FROM observations WHERE layer_id = views.layer_id AND view = views.number
)"""


@dataclass(frozen=True)
class Thinned:
    """What was removed of the history of a site.

    Attributes:
        site: the name of the site.
        first: the oldest version that is left.
        versions: how many versions were removed.
        rows: how many rows of all tables.
    """

    site: str
    first: int
    versions: int
    rows: int


def thin(
    database: Database, site: str, keep: float = 90 * DAY, max_mb: float | None = None
) -> Thinned:
    """Remove old versions of a site; the present one stays.

    Args:
        database: the store; its user must be an administrator.
        site: the name of the site.
        keep: versions that were written in so many seconds up to now stay [s].
        max_mb: of these, the newest that need so many megabytes in addition to the present one,
            and all of the last day; None for all.

    Raises:
        SiteNotFound: If there is no such site.
        StoreError: If this user may not remove anything.
        ValueError: If less than a day is to be kept.
    """
    if not keep >= DAY:
        raise ValueError(f"keep must be at least a day, got {keep} s")
    with database.transaction() as cursor:
        site_id, present = locked_site(cursor, database, site)
        cursor.execute("SELECT id FROM layers WHERE site_id = %s", (site_id,))
        owners = {"site_id": [site_id], "layer_id": [number for (number,) in cursor]}
        first = _first_since(cursor, site_id, present, keep)
        if max_mb is not None:
            of_size = _first_of_size(cursor, owners, 1e6 * max_mb)
            first = max(first, min(of_size, _first_since(cursor, site_id, present, DAY)))
        removed = 0
        for table in tables.ALL:
            statement = sql.SQL(_REMOVE).format(
                table=sql.Identifier(table.name), owner=sql.Identifier(table.owner)
            )
            removed += cursor.execute(statement, (owners[table.owner], first)).rowcount
        removed += cursor.execute(_REMOVE_VIEWS, (owners["layer_id"],)).rowcount
        versions = cursor.execute(
            "DELETE FROM versions WHERE site_id = %s AND version < %s", (site_id, first)
        ).rowcount
    return Thinned(site, first, versions, removed)


def _first_since(cursor: Cursor[Any], site_id: int, present: int, seconds: float) -> int:
    """Return the version that held so many seconds ago, or else the oldest one."""
    cursor.execute(
        "SELECT coalesce((SELECT max(version) FROM versions WHERE site_id = %(site)s "
        "AND at <= now() - make_interval(secs => %(seconds)s)), "
        "(SELECT min(version) FROM versions WHERE site_id = %(site)s), %(present)s)",
        {"site": site_id, "seconds": seconds, "present": present},
    )
    return int(cursor.fetchall()[0][0])


def _first_of_size(cursor: Cursor[Any], owners: dict[str, list[int]], most: float) -> int:
    """Return the oldest version for which the rows of former ones take no more bytes than that.

    It is 0 if all of them may stay.
    """
    sizes: dict[int, float] = {}  # by the version that replaced the rows
    for version, size in cursor.execute(_SIZES, owners).fetchall():
        sizes[version] = sizes.get(version, 0.0) + float(size)
    total = 0.0
    for version in sorted(sizes, reverse=True):
        total += sizes[version]
        if total > most:
            return version
    return 0
