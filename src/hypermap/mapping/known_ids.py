"""Gives the tracks of a map that was made again the ids that people know of the same objects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hypermap.mapping.earlier_drives import EarlierDrives
from hypermap.mapping.evidence_buffer import Evidence
from hypermap.mapping.merging.moving import renumbered
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import TrackTable

_SAME_PLACE = 1e-3  # [m] by which rounding moves what is seen


def with_known_ids(
    tracks: TrackTable,
    known: TrackTable,
    fixed: frozenset[int],
    config: EvidenceConfig,
    shared: Mapping[tuple[int, int], int] | None = None,
) -> TrackTable:
    """Return tracks with the ids, pictures and embeddings of the same objects in another table.

    Two tracks are one object if they share observations; those that share most are matched first.
    Tracks of the present drive stay apart from those of earlier ones while these have the smaller
    ids. They have not where people have edited what the drive had found, as its evidence is with
    the known object then, nor where earlier drives now show one object more: then all are joined.

    Args:
        tracks: the tracks to renumber.
        known: the tracks with the ids to use.
        fixed: ids that mean the same object in both.
        config: of both.
        shared: how many observations a track and a known one have shared, by their ids; None for
            those that they keep.
    """
    if shared is None:
        shared = shared_observations(tracks, known)
    ids = _known_ids(tracks, known, fixed, shared)
    earlier = [ids[track.id] for track in tracks.objects if track.id < tracks.first_id]
    own = [ids[track.id] for track in tracks.objects if track.id >= tracks.first_id]
    if max(earlier, default=-1) > min(own, default=max(ids.values(), default=-1)):
        drives, own = EarlierDrives(config), []
        tracks, known = drives.settled(tracks), drives.settled(known)
        ids = _known_ids(tracks, known, fixed, shared_observations(tracks, known))
    table = _renumbered(tracks, known, ids)
    table.next_id = max(table.next_id, known.next_id)
    table.first_id = min(own, default=table.next_id) if tracks.first_id else 0
    return table


def _renumbered(tracks: TrackTable, known: TrackTable, ids: dict[int, int]) -> TrackTable:
    """Return tracks with other ids, and with what known ones show of their objects."""
    kept = {track.id: track.buffer for track in known.objects}
    objects = tracks.objects
    rows, found = sorted(range(len(objects)), key=lambda row: ids[objects[row].id]), []
    for row in rows:
        track = renumbered(objects[row], ids[objects[row].id])
        counts = {ids[n]: count for n, count in track.co_occurrences.items() if n in ids}
        track.co_occurrences = Counter(counts)
        if (before := kept.get(track.id)) is not None:
            track.buffer.pictures, track.buffer.embedding = before.pictures, before.embedding
        found.append(track)
    return tracks.of_tracks(found, rows)


def _known_ids(
    tracks: TrackTable,
    known: TrackTable,
    fixed: frozenset[int],
    shared: Mapping[tuple[int, int], int],
) -> dict[int, int]:
    """Return an id for each track, by the tracks' own ids.

    Those of earlier drives come first: a known object may have the evidence of both drives.
    """
    owns = [track.id for track in tracks.objects]
    earlier = {own for own in owns if own < tracks.first_id}
    ids: dict[int, int] = {}
    for some in (earlier, set(owns) - earlier):
        _match(ids, shared, some)
        left = some - ids.keys() - set(ids.values())
        ids |= {own: own for own in left & fixed}
    number = max(tracks.next_id, known.next_id)
    for own in owns:
        if own not in ids:
            ids[own], number = number, number + 1
    return ids


def shared_observations(tracks: TrackTable, known: TrackTable) -> Counter[tuple[int, int]]:
    """Return how many observations a track and a known one share, by their ids.

    Observations of one frame that have one name and score, as of detectors that score nothing, are
    told apart by where the camera saw them.
    """
    owners: dict[tuple[str, float, float], list[tuple[Evidence, int]]] = {}
    for track in known.objects:
        for item in track.buffer.items:
            owners.setdefault((track.name, item.stamp, item.score), []).append((item, track.id))
    shared: Counter[tuple[int, int]] = Counter()
    for track in tracks.objects:
        for item in track.buffer.items:
            same = owners.get((track.name, item.stamp, item.score), [])
            for owner in _nearest(item, same) if len(same) > 1 else {id_ for _, id_ in same}:
                shared[track.id, owner] += 1
    return shared


def _nearest(item: Evidence, others: Sequence[tuple[Evidence, int]]) -> set[int]:
    """Return the ids of the others that the camera saw nearest to where it saw one."""
    place = _place_from_camera(item)
    away = [float(np.linalg.norm(_place_from_camera(other) - place)) for other, _ in others]
    least = min(away) + _SAME_PLACE
    return {id_ for (_, id_), distance in zip(others, away, strict=True) if distance <= least}


def _place_from_camera(item: Evidence) -> NDArray[np.float64]:
    """Return where an observation is to the right of its camera, and ahead [m], shape (2,).

    Corrected poses move both together.
    """
    right, down = item.map_T_camera[:2, :2].T
    axis = right if np.linalg.norm(right) > 0.5 else down  # of a camera on its side
    x, y = axis / np.linalg.norm(axis)
    offset = item.centroid_xy - item.map_T_camera[:2, 3]
    return np.array([[x, y], [-y, x]]) @ offset


def _match(
    ids: dict[int, int], shared: Mapping[tuple[int, int], int], wanted: Collection[int]
) -> None:
    """Add known ids of some tracks, by how many observations they share; `ids` changes."""
    taken = set(ids.values())
    # Ties go to tracks whose ids mean the same object.
    for (own, owner), _ in sorted(
        shared.items(), key=lambda pair: (-pair[1], pair[0][0] != pair[0][1], pair[0])
    ):
        if own in wanted and own not in ids and owner not in taken:
            ids[own] = owner
            taken.add(owner)
