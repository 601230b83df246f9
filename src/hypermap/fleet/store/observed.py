"""What robots that map have seen, put into a site that several of them map at once.

Each robot numbers its objects itself; the table `tracks` says which object of the site each is. Two
robots' objects of one name that overlap are one object: its shape is fused from the observations of
all of them, and its log-odds of existence are added. What a person has changed stays.
"""

from __future__ import annotations

import dataclasses
import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from psycopg import sql

from hypermap.core.evidence import EvidenceTable
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.fleet.store import rows, tables
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.seen_cells import ChangedCells, layer_for_cells, put_cells
from hypermap.fleet.store.sites import add_version
from hypermap.fleet.store.updates import layer_to_write, locked_site
from hypermap.mapping.evidence_table import config_of, fused_shapes
from hypermap.mapping.stages import EvidenceConfig

if TYPE_CHECKING:
    from psycopg import Cursor
    from typing_extensions import LiteralString

SAME = 0.25
"""From which IoU on objects of one name that two robots see are the same."""

MOST_EVIDENCE = EvidenceConfig().max_evidence
"""How many observations of each object stay, the newest, as in a robot's own map."""

_END_OLD = """
UPDATE observations SET valid_to = %(version)s
FROM (
    SELECT number AS place, row_number() OVER (PARTITION BY object_id ORDER BY number DESC) AS age
    FROM observations
    WHERE layer_id = %(layer)s::integer AND valid_to IS NULL AND object_id = ANY (%(ids)s)
) AS aged
WHERE layer_id = %(layer)s::integer AND valid_to IS NULL AND number = place AND age > %(most)s"""
_END_OF_REMOVED = """
UPDATE observations SET valid_to = %(version)s
WHERE layer_id = %(layer)s::integer AND valid_to IS NULL AND object_id = ANY (%(ids)s)
    AND NOT EXISTS (
        SELECT FROM objects WHERE layer_id = %(layer)s::integer AND valid_to IS NULL
            AND id = observations.object_id
    )"""


@dataclass(frozen=True, eq=False)
class Observed:
    """What a robot has learned since the last time.

    Attributes:
        site: the name of the site.
        layer: the name of a semantic layer.
        source: the name of the robot, or of its run.
        objects: new or changed ones, with the robot's own ids.
        removed: the robot's ids of objects that are no more.
        evidence: observations since the last time, with the robot's ids; None for none.
        cells: of the occupancy layer, that have changed since the last time; None for none.
        id: made by the robot, so that the same sent twice is done once.
    """

    site: str
    layer: str
    source: str
    objects: Sequence[SemanticObject] = ()
    removed: Sequence[int] = ()
    evidence: EvidenceTable | None = None
    cells: ChangedCells | None = None
    id: uuid.UUID = field(default_factory=uuid.uuid4)


