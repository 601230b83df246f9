"""Creates the tables of a store, or brings them to this program's version."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from hypermap.core.errors import MissingExtra
from hypermap.fleet.store.address import Address, StoreError
from hypermap.fleet.store.database import connect, errors, psycopg, reason_of
from hypermap.fleet.store.tables import SRID

VERSION_TABLE = "store_version"
_FOLDER = Path(__file__).parent / "migrations"
_PATIENCE = 60_000  # ms, for another program


def migrate(address: Address) -> str:
    """Create the tables, indexes and roles of a store, or bring them to this program's version.

    Returns:
        The version of the schema.

    Raises:
        StoreError: If PostGIS is not installed, the user may not create tables and roles, a
            later program has made the store, or another is making it.
        MissingExtra: If Alembic is not installed.
    """
    try:
        from alembic import command
        from alembic.config import Config
        from alembic.script import ScriptDirectory
        from alembic.util.exc import CommandError
        from sqlalchemy import create_engine, exc, pool
    except ImportError:
        raise MissingExtra("making a store in PostgreSQL", "store") from None
    config = Config()
    config.set_main_option("script_location", str(_FOLDER).replace("%", "%%"))
    engine = create_engine(
        "postgresql+psycopg://", creator=lambda: connect(address), poolclass=pool.NullPool
    )
    try:
        with _turn(address):
            _add_extensions(address)
            with engine.begin() as connection:
                config.attributes["connection"] = connection
                command.upgrade(config, "head")
    except CommandError:
        raise StoreError(
            f"{address.shown}: a later version of Hypermap made this store; update Hypermap"
        ) from None
    except exc.DBAPIError as error:
        reason = reason_of(error.orig or error)
        raise StoreError(f"{address.shown}: cannot create the tables: {reason}") from None
    except psycopg.Error as error:
        reason = reason_of(error)
        raise StoreError(f"{address.shown}: cannot add PostGIS and the tables: {reason}") from None
    return ScriptDirectory.from_config(config).get_current_head() or ""


@contextlib.contextmanager
def _turn(address: Address) -> Iterator[None]:
    """Wait until no other program migrates the store; one that was killed may go on for a while."""
    with connect(address) as connection:
        connection.execute("SELECT set_config('lock_timeout', %s, false)", (f"{_PATIENCE}ms",))
        try:
            connection.execute("SELECT pg_advisory_lock(%s)", (SRID,))
        except errors.LockNotAvailable:
            raise StoreError(f"{address.shown}: another program is migrating it") from None
        yield


def _add_extensions(address: Address) -> None:
    with connect(address) as connection:
        try:
            with connection.transaction():
                connection.execute("CREATE SCHEMA IF NOT EXISTS hypermap")
                connection.execute("CREATE EXTENSION IF NOT EXISTS postgis SCHEMA public")
                connection.execute("CREATE EXTENSION IF NOT EXISTS btree_gist SCHEMA public")
        except (errors.FeatureNotSupported, errors.UndefinedFile):
            raise StoreError(
                f"{address.shown}: the server has no PostGIS; install it there: apt-get install "
                "postgresql-15-postgis-3"
            ) from None
        except errors.InsufficientPrivilege:
            raise StoreError(
                f"{address.shown}: this user may not add PostGIS; let an administrator run "
                "`hypermap migrate`"
            ) from None
