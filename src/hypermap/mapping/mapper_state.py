"""The state that a mapper needs to continue a saved map exactly as if it had never stopped.

The file is described in docs/formats/mapper_state.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.embeddings import Embeddings
from hypermap.core.errors import FormatError
from hypermap.core.objects import SemanticObject
from hypermap.formats.array_file import (
    ArrayFile,
    dump_arrays,
    packed_shapes,
    parse_arrays,
    unpacked_shapes,
)
from hypermap.formats.semantic.embeddings_file import packed_embeddings, unpacked_embeddings
from hypermap.formats.semantic.pictures_file import packed_pictures, unpacked_pictures
from hypermap.formats.semantic.yaml_files import dump_objects, parse_objects
from hypermap.formats.yaml_text import read_yaml, write_yaml
from hypermap.mapping import by_hand, drives
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.counts import Counts
from hypermap.mapping.drives import Drive
from hypermap.mapping.evidence_buffer import Evidence, EvidenceBuffer
from hypermap.mapping.frame_log import LogPart, packed_log, unpacked_log
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import Track, TrackTable

FORMAT = "hypermap mapper state"
VERSION = 1

_FARTHEST_CELL = 1e10  # from the origin

_Arrays = Mapping[str, NDArray[Any]]
_WRONG = (
    *(KeyError, TypeError, ValueError, IndexError, OverflowError),
    *(AttributeError, shapely.GEOSException),
)


@dataclass(frozen=True, eq=False)
class MapperState:
    """A mapper between two frames.

    Attributes:
        tracks: all tracks, also those that are not published. Pictures and embeddings of published
            objects are not in the file, but with their layer.
        keyframe: pose of the last keyframe, shape (4, 4); None if there is none.
        first_cell: row and column of the first cell of `log_odds`, from the frame's origin.
        log_odds: of the cells of the occupancy layer, NaN for never seen, float32, shape (H, W);
            None if the layer is not made from depth.
        drives: the drives mapped so far.
        counts: frame counts.
        published: the objects as they were published.
        alignment: what pose correction has learned; None if poses are not corrected.
        log: the newest frames, from which they can be mapped again from other poses.
    """

    tracks: TrackTable
    keyframe: NDArray[np.float64] | None
    first_cell: NDArray[np.int64]
    log_odds: NDArray[np.float32] | None
    drives: Sequence[Drive]
    counts: Counts
    published: Sequence[SemanticObject]
    alignment: tuple[float, float, bool] | None = None
    log: Sequence[LogPart] = ()


def dump_before(state: MapperState) -> bytes:
    """Return the file of a state from which frames will be mapped again, without pictures."""
    tracks = state.tracks.snapshot()
    for track in tracks.objects:
        track.buffer.pictures, track.buffer.embedding = (), None
    return dump_state(replace(state, tracks=tracks, published=(), log=()))


def dump_state(state: MapperState) -> bytes:
    """Return the file; `parse_state` gives the same state again, to the last bit."""
    facts: dict[str, Any] = {"counts": asdict(state.counts), "alignment": state.alignment}
    facts["drives"], keys = drives.packed(list(state.drives))
    arrays: dict[str, NDArray[Any]] = {"frame_keys": keys}
    if state.keyframe is not None:
        arrays["keyframe"] = state.keyframe.astype(np.float64)
    if state.log_odds is not None:
        arrays |= {"first_cell": state.first_cell, "log_odds": state.log_odds}
    edits = {track.id: track.by_hand for track in state.tracks.objects if track.by_hand}
    records = {number: by_hand.as_record(edit) for number, edit in edits.items()}
    arrays |= {
        "published": np.frombuffer(dump_objects(state.published), np.uint8),
        "by_hand": np.frombuffer(write_yaml(records), np.uint8),
    }
    facts["names"] = [track.name for track in state.tracks.objects]
    facts["next_id"] = state.tracks.next_id
    facts["moved"] = [track.moved for track in state.tracks.objects]
    facts["gone_since"] = [track.gone_since for track in state.tracks.objects]
    published = {item.id for item in state.published}  # whose pictures are with their layer
    hidden = {
        track.id: track.buffer.pictures
        for track in state.tracks.objects
        if track.id not in published and not track.is_deleted
    }
    arrays |= packed_pictures(hidden)
    looks = {
        track.id: track.buffer.embedding
        for track in state.tracks.objects
        if track.id in hidden and track.buffer.embedding is not None
    }
    if (embeddings := Embeddings.of(looks)) is not None:
        facts["embedding_model"] = embeddings.model
        arrays |= packed_embeddings(embeddings)
    if state.log:
        arrays |= packed_log(state.log)
    return dump_arrays(ArrayFile(facts, arrays | _packed(state.tracks)), FORMAT, VERSION)


def parse_state(content: bytes, config: EvidenceConfig, path: str = "mapper_state") -> MapperState:
    """Return the state in a file.

    Args:
        content: the file.
        config: with which the map was made.
        path: how messages name the file.

    Raises:
        FormatError: If it holds none, or is of a later version.
    """
    file = parse_arrays(content, FORMAT, VERSION, path)
    facts, arrays = file.facts, file.arrays
    try:
        log_odds = arrays.get("log_odds")
        if log_odds is not None and (log_odds.ndim != 2 or log_odds.dtype != np.float32):
            raise ValueError(f"log_odds have the shape {log_odds.shape}")
        first_cell = arrays.get("first_cell", np.zeros(2, np.int64)).reshape(2)
        if np.abs(first_cell.astype(np.float64)).max() > _FARTHEST_CELL:
            raise ValueError(f"the occupancy layer begins at {first_cell}")
        keyframe = arrays.get("keyframe")
        published, edits = _published(arrays, path)
        tracks = _unpacked(facts, arrays, config)
        pictures = unpacked_pictures(arrays) if "picture.object" in arrays else {}
        looks = None
        if "embedding_model" in facts:
            looks = unpacked_embeddings(facts["embedding_model"], arrays)
        for track in tracks.objects:
            track.by_hand = edits.get(track.id)
            track.buffer.embedding = None if looks is None else looks.embedding(track.id)
            track.buffer.pictures = pictures.get(track.id, ())
        return MapperState(
            tracks=tracks,
            published=published,
            alignment=_alignment(facts["alignment"]),
            keyframe=None if keyframe is None else keyframe.reshape(4, 4),
            first_cell=first_cell,
            log_odds=log_odds,
            drives=drives.unpacked(facts["drives"], arrays["frame_keys"]),
            counts=Counts(**{fate: int(n) for fate, n in facts["counts"].items()}),
            log=unpacked_log(arrays),
        )
    except _WRONG as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def parse_published(
    content: bytes, path: str = "mapper_state"
) -> tuple[list[SemanticObject], dict[int, HandEdit]]:
    """Return the objects as mapping had published them, and the edits made by hand before.

    Raises:
        FormatError: If the file holds no state, or is of a later version.
    """
    arrays = parse_arrays(content, FORMAT, VERSION, path).arrays
    try:
        return _published(arrays, path)
    except _WRONG as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def _published(arrays: _Arrays, path: str) -> tuple[list[SemanticObject], dict[int, HandEdit]]:
    objects, rejected = parse_objects(arrays["published"].tobytes(), path)
    if rejected:
        raise ValueError(f"an object that was published: {rejected[0].reason}")
    records = read_yaml(arrays["by_hand"].tobytes(), path) or {}
    return objects, {int(key): by_hand.from_record(record) for key, record in records.items()}


def _alignment(learned: Any) -> tuple[float, float, bool] | None:
    if learned is None:
        return None
    size, expected, is_worse = learned
    return float(size), float(expected), bool(is_worse)


def _packed(tracks: TrackTable) -> dict[str, NDArray[Any]]:
    """Return all columns of a table of tracks, of their evidence and of its views."""
    objects = tracks.objects
    buffers = [track.buffer for track in objects]
    items = [item for buffer in buffers for item in buffer.items]
    rows: dict[tuple[int, int], int] = {}  # observations of one frame share its pose and its area
    views: list[Evidence] = []
    view_of = []
    for item in items:
        view_of.append(rows.setdefault((id(item.map_T_camera), id(item.visible_area)), len(views)))
        if view_of[-1] == len(views):
            views.append(item)
    both = [
        (track.id, other, count)
        for track in objects
        for other, count in sorted(track.co_occurrences.items())
    ]
    times = [(b.score_sum, b.first_seen, b.last_seen) for b in buffers]
    return {
        "track.id": _whole([track.id for track in objects]),
        "track.existence": tracks.existence.copy(),
        "track.heights": tracks.shapes.heights.copy(),
        "track.pending": _whole([track.pending for track in objects]),
        "track.observations": _whole([buffer.count for buffer in buffers]),
        "track.kept": _whole([len(buffer) for buffer in buffers]),
        "track.scores_and_times": np.array(times, np.float64).reshape(-1, 3),
        "track.co_occurrences": _whole(both).reshape(-1, 3),
        **packed_shapes("track.shape", tracks.shapes.geometries(range(len(objects)))),
        "observation.view": _whole(view_of),
        "observation.score": np.array([item.score for item in items], np.float64),
        "observation.z_min": np.array([item.z_min for item in items], np.float64),
        "observation.z_max": np.array([item.z_max for item in items], np.float64),
        **packed_shapes("observation.footprint", as_objects(item.footprint for item in items)),
        "view.stamp": np.array([view.stamp for view in views], np.float64),
        "view.pose": np.array([v.map_T_camera for v in views], np.float64).reshape(-1, 4, 4),
        **packed_shapes("view.area", as_objects(view.visible_area for view in views)),
    }


def _unpacked(facts: Mapping[str, Any], arrays: _Arrays, config: EvidenceConfig) -> TrackTable:
    items = _evidence(arrays)
    tracks = TrackTable(config.max_existence)
    ids = arrays["track.id"].tolist()
    if any(one >= next_one for one, next_one in pairwise(ids)):
        raise ValueError("the ids of the tracks do not rise")
    co_occurrences: dict[int, Counter[int]] = {number: Counter() for number in ids}
    for number, other, count in arrays["track.co_occurrences"].tolist():
        co_occurrences[number][other] = count
    ends = np.cumsum(arrays["track.kept"]).tolist()
    if (arrays["track.kept"] < 0).any() or (ends[-1] if ends else 0) != len(items):
        raise ValueError("the observations do not fit the tracks")
    columns = (
        *(
            ids,
            facts["names"],
            PreparedPolygon.all_of(list(unpacked_shapes("track.shape", arrays))),
        ),
        *(arrays[f"track.{name}"].tolist() for name in _TRACK_COLUMNS),
    )
    moved, gone_since = (_numbers(ids, facts.get(key, ())) for key in ("moved", "gone_since"))
    begin = 0
    for (id_, name, shape, existence, heights, pending, count, times), end in zip(
        zip(*columns, strict=True), ends, strict=True
    ):
        buffer = EvidenceBuffer.of(items[begin:end], config.max_evidence, count, *times)
        track = Track(id_, str(name), buffer, co_occurrences[id_], pending)
        track.moved, track.gone_since = moved.get(id_), gone_since.get(id_)
        tracks.add(track, 0, shape, tuple(heights), existence)
        begin = end
    tracks.next_id = max(tracks.next_id, int(facts["next_id"]))
    return tracks


def _numbers(ids: Sequence[int], values: Sequence[float | None]) -> dict[int, float]:
    """Return the numbers of those tracks that have one; files of earlier versions have none."""
    pairs = zip(ids, values, strict=False)
    return {number: float(value) for number, value in pairs if value is not None}


_TRACK_COLUMNS = ("existence", "heights", "pending", "observations", "scores_and_times")


def _evidence(arrays: _Arrays) -> list[Evidence]:
    """Return all evidence; what one frame has shown shares its pose and its area."""
    footprints: ObjectArray = unpacked_shapes("observation.footprint", arrays)
    areas = unpacked_shapes("view.area", arrays)
    centroids = shapely.get_coordinates(shapely.centroid(footprints))
    poses, stamps = list(arrays["view.pose"].reshape(-1, 4, 4)), arrays["view.stamp"].tolist()
    prepared = PreparedPolygon.all_of(list(footprints))
    prepared_areas = PreparedPolygon.all_of(list(areas))
    found = []
    columns = [arrays[f"observation.{name}"] for name in ("view", "score", "z_min", "z_max")]
    if any(column.shape != (len(footprints),) for column in columns):
        raise ValueError("the columns of the observations differ in length")
    if columns[0].size and columns[0].min() < 0:
        raise ValueError("an observation is of no view")
    values = zip(*(column.tolist() for column in columns), strict=True)
    for i, (view, score, z_min, z_max) in enumerate(values):
        item = Evidence(
            stamp=stamps[view],
            map_T_camera=poses[view],
            visible_area=areas[view],
            score=score,
            footprint=footprints[i],
            centroid_xy=centroids[i],
            z_min=z_min,
            z_max=z_max,
        )
        vars(item).update(prepared=prepared[i], prepared_area=prepared_areas[view])
        found.append(item)
    return found


def _whole(values: Sequence[Any]) -> NDArray[np.int64]:
    return np.array(values, np.int64)
