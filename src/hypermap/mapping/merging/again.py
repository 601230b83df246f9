"""Maps the logged frames of two maps again, as if one map had been made of both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.formats.collector import paused_collector
from hypermap.mapping.completion import FreeShare
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.correcting import (
    add_logged,
    frames_with_evidence,
    map_now,
    with_ids_in_log,
)
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_buffer import FoundEvidence
from hypermap.mapping.frame_log import FrameLog, LoggedFrame, LogPart, MapBefore, packed_frame
from hypermap.mapping.going_on import CannotGoOn
from hypermap.mapping.known_ids import shared_observations, with_known_ids
from hypermap.mapping.merging.edits import Deleted, with_edits
from hypermap.mapping.merging.logged import LoggedDrive, Side, in_order
from hypermap.mapping.merging.tracks import Joined
from hypermap.mapping.occupancy import OccupancyMapper
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import TrackTable


@dataclass(frozen=True, eq=False)
class MappedAgain:
    """What two maps have become.

    Attributes:
        joined: their tracks.
        first_cell: row and column of the first cell of `log_odds`, as in `MapBefore`.
        log_odds: of the cells, float32, shape (H, W); None if the layer is not made from depth.
        log: the frames that were mapped again, and those before them.
    """

    joined: Joined
    first_cell: NDArray[np.int64]
    log_odds: NDArray[np.float32] | None
    log: list[LogPart]


@paused_collector()
def map_both_again(
    sides: tuple[Side, Side],
    kept: tuple[int, int],
    base: MapBefore,
    joined: Joined,
    config: MappingConfig,
    is_free: FreeShare | None,
) -> MappedAgain:
    """Return two maps as one, of which all drives but some are mapped again in the order of time.

    Objects keep their ids of the first map, and their pictures and edits made by hand of both.

    Args:
        sides: the maps.
        kept: as `kept_drives` returns it.
        base: both maps before the frames that are mapped again; its tracks are those of `joined`.
        joined: the tracks of both maps before these frames.
        config: of both maps.
        is_free: as in `EvidenceMap`.

    Raises:
        CannotGoOn: If a log is damaged.
        HypermapError: If the occupancy grid would have too many cells.
    """
    made = _map_in_order(sides, kept, base, config, is_free)
    tracks = made.evidence.settled().snapshot()
    tracks.first_id = tracks.next_id  # none is of a drive that goes on
    ids = {track.id: track.id for track in tracks.objects}
    log = made.log.parts
    is_first_again, is_second_again = (n < len(s.logged) for n, s in zip(kept, sides, strict=True))
    if is_first_again:
        fixed = frozenset(track.id for track in base.tracks.objects)
        tracks, ids = _with_ids_of_first(tracks, sides[0].tracks, fixed, config, made.shared[0])
        log = with_ids_in_log(log, _parts_before(sides, kept), tracks, fixed, config)
    numbers = {number: ids[now] for number, now in joined.ids.items() if now in ids}
    if is_second_again:
        numbers = _owners(made.shared[1], ids)
        _keep_looks(tracks, sides[1].tracks, numbers)
    first_cell, log_odds = base.first_cell, None
    if base.log_odds is not None:
        first_cell, log_odds = made.occupancy.log_odds()
    return MappedAgain(_joined(tracks, sides, numbers, config.evidence), first_cell, log_odds, log)


@dataclass(frozen=True, eq=False)
class _MappedInOrder:
    """The frames of two maps, mapped in the order of time.

    Attributes:
        evidence: the map of their objects.
        occupancy: the cells; of no use if the map has a layer that was given.
        log: the frames, and those before them.
        shared: for each of the two maps, how many observations a track of `evidence` and one of
            that map have shared, by their ids.
    """

    evidence: EvidenceMap
    occupancy: OccupancyMapper
    log: FrameLog
    shared: tuple[Counter[tuple[int, int]], Counter[tuple[int, int]]]


def _map_in_order(
    sides: tuple[Side, Side],
    kept: tuple[int, int],
    base: MapBefore,
    config: MappingConfig,
    is_free: FreeShare | None,
) -> _MappedInOrder:
    """Map the frames of two maps, one drive after the other; see `map_both_again`."""
    evidence, occupancy = EvidenceMap(config.evidence, is_free), OccupancyMapper(config.occupancy)
    evidence.go_on_with(base.tracks.snapshot(), base.tracks.hand_edits())
    if base.log_odds is not None:
        occupancy.go_on_with(base.first_cell, base.log_odds.copy())
    first, second = (shared_observations(base.tracks, side.tracks) for side in sides)
    log = FrameLog(_parts_before(sides, kept))
    for side, drive in in_order(sides, kept):
        evidence.begin_drive()
        log.end_drive()
        if not drive.is_whole:
            log.parts.clear()  # drives are told apart by how many frames they have
        for stamp, content, pose, frame, found in _frames(side, drive, config):
            if log.is_full:
                log.begin_part(map_now(evidence, occupancy, base.log_odds is not None))
            add_logged(frame, found, evidence, occupancy)
            log.add(stamp, content, pose)
        # Tracks keep only the newest observations, so each drive is compared when it ends.
        shared = first if side is sides[0] else second
        shared |= shared_observations(evidence.settled(), side.tracks)
    return _MappedInOrder(evidence, occupancy, log, (first, second))


def _joined(
    tracks: TrackTable, sides: tuple[Side, Side], numbers: dict[int, int], config: EvidenceConfig
) -> Joined:
    """Return the merged tracks, with the edits made by hand.

    Args:
        tracks: the merged ones.
        sides: both maps.
        numbers: the ids of the second map's tracks in `tracks`, by their own; those that are gone
            are added.
        config: of both.
    """
    deleted = Deleted.of(tracks)
    for track in sides[1].tracks.objects:
        if track.id not in numbers:
            number = deleted.at(sides[1].tracks, track.id)
            numbers[track.id] = tracks.next_id if number is None else number
            tracks.next_id += number is None
    tracks, conflicts = with_edits(tracks, sides, numbers, config)
    first = {track.id for track in sides[0].tracks.objects}
    there = {track.id for track in tracks.objects}
    pairs = frozenset(there & first & set(numbers.values()))
    return Joined(tracks, numbers, pairs, conflicts)


def _parts_before(sides: tuple[Side, Side], kept: tuple[int, int]) -> list[LogPart]:
    """Return the part of the log of the first map that goes on in the log of both.

    That is the one before the frames that are mapped again, unless the second map is before them,
    too.
    """
    first, second = sides
    if second.drives_before(kept[1]):
        return []
    return [part for one in first.logged[: kept[0]] for part in one.parts]


def _frames(
    side: Side, one: LoggedDrive, config: MappingConfig
) -> Iterator[tuple[float, bytes, NDArray[np.float64], LoggedFrame, FoundEvidence]]:
    """Yield the frames of a drive: stamp, packed frame, pose, frame, and its evidence.

    All but the stamps are in the frame and the time of the merged map.
    """
    is_same = side.a_T_b == Pose2D() and side.later == 0
    matrix = np.eye(4)
    matrix[np.ix_([0, 1, 3], [0, 1, 3])] = side.a_T_b.matrix()
    stamps = [stamp for part in one.parts for stamp in part.stamps]
    contents = [content for part in one.parts for content in part.frames]
    poses = [matrix @ pose for part in one.parts for pose in part.poses]
    moved = frames_with_evidence(contents, poses, config, side.a_T_b, side.later)
    try:
        for stamp, content, pose, (frame, found) in zip(
            stamps, contents, poses, moved, strict=True
        ):
            yield stamp, content if is_same else packed_frame(frame), pose, frame, found
    except FormatError as error:
        raise CannotGoOn(f"{side.name}: {error}; map all its recordings again") from error


def _with_ids_of_first(
    tracks: TrackTable,
    known: TrackTable,
    fixed: frozenset[int],
    config: MappingConfig,
    shared: Mapping[tuple[int, int], int],
) -> tuple[TrackTable, dict[int, int]]:
    """Return tracks with the ids and the looks of the first map, and their new ids by the old.

    The arguments are those of `with_known_ids`.
    """
    looks = [
        (track.buffer, track.buffer.pictures, track.buffer.embedding) for track in tracks.objects
    ]
    table = with_known_ids(tracks, known, fixed, config.evidence, shared)
    for buffer, pictures, embedding in looks:
        buffer.keep_looks(pictures, (), embedding)
    table.first_id = table.next_id
    new = {id(track.buffer): track.id for track in table.objects}
    return table, {track.id: new[id(track.buffer)] for track in tracks.objects}


def _owners(shared: Mapping[tuple[int, int], int], ids: Mapping[int, int]) -> dict[int, int]:
    """Return the ids of the tracks that have most of the evidence of others, by theirs.

    Those with more evidence come first.

    Args:
        shared: how many observations a track and another one have shared, by their ids.
        ids: the present ids of the tracks, by those in `shared`.
    """
    found: dict[int, int] = {}
    counts = [(-count, own, ids[now]) for (now, own), count in shared.items() if now in ids]
    for _, own, owner in sorted(counts):
        found.setdefault(own, owner)
    return found


def _keep_looks(tracks: TrackTable, others: TrackTable, ids: Mapping[int, int]) -> None:
    """Add pictures and embeddings of other tracks, whose ids here are given, by theirs."""
    by_id = {track.id: track for track in tracks.objects}
    for other in others.objects:
        track = by_id.get(ids.get(other.id, -1))
        if track is not None:
            track.buffer.keep_looks(other.buffer.pictures, (), other.buffer.embedding)
