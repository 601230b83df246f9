"""Observations on their way to a store, in a local file until the store has them.

Each is written to the file before anyone tries to send it, and removed when the database has
confirmed it. It has an id by which the store knows one that it has already: nothing is lost and
nothing is stored twice, whichever side fails in between. What the store will never take is set
aside in the same file, so that it does not block what comes after it; `refused` shows, resends or
drops that.
"""

from __future__ import annotations

import base64
import contextlib
import json
import logging
import math
import sqlite3
import threading
import uuid
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.fleet.store.address import Address, ContentRefused
from hypermap.fleet.store.database import Database, psycopg
from hypermap.fleet.store.observed import Observed, apply_observed, parts_of
from hypermap.fleet.store.pushing import SiteExists, push
from hypermap.fleet.store.seen_cells import ChangedCells
from hypermap.fleet.store.sites import SiteNotFound
from hypermap.formats.semantic.evidence_file import dump_evidence, parse_evidence
from hypermap.formats.semantic.geojson import from_geojson, to_geojson
from hypermap.mapping.stages import OccupancyConfig

_log = logging.getLogger(__name__)

_REFUSED = (sqlite3.Error, UnicodeDecodeError)  # the latter for a message that quotes the damage
_CANNOT_WRITE = ("disk is full", "disk I/O error", "unable to open", "readonly")  # says SQLite
_WRONG = (
    *(ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError),
    zlib.error,
)
_PATIENCE = 1.0  # s between two tries to reach the database
_TRIES = 3  # of what a library fails at, until it is taken for the content's fault
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
        self._do("INSERT INTO waiting (content) VALUES (?)", _dump(observed))

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
                *(number, str(part.id), reason, _dump(part)),
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


class Delivery:
    """Sends what waits in a spool to a store, in a thread of its own, until it is closed."""

    def __init__(
        self, spool: Spool, address: Address, on_trouble: Callable[[str], None] = _log.warning
    ) -> None:
        self._spool = spool
        self._database = Database(address)
        self._on_trouble = on_trouble
        self._said = self._said_aside = ""
        self._said_dropped = False
        self._failed = (0, 0)  # an entry at which a library failed, and how often
        self._wakes = threading.Event()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="delivery", daemon=True)
        self._thread.start()

    def wake(self) -> None:
        """Say that something waits."""
        self._wakes.set()

    def close(self, patience: float = 5.0) -> int:
        """Send what can be sent within so many seconds, and end.

        Returns:
            How much still waits in the spool, for the next time.
        """
        self._ended.set()
        self._wakes.set()
        self._thread.join(patience)
        if not self._thread.is_alive():
            self._database.close()
        return len(self._spool)

    def _run(self) -> None:
        while True:
            is_last = self._ended.is_set()
            try:
                self._send_all()
                self._said = ""
            except HypermapError as error:  # away, or what an administrator can mend
                self._complain(f"{error}; observations wait in {self._spool.path}")
            except Exception as error:  # of any library below; this thread must not end in silence
                self._complain(
                    f"{type(error).__name__}: {error}; observations wait in {self._spool.path}"
                )
            if is_last:
                return
            self._wakes.wait(_PATIENCE)
            self._wakes.clear()

    def _send_all(self) -> None:
        while (found := self._first()) is not None:
            number, observed = found
            self._send(number, observed)
            self._spool.remove(number)

    def _first(self) -> tuple[int, Observed] | None:
        """Return what is to be sent next, and set aside what cannot be read before it."""
        while True:
            try:
                return self._spool.first()
            except DamagedEntry as error:  # noqa: PERF203 - damage is rare
                self._set_aside(error.number, str(error))
                self._spool.remove(error.number)

    def _send(self, number: int, observed: Observed) -> None:
        """Send an entry; of one that the store refuses, all parts that it takes."""
        try:
            deliver(self._database, observed)
        except ContentRefused as error:
            reason = str(error)
        except (HypermapError, OSError, MemoryError, psycopg.Error):  # not for its content
            raise
        except Exception as error:  # of any library below, which may be ill only now
            tries = self._failed[1] + 1 if self._failed[0] == number else 1
            self._failed = number, tries
            if tries < _TRIES:
                raise
            reason = f"{type(error).__name__}: {error}"
        else:
            return
        parts = parts_of(observed)
        if len(parts) == 1:
            self._set_aside(number, reason, observed)
        else:
            for part in parts:
                self._send(number, part)

    def _set_aside(self, number: int, reason: str, part: Observed | None = None) -> None:
        dropped, path = self._spool.set_aside(number, reason, part), self._spool.path
        if reason != self._said_aside:
            self._said_aside = reason
            self._on_trouble(
                f"{reason}; this was set aside, the rest is sent; see: hypermap refused {path}"
            )
        if dropped and not self._said_dropped:
            self._said_dropped = True
            self._on_trouble(f"{path}: keeps no more of what the store refused; drops the oldest")

    def _complain(self, text: str) -> None:
        """Say what is wrong, once until it is another."""
        if text != self._said:
            self._said = text
            self._on_trouble(text)