def parts_of(observed: Observed) -> list[Observed]:
    """Return the same observations in two parts; one alone cannot be divided.

    The parts have ids that follow from that of the whole, so that they are stored once, too.
    """
    evidence = observed.evidence
    seen = set() if evidence is None else set(evidence.object_ids.tolist())
    ids = sorted({item.id or 0 for item in observed.objects} | set(observed.removed) | seen)
    if observed.cells is not None and ids:
        halves: list[Sequence[int]] = [ids, ()]
    elif len(ids) > 1:
        halves = [ids[: len(ids) // 2], ids[len(ids) // 2 :]]
    else:
        return [observed]
    return [_part(observed, set(half), number) for number, half in enumerate(halves)]


def _part(observed: Observed, ids: set[int], number: int) -> Observed:
    """Return what concerns some of a robot's objects; without any, the cells."""
    evidence = None if observed.evidence is None else observed.evidence.of(sorted(ids))
    return dataclasses.replace(
        observed,
        objects=[item for item in observed.objects if (item.id or 0) in ids],
        removed=[each for each in observed.removed if each in ids],
        evidence=evidence if evidence is not None and len(evidence) else None,
        cells=None if ids else observed.cells,
        id=uuid.uuid5(observed.id, str(number)),
    )


@dataclass
class _Track:
    """A row of `tracks`, and whether it is new."""

    object_id: int
    written: int
    is_new: bool = False


def apply_observed(database: Database, observed: Observed) -> Mapping[str, int]:
    """Write what a robot has seen into the store; what is there already is not written again.

    Returns:
        How many objects were "added", "changed", "merged" with those of others, "removed", and
        "kept" as a person has left them; and how many "tiles" of cells have changed.

    Raises:
        SiteNotFound, LayerNotFound: If there is no such site or layer.
        StoreAway: If the connection is lost; try again with the same.
        StoreError: If this user may not write to the site.
    """
    with database.transaction() as cursor:
        site_id, before = locked_site(cursor, database, observed.site)
        # Not before: another connection, lost to us, may just be writing the same.
        cursor.execute("SELECT outcome FROM versions WHERE update_id = %s", (observed.id,))
        if done := cursor.fetchone():
            outcome: dict[str, int] = done[0]
            return outcome
        layer_id = layer_to_write(cursor, site_id, observed.layer)
        writing = _Writing(cursor, layer_id, before + 1, observed)
        outcome = writing.run()
        if observed.cells is not None:
            cells_id = layer_for_cells(cursor, database, observed.site, observed.cells)
            if count := put_cells(cursor, cells_id, before + 1, observed.cells):
                outcome["tiles"] = count
        add_version(cursor, site_id, before + 1, observed.id, observed.source, outcome)
    return outcome


class _Writing:
    """One transaction, step by step."""

    def __init__(
        self, cursor: Cursor[Any], layer_id: int, version: int, observed: Observed
    ) -> None:
        self._cursor = cursor
        self._layer_id = layer_id
        self._version = version
        self._observed = observed
        self._tracks = self._known_tracks()
        self._counts = dict.fromkeys(("added", "changed", "merged", "removed", "kept"), 0)

    def run(self) -> dict[str, int]:
        """Do all of it, and return what became of the objects."""
        self._associate()
        self._add_evidence()
        self._write_objects()
        self._remove(self._observed.removed)
        return {name: count for name, count in self._counts.items() if count}

    def _known_tracks(self) -> dict[int, _Track]:
        evidence = self._observed.evidence
        ids = {item.id for item in self._observed.objects} | set(self._observed.removed)
        ids |= set() if evidence is None else set(evidence.object_ids.tolist())
        self._cursor.execute(
            "SELECT local_id, object_id, written FROM tracks WHERE layer_id = %s AND source = %s "
            "AND local_id = ANY (%s)",
            (self._layer_id, self._observed.source, list(ids)),
        )
        return {local: _Track(number, written) for local, number, written in self._cursor}

    # Which object of the site each is

    def _associate(self) -> None:
        """Find the object of the site that each of the robot's is, or make it a new one."""
        new = [item for item in self._observed.objects if (item.id or 0) not in self._tracks]
        for item in new:
            track = self._same_of_others(item)
            if track is not None:
                self._tracks[item.id or 0] = track
                self._counts["merged"] += 1
        unknown = [item.id or 0 for item in new if (item.id or 0) not in self._tracks]
        first = self._reserved("next_id", len(unknown))
        for number, local in enumerate(unknown, first):
            self._tracks[local] = _Track(number, 0, is_new=True)
        self._counts["added"] += len(unknown)
        self._cursor.executemany(
            "INSERT INTO tracks VALUES (%s, %s, %s, %s, %s, %s, %s, %s) "
            "ON CONFLICT (layer_id, source, local_id) DO UPDATE "
            "SET existence = EXCLUDED.existence, first_seen = EXCLUDED.first_seen, "
            "last_seen = EXCLUDED.last_seen",
            [self._track_row(item) for item in self._observed.objects],
        )

    def _track_row(self, item: SemanticObject) -> tuple[Any, ...]:
        track = self._tracks[item.id or 0]
        key = (self._layer_id, self._observed.source, item.id or 0)
        return *key, track.object_id, track.written, item.existence, item.first_seen, item.last_seen

    def _reserved(self, column: str, count: int) -> int:
        """Return the first of some numbers that are unused in a layer."""
        self._cursor.execute(
            sql.SQL("UPDATE layers SET {0} = {0} + %s WHERE id = %s RETURNING {0} - %s").format(
                sql.Identifier(column)
            ),
            (count, self._layer_id, count),
        )
        return int(self._cursor.fetchall()[0][0])

    def _same_of_others(self, item: SemanticObject) -> _Track | None:
        """Return the object of the site that overlaps the robot's the most, and enough."""
        self._cursor.execute(
            f"""SELECT id, valid_from, ST_AsBinary(shape),
                (SELECT max(written) FROM tracks
                WHERE tracks.layer_id = objects.layer_id AND object_id = objects.id)
            FROM objects WHERE layer_id = %s::integer AND valid_to IS NULL AND name = %s
                AND shape && ST_MakeEnvelope(%s, %s, %s, %s, {tables.SRID})
                AND NOT EXISTS (SELECT FROM tracks WHERE tracks.layer_id = objects.layer_id
                    AND object_id = objects.id AND source = %s)""",
            (self._layer_id, item.name, *item.footprint.bounds, self._observed.source),
        )
        best, best_iou = None, SAME
        (shape,) = ObjectTable.of([item]).shapes
        for number, version, wkb, written in self._cursor:
            other = shapely.from_wkb(wkb)
            common = shapely.area(shapely.intersection(shape, other))
            iou = common / max(shape.area + other.area - common, 1e-12)
            if iou >= best_iou:
                # Objects without a mapper were made by hand or in another run, and stay unchanged.
                best, best_iou = _Track(number, version if written == version else -1), iou
        return best

    # What was observed

    def _add_evidence(self) -> None:
        evidence = self._observed.evidence
        if evidence is None:
            return
        known = [local for local in evidence.object_ids.tolist() if local in self._tracks]
        kept = evidence.of(known).rounded()
        ids = np.array([self._tracks[n].object_id for n in kept.object_ids.tolist()], np.int64)
        kept = dataclasses.replace(kept, object_ids=ids)
        first_view = self._next_number(
            "SELECT max(number) FROM views WHERE layer_id = %s::integer AND valid_to IS NULL"
        )
        first = self._next_number(
            "SELECT max(number) FROM observations WHERE layer_id = %s::integer AND valid_to IS NULL"
        )
        if len(kept):
            views = rows.rows_of_views(kept, first_view)
            observations = rows.rows_of_observations(kept, first, first_view)
            tables.VIEWS.add(self._cursor, self._layer_id, self._version, views)
            tables.OBSERVATIONS.add(self._cursor, self._layer_id, self._version, observations)
            self._end_observations(_END_OLD, set(ids.tolist()))

    def _end_observations(self, statement: LiteralString, ids: Iterable[int]) -> None:
        """Let some observations of objects be history, which `thin` bounds."""
        values = {"version": self._version, "layer": self._layer_id, "ids": list(ids)}
        self._cursor.execute(statement, {**values, "most": MOST_EVIDENCE})

    def _next_number(self, question: str) -> int:
        self._cursor.execute(question, (self._layer_id,))
        (largest,) = self._cursor.fetchall()[0]
        return 0 if largest is None else int(largest) + 1

    # The objects

    def _write_objects(self) -> None:
        given = {self._tracks[item.id or 0].object_id: item for item in self._observed.objects}
        now = self._rows_now(given)
        of_all = self._of_all(given)
        free = self._reserved("next_position", len(given))
        written, positions = [], []
        for number, item in given.items():
            track = self._tracks[item.id or 0]
            position, version = now.get(number, (None, None))
            if not track.is_new and version != track.written:
                self._counts["kept"] += 1
                continue
            if position is None:
                position, free = free, free + 1
            else:
                self._counts["changed"] += 1
            written.append(of_all.get(number, item).with_id(number))
            positions.append(position)
        table = ObjectTable.of(written)
        objects = rows.rows_of_objects(table, np.array(positions, dtype=np.int64))
        tables.OBJECTS.put(self._cursor, self._layer_id, self._version, objects)
        self._cursor.execute(
            "UPDATE tracks SET written = %s WHERE layer_id = %s AND object_id = ANY (%s)",
            (self._version, self._layer_id, table.ids.tolist()),
        )

    def _rows_now(self, ids: Iterable[int]) -> dict[int, tuple[int, int]]:
        """Return position and version of objects, by id."""
        self._cursor.execute(
            "SELECT id, position, valid_from FROM objects WHERE layer_id = %s "
            "AND valid_to IS NULL AND id = ANY (%s)",
            (self._layer_id, list(ids)),
        )
        return {number: (position, version) for number, position, version in self._cursor}

    def _of_all(self, given: Mapping[int, SemanticObject]) -> dict[int, SemanticObject]:
        """Return the objects that several robots see, as all of them together have seen them."""
        self._cursor.execute(
            "SELECT object_id, sum(existence), min(first_seen), max(last_seen) FROM tracks "
            "WHERE layer_id = %s AND object_id = ANY (%s) GROUP BY object_id HAVING count(*) > 1",
            (self._layer_id, list(given)),
        )
        shared = {}
        for number, existence, first_seen, last_seen in self._cursor.fetchall():
            item, evidence = given[number], self._evidence_of(number)
            footprint = item.footprint
            if len(evidence):
                config = config_of({})
                footprint = fused_shapes(evidence, config, item.name)[config.fusion]
            shared[number] = dataclasses.replace(
                item,
                footprint=footprint,
                existence=existence,
                first_seen=first_seen,
                last_seen=last_seen,
            )
        return shared

    def _evidence_of(self, number: int) -> EvidenceTable:
        key = (self._layer_id, number)
        observations = self._cursor.execute(
            "SELECT object_id, view, score, lowest, highest, footprint FROM observations "
            "WHERE layer_id = %s AND object_id = %s AND valid_to IS NULL ORDER BY number",
            key,
        ).fetchall()
        views = self._cursor.execute(
            "SELECT number, stamp, pose, area FROM views WHERE layer_id = %s AND valid_to IS NULL "
            "AND number = ANY (%s) ORDER BY number",
            (self._layer_id, [view for _, view, *_ in observations]),
        ).fetchall()
        return rows.evidence_of(views, observations)

    def _remove(self, removed: Sequence[int]) -> None:
        """Remove objects that no other robot maps, and that no person has changed."""
        for local in removed:
            track = self._tracks.get(local)
            if track is None:
                continue
            self._cursor.execute(
                "DELETE FROM tracks WHERE layer_id = %s AND source = %s AND local_id = %s",
                (self._layer_id, self._observed.source, local),
            )
            self._cursor.execute(
                "UPDATE objects SET valid_to = %s WHERE layer_id = %s AND id = %s "
                "AND valid_to IS NULL AND valid_from = %s AND NOT EXISTS (SELECT FROM tracks "
                "WHERE tracks.layer_id = objects.layer_id AND object_id = objects.id)",
                (self._version, self._layer_id, track.object_id, track.written),
            )
            self._counts["removed"] += self._cursor.rowcount
        if gone := {self._tracks[local].object_id for local in removed if local in self._tracks}:
            self._end_observations(_END_OF_REMOVED, gone)
