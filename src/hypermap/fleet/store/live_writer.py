"""Writes to a store what a running mapper learns."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.evidence import EvidenceTable
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.fleet.store.address import Address, StoreError
from hypermap.fleet.store.delivery import Delivery
from hypermap.fleet.store.observed import Observed
from hypermap.fleet.store.seen_cells import changed_cells
from hypermap.fleet.store.spool import MOST_REFUSED_MB, Spool
from hypermap.text import counted

_EVERY = 1.0  # s


class Changes:
    """What is new in layers that grow, each time they are looked at."""

    def __init__(self, site: str, source: str) -> None:
        self._site = site
        self._source = source
        self._sent: dict[int, SemanticObject] = {}
        self._sent_rows: set[tuple[int, float]] = set()  # object and stamp of each observation
        self._sent_cells: OccupancyLayer | None = None

    def since_last(
        self, layer: SemanticLayer, walls: OccupancyLayer | None = None
    ) -> Observed | None:
        """Return what was learned since the last call; None if nothing was.

        Args:
            layer: the objects.
            walls: the occupancy layer; None if it is not made of what the robot sees.
        """
        now = {item.id or 0: item for item in layer}
        changed = [item for n, item in now.items() if not _is_same(self._sent.get(n), item)]
        removed = [number for number in self._sent if number not in now]
        evidence = self._new_evidence(layer)
        cells = None if walls is None else changed_cells(self._sent_cells, walls)
        self._sent, self._sent_cells = now, walls
        if not changed and not removed and evidence is None and cells is None:
            return None
        return Observed(self._site, layer.name, self._source, changed, removed, evidence, cells)

    def _new_evidence(self, layer: SemanticLayer) -> EvidenceTable | None:
        """Return the observations that were not sent before, also those of an object's start."""
        table = layer.evidence()
        if table is None or not len(table):
            return None
        keys = list(zip(table.object_ids.tolist(), table.stamps[table.views].tolist(), strict=True))
        rows = np.array([i for i, key in enumerate(keys) if key not in self._sent_rows], np.int64)
        if not len(rows):
            return None
        self._sent_rows.update(keys)
        views, view_of_row = np.unique(table.views[rows], return_inverse=True)
        return EvidenceTable(
            object_ids=table.object_ids[rows],
            views=view_of_row.astype(np.int64),
            scores=table.scores[rows],
            footprints=table.footprints[rows],
            heights=table.heights[rows],
            stamps=table.stamps[views],
            poses=table.poses[views],
            areas=table.areas[views],
        )


class LiveWriter:
    """Looks at a live map each second, and sends to a site of a store what is new.

    Args:
        layers: returns what is mapped at the moment: objects, and the occupancy layer, or None
            for it if it is not made of what the robot sees.
        address: of the site.
        spool: the file in which observations wait for the database.
        robot: the robot's name; each run counts as a source of its own.
        on_trouble: called with a line when the database is away or refuses.
        most_refused: how much of what the store refuses stays in the spool [MB].
    """

    def __init__(
        self,
        layers: Callable[[], tuple[SemanticLayer, OccupancyLayer | None]],
        address: Address,
        spool: Path,
        robot: str,
        on_trouble: Callable[[str], None],
        most_refused: float = MOST_REFUSED_MB,
    ) -> None:
        if address.site is None:
            raise StoreError(f"{address.shown}: name the site: ?site=SITE")
        self._layers = layers
        self._changes = Changes(address.site, f"{robot} {uuid.uuid4().hex[:8]}")
        self._spool = Spool(spool, most_refused)
        self._delivery = Delivery(self._spool, address, on_trouble)
        self._on_trouble = on_trouble
        self._left: Observed | None = None  # what the spool could not take
        self._said = ""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="store", daemon=True)
        self._thread.start()

    def close(self) -> int:
        """Send the rest, and end; return how much still waits in the spool.

        Raises:
            HypermapError: If the spool cannot be read.
        """
        self._ended.set()
        self._thread.join()
        if self._left is not None:
            self._on_trouble(f"{self._said}; the last observations are lost")
        try:
            waiting = self._delivery.close()
            if aside := self._spool.aside:
                self._on_trouble(self._said_of_refused(aside, self._spool.dropped))
            return waiting
        finally:
            self._spool.close()

    def _said_of_refused(self, aside: int, dropped: int) -> str:
        was = counted(aside, "part was", "parts were")
        older = counted(dropped, "older one was", "older ones were")
        more = f", and {older} dropped" if dropped else ""
        see = f"see: hypermap refused {self._spool.path}"
        return f"{was} refused by the store, in all runs{more}; {see}"

    def _run(self) -> None:
        while not self._ended.wait(_EVERY):
            self._look()
        for _ in range(2):  # what was left, and what is new
            self._look()

    def _look(self) -> None:
        """Put what is new into the spool; what it cannot take is tried again the next time."""
        if self._left is None:
            self._left = self._changes.since_last(*self._layers())
        if self._left is None:
            return
        try:
            self._spool.put(self._left)
        except HypermapError as error:
            if str(error) != self._said:
                self._said = str(error)
                self._on_trouble(f"{error}; observations wait in memory")
            return
        self._left, self._said = None, ""
        self._delivery.wake()


def _is_same(one: SemanticObject | None, other: SemanticObject) -> bool:
    if one is None:
        return False
    keys = ("name", "tags", "confidence", "existence", "first_seen", "last_seen", "attributes")
    is_same = all(getattr(one, key) == getattr(other, key) for key in keys)
    return is_same and one.footprint.equals_exact(other.footprint, 0.0)
