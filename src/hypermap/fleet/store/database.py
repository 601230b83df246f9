"""A connection to the database of a store, whose errors are single lines without passwords."""

from __future__ import annotations

import contextlib
import threading
import weakref
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hypermap.core.errors import MissingExtra
from hypermap.fleet.store.address import Address, ContentRefused, StoreAway, StoreError

try:
    import psycopg
    from psycopg import errors
except ImportError:  # the whole package rests on it
    raise MissingExtra("a store in PostgreSQL", "store") from None

if TYPE_CHECKING:
    from psycopg import Connection, Cursor
    from typing_extensions import LiteralString

__all__ = ["SCHEMA_VERSION", "Database", "connect", "errors", "psycopg", "reason_of"]

SCHEMA_VERSION = "2"
"""The newest of `migrations/versions`, which this program reads and writes."""

# PostGIS raises the last. Others of its kind are of the disk, or of a database that is read only.
_OF_CONTENT = (
    *(psycopg.DataError, psycopg.IntegrityError, errors.ProgramLimitExceeded),
    errors.InternalError_,
)
_OF_THE_QUESTION = ("LINE ", "^", "CONTEXT")
# What refuses a connection now, and not later; the driver has no code for it.
_FOR_NOW = (
    *("starting up", "shutting down", "in recovery mode", "not yet accepting connections"),
    *("too many", "connection slots are reserved"),
)
_CONNECT_SECONDS = 10
# No jit: it takes longer than a look-up by indexes.
_SESSION = (
    "-c search_path=hypermap,public -c timezone=UTC -c plan_cache_mode=force_custom_plan -c jit=off"
)


class Database:
    """One connection; it is made at the first question, and once again when it is lost.

    Threads may share it; they ask one after the other.
    """

    def __init__(self, address: Address) -> None:
        self.address = address
        self._lock = threading.RLock()
        self._depth = 0  # of `transaction`
        self._held: list[Connection[Any]] = []  # one, or none
        # Not `__del__`: in a reference cycle, Python may finalize the connection before this.
        weakref.finalize(self, _close, self._held)

    def rows(self, sql: LiteralString, *values: Any, **named: Any) -> list[tuple[Any, ...]]:
        """Return the rows of a question that changes nothing, with values or named values.

        It is asked again, once, if the connection turns out to be lost.

        Raises:
            StoreAway: If the database does not answer.
            StoreError: If it refuses.
        """
        with self._lock:
            try:
                return self._rows(sql, named or values)
            except StoreAway:
                if self._depth:
                    raise
                self.close()
                return self._rows(sql, named or values)

    def _rows(
        self, sql: LiteralString, values: Sequence[Any] | Mapping[str, Any]
    ) -> list[tuple[Any, ...]]:
        connection = self.connected()
        with self.explained(), connection.cursor(binary=True) as cursor:
            return cursor.execute(sql, values).fetchall()

    @contextlib.contextmanager
    def snapshot(self) -> Iterator[None]:
        """Let all questions within see the store at one moment."""
        with self._lock:
            if self._depth:  # within a moment already
                yield
                return
            connection = self.connected()
            connection.isolation_level = psycopg.IsolationLevel.REPEATABLE_READ
            try:
                with self.transaction():
                    yield
            finally:
                if not connection.closed:
                    connection.isolation_level = None

    @contextlib.contextmanager
    def transaction(self) -> Iterator[Cursor[Any]]:
        """Do all within, or nothing.

        Raises:
            StoreAway: If the connection is lost: whether all or nothing was done is not known.
            StoreError: If the database refuses something.
        """
        with self._lock:
            connection = self.connected()
            self._depth += 1
            try:
                with (
                    self.explained(),
                    connection.transaction(),
                    connection.cursor(binary=True) as cursor,
                ):
                    yield cursor
            finally:
                self._depth -= 1

    def connected(self) -> Connection[Any]:
        """Return the connection, to a store of this program's schema.

        Raises:
            StoreAway: If the database does not answer.
            StoreError: If it refuses, or holds no store that this program knows.
        """
        with self._lock:
            if not self._held or self._held[0].closed:
                self._held[:] = [connect(self.address)]
                try:
                    with self.explained():
                        self._check_schema(self._held[0])
                except StoreError:
                    self.close()
                    raise
            return self._held[0]

    def _check_schema(self, connection: Connection[Any]) -> None:
        where = self.address.shown
        try:
            row = connection.execute("SELECT version_num FROM hypermap.store_version").fetchone()
        except (errors.UndefinedTable, errors.InvalidSchemaName):
            row = None
        except errors.InsufficientPrivilege:
            raise StoreError(
                f"{where}: this user may not read the store; an administrator gives it a role: "
                "GRANT hypermap_reader TO ..."
            ) from None
        if row is None:
            raise StoreError(f"{where}: there is no store yet; make one: hypermap migrate URL")
        if row[0] != SCHEMA_VERSION:
            raise StoreError(
                f"{where}: the store has schema version {row[0]}, this program needs "
                f"{SCHEMA_VERSION}: {_remedy(row[0])}"
            )

    @contextlib.contextmanager
    def explained(self) -> Iterator[None]:
        """Turn errors of the driver into ours."""
        try:
            yield
        except errors.InsufficientPrivilege as error:
            raise StoreError(f"{self.address.shown}: not allowed: {reason_of(error)}") from None
        except _OF_CONTENT as error:
            raise ContentRefused(f"{self.address.shown}: {reason_of(error)}") from None
        except (psycopg.OperationalError, psycopg.InterfaceError) as error:
            if not self._held or self._held[0].closed or self._held[0].broken:
                reason = reason_of(error)
                raise StoreAway(
                    f"{self.address.shown}: the database cannot be reached: {reason}"
                ) from None
            raise StoreError(f"{self.address.shown}: {reason_of(error)}") from None
        except psycopg.InternalError as error:
            raise StoreError(f"{self.address.shown}: {reason_of(error)}") from None
        except UnicodeEncodeError as error:
            text = error.object[:60]
            raise ContentRefused(
                f"{self.address.shown}: {text!r} is not valid Unicode and cannot be stored"
            ) from None

    def close(self) -> None:
        """Close the connection; a later question makes another."""
        with self._lock:
            _close(self._held)


