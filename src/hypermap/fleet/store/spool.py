"""Observations on their way to a store, in a local file until the store has them.

Each is written to the file before anyone tries to send it, and removed when the database has
confirmed it. It has an id by which the store knows one that it has already: nothing is lost and
nothing is stored twice, whichever side fails in between. What the store will never take is set
aside in the same file, so that it does not block what comes after it; `refused` shows, resends or
drops that.
"""

from __future__ import annotations

import contextlib
import math
import sqlite3
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypermap.core.errors import FormatError, HypermapError
from hypermap.fleet.store.observed import Observed
from hypermap.fleet.store.observed_json import dump_observed, parse_observed

_REFUSED = (sqlite3.Error, UnicodeDecodeError)  # the latter for a message that quotes the damage
_CANNOT_WRITE = ("disk is full", "disk I/O error", "unable to open", "readonly")  # says SQLite
_TABLES = (
    "CREATE TABLE IF NOT EXISTS waiting "
    "(number INTEGER PRIMARY KEY AUTOINCREMENT, content TEXT NOT NULL)",
    "CREATE TABLE IF NOT EXISTS refused (number INTEGER, part TEXT, reason TEXT NOT NULL, "
    "content TEXT NOT NULL, PRIMARY KEY (number, part))",
)
# All that is refused but the newest, and the newest that fit into so many bytes. What is refused is
# stored as BLOB, whose length SQLite knows without reading it.
_DROP_OLDEST = """DELETE FROM refused WHERE rowid IN (
    SELECT rowid FROM (SELECT rowid, row_number() OVER newest AS place,
        sum(length(content)) OVER newest AS total FROM refused
        WINDOW newest AS (ORDER BY rowid DESC))
    WHERE place > 1 AND total > ?) RETURNING rowid"""

MOST_REFUSED_MB = 100.0
"""How much of what the store refused is kept in a spool, the newest."""


class DamagedEntry(FormatError):
    """An entry of a spool cannot be read.

    Attributes:
        number: of the entry.
    """

    def __init__(self, message: str, path: Path, number: int) -> None:
        super().__init__(message, path=path, key=f"entry {number}")
        self.number = number


@dataclass(frozen=True)
class Refused:
    """What a store refused, as it is kept in a spool.

    Attributes:
        number: of this part, in this file.
        reason: why it was refused.
        content: as the spool keeps it; `observed` reads it.
    """

    number: int
    reason: str
    content: bytes = field(repr=False)


class Spool:
    """A file of observations in the order in which they were put.

    Args:
        path: of the file, which is made if it is not there.
        most_refused: how much of what a store refused stays [MB]; the oldest is dropped.

    Raises:
        HypermapError: If the file cannot be opened, or is not a spool, or if nothing can be as
            large as `most_refused`.
    """

    def __init__(self, path: Path, most_refused: float = MOST_REFUSED_MB) -> None:
        if not 0 <= most_refused < math.inf:
            raise HypermapError(
                f"{path}: what the store refuses cannot fill {most_refused:g} MB; "
                "--refused-mb is 0 or more"
            )
        self.path = path
        self._most_refused = int(most_refused * 1e6)
        self._lock = threading.Lock()
        try:
            self._file = _open(path)
        except _REFUSED as error:
            raise HypermapError(
                f"{path}: cannot keep observations in this file: {_described(error)}"
            ) from None

    def put(self, observed: Observed) -> None:
        """Write observations to the file.

        Raises:
            HypermapError: If it cannot be written, as on a full disk.
        """
        self._do("INSERT INTO waiting (content) VALUES (?)", dump_observed(observed))

    def first(self) -> tuple[int, Observed] | None:
        """Return the number and the content of what has waited longest; None if nothing waits.

        Raises:
            DamagedEntry: If it cannot be read.
            HypermapError: If the file is damaged.
        """
        rows = self._do(  # as bytes: damage need not be UTF-8
            "SELECT number, CAST(content AS BLOB) FROM waiting ORDER BY number LIMIT 1"
        )
        return (rows[0][0], _parse(rows[0][1], self.path, rows[0][0])) if rows else None

    def remove(self, number: int) -> None:
        """Forget what the store has.

        Raises:
            HypermapError: If the file cannot be written.
        """
        self._do("DELETE FROM waiting WHERE number = ?", number)

    def set_aside(self, number: int, reason: str, part: Observed | None = None) -> int:
        """Keep an entry, or a part of it, where it blocks nothing; the entry stays until removed.

        Returns:
            How many older parts had to be dropped for it.

        Raises:
            HypermapError: If the file cannot be written.
        """
        if part is None:
            self._do(
                "INSERT OR REPLACE INTO refused SELECT number, '', ?, CAST(content AS BLOB) "
                "FROM waiting WHERE number = ?",
                *(reason, number),
            )
        else:
            self._do(
                "INSERT OR REPLACE INTO refused VALUES (?, ?, ?, CAST(? AS BLOB))",
                *(number, str(part.id), reason, dump_observed(part)),
            )
        dropped = len(self._do(_DROP_OLDEST, self._most_refused))
        if dropped:  # the file's own number for its user counts them
            self._do(f"PRAGMA user_version = {self.dropped + dropped}")
        return dropped

    def refused(self) -> list[Refused]:
        """Return what was set aside, the oldest first.

        Raises:
            HypermapError: If the file is damaged.
        """
        rows = self._do("SELECT rowid, reason, CAST(content AS BLOB) FROM refused ORDER BY rowid")
        return [Refused(*row) for row in rows]

    def observed(self, refused: Refused) -> Observed:
        """Return the observations of what was set aside.

        Raises:
            DamagedEntry: If they cannot be read.
        """
        return _parse(refused.content, self.path, refused.number)

    def forget(self, refused: Refused) -> None:
        """Drop what was set aside, or what the store has taken after all.

        Raises:
            HypermapError: If the file cannot be written.
        """
        self._do("DELETE FROM refused WHERE rowid = ?", refused.number)

    @property
    def aside(self) -> int:
        """Return how much was set aside."""
        return int(self._do("SELECT count(*) FROM refused")[0][0])

    @property
    def dropped(self) -> int:
        """Return how much of what was set aside had to be dropped, ever."""
        return int(self._do("PRAGMA user_version")[0][0])

    def __len__(self) -> int:
        return int(self._do("SELECT count(*) FROM waiting")[0][0])

    def close(self) -> None:
        """Close the file; what waits stays in it."""
        with self._lock:
            self._file.close()

    def _do(self, statement: str, *values: object) -> list[Any]:
        try:
            with self._lock:
                return self._file.execute(statement, values).fetchall()
        except _REFUSED as error:
            raise HypermapError(f"{self.path}: {_described(error)}") from None


def _described(error: Exception) -> str:
    """Return what SQLite says, with a remedy where it cannot write."""
    if any(words in str(error) for words in _CANNOT_WRITE):
        return f"{error}; free space there, check its permissions, or choose another file (--spool)"
    return str(error)


def _open(path: Path) -> sqlite3.Connection:
    with contextlib.ExitStack() as closing:
        file = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        closing.callback(file.close)
        file.execute("PRAGMA synchronous = FULL")
        names = {name for (name,) in file.execute("SELECT name FROM sqlite_master")}
        if names and "waiting" not in names:
            raise sqlite3.DatabaseError("it is a database of something else")
        for statement in _TABLES:
            file.execute(statement)
        closing.pop_all()
    return file


def _parse(content: bytes, path: Path, number: int) -> Observed:
    try:
        return parse_observed(content)
    except FormatError as error:
        raise DamagedEntry(str(error), path, number) from None
