"""Sends observations that wait in a spool to a store, and sets aside what it refuses."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.fleet.store.address import Address, ContentRefused
from hypermap.fleet.store.database import Database, psycopg
from hypermap.fleet.store.observed import Observed, apply_observed, parts_of
from hypermap.fleet.store.pushing import SiteExists, push
from hypermap.fleet.store.sites import SiteNotFound
from hypermap.fleet.store.spool import DamagedEntry, Spool

_log = logging.getLogger(__name__)

_PATIENCE = 1.0  # s between two tries to reach the database
_TRIES = 3  # of what a library fails at, until it is taken for the content's fault


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