def _close(held: list[Connection[Any]]) -> None:
    while held:
        held.pop().close()


def connect(address: Address) -> Connection[Any]:
    """Return a new connection, in which every statement is a transaction of its own.

    Raises:
        StoreAway: If nothing answers at the address.
        StoreError: If the database refuses, as for a wrong password.
    """
    given = psycopg.conninfo.conninfo_to_dict(address.database)
    more = {
        "options": f"{given.get('options') or ''} {_SESSION}".strip(),
        "connect_timeout": given.get("connect_timeout") or _CONNECT_SECONDS,
        "application_name": given.get("application_name") or "hypermap",
    }
    try:
        return psycopg.connect(
            psycopg.conninfo.make_conninfo(address.database, **more), autocommit=True
        )
    except psycopg.OperationalError as error:
        reason = reason_of(error)
        if password := given.get("password"):
            reason = reason.replace(str(password), "***")
        is_refusal = "FATAL:" in reason and not any(words in reason for words in _FOR_NOW)
        kind = StoreError if is_refusal else StoreAway
        raise kind(f"{address.shown}: cannot connect: {reason}") from None


def _remedy(version: str) -> str:
    """Return what to do about a store of another schema version; versions are counted from 1."""
    is_older = version.isdecimal() and int(version) < int(SCHEMA_VERSION)
    return "hypermap migrate URL" if is_older else "update Hypermap"


def reason_of(error: BaseException) -> str:
    """Return the first lines of an error, without what the program has asked."""
    lines = [line.strip() for line in str(error).splitlines()]
    shown = [line for line in lines if line and not line.startswith(_OF_THE_QUESTION)]
    if isinstance(error, errors.DiskFull):
        return f"the disk of the database is full; free space there, and try again ({shown[0]})"
    return "; ".join(shown)