def deliver(database: Database, observed: Observed) -> None:
    """Put observations into the store; a site that is not there is made, empty.

    Raises:
        StoreAway: If the database does not answer.
        StoreError: If it refuses.
    """
    try:
        apply_observed(database, observed)
    except SiteNotFound:
        layers: list[Layer] = [SemanticLayer(observed.layer, "map")]
        if (cells := observed.cells) is not None:
            layers.insert(0, OccupancyLayer(cells.layer, cells.frame_id))
        with contextlib.suppress(SiteExists):  # if another robot has made it just now
            push(database, Hypermap(layers), observed.site, note=observed.source)
        apply_observed(database, observed)


def _dump(observed: Observed) -> str:
    layer = SemanticLayer(observed.layer, "map", observed.objects)
    evidence = observed.evidence
    content = None if evidence is None else base64.b64encode(dump_evidence(evidence)).decode()
    return json.dumps(
        {
            "id": str(observed.id),
            "site": observed.site,
            "source": observed.source,
            "objects": to_geojson(layer),
            "removed": [int(number) for number in observed.removed],
            "evidence": content,
            "cells": None if observed.cells is None else _dump_cells(observed.cells),
        }
    )


def _dump_cells(seen: ChangedCells) -> dict[str, Any]:
    grid = seen.grid
    return {
        "layer": seen.layer,
        "frame": seen.frame_id,
        "shape": grid.shape,
        "resolution": grid.resolution,
        "origin": [grid.origin.x, grid.origin.y, grid.origin.yaw],
        "content": base64.b64encode(zlib.compress(seen.cells.tobytes(), 1)).decode(),
    }


def _parse_cells(kept: Any) -> ChangedCells:
    height, width = kept["shape"]
    grid = GridGeometry(width, height, kept["resolution"], Pose2D(*kept["origin"]))
    if height * width > OccupancyConfig().max_cells:
        raise ValueError(f"{width} x {height} cells are too many")
    content = zlib.decompressobj().decompress(base64.b64decode(kept["content"]), height * width)
    cells = np.frombuffer(content, np.int8).reshape(height, width)
    return ChangedCells(str(kept["layer"]), str(kept["frame"]), grid, cells)


def _parse(content: bytes, path: Path, number: int) -> Observed:
    try:
        kept = json.loads(content)
        layer = from_geojson(kept["objects"])
        evidence = kept["evidence"]
        if evidence is not None:
            evidence = parse_evidence(base64.b64decode(evidence), str(path))
        cells = kept.get("cells")  # entries of earlier programs have none
        return Observed(
            str(kept["site"]),
            layer.name,
            str(kept["source"]),
            layer.objects(),
            [int(number) for number in kept["removed"]],
            evidence,
            None if cells is None else _parse_cells(cells),
            uuid.UUID(kept["id"]),
        )
    except (*_WRONG, FormatError) as error:
        raise DamagedEntry(f"is damaged: {error}", path, number) from None
