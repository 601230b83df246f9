"""The state that a mapper needs to continue a saved map exactly as if it had never stopped.

The file is described in docs/formats/mapper_state.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.embeddings import Embeddings
from hypermap.core.errors import FormatError
from hypermap.core.objects import SemanticObject
from hypermap.formats.array_file import ArrayFile, dump_arrays, parse_arrays
from hypermap.formats.semantic.embeddings_file import packed_embeddings, unpacked_embeddings
from hypermap.formats.semantic.pictures_file import packed_pictures, unpacked_pictures
from hypermap.formats.semantic.yaml_files import dump_objects, parse_objects
from hypermap.formats.yaml_text import read_yaml, write_yaml
from hypermap.mapping import by_hand, drives
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.counts import Counts
from hypermap.mapping.drives import Drive
from hypermap.mapping.frame_log import (
    FARTHEST_CELL,
    LogPart,
    MapBefore,
    packed_log,
    unpacked_befores,
    unpacked_log,
)
from hypermap.mapping.keyframes import Keyframe
from hypermap.mapping.log_odds_arrays import (
    are_in_blocks,
    packed_log_odds,
    unpacked_log_odds,
)
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_arrays import (
    PackedTables,
    packed_tables,
    table_prefix,
    unpacked_tables,
)
from hypermap.mapping.tracks import TrackTable

FORMAT = "hypermap mapper state"
VERSION = 2
"""The newest that is read; the first, without grids in blocks, is written where it suffices."""


_Arrays = Mapping[str, NDArray[Any]]
_WRONG = (
    *(KeyError, TypeError, ValueError, IndexError, OverflowError),
    *(AttributeError, shapely.GEOSException),
)


@dataclass(frozen=True, eq=False)
class MapperState:
    """The state of a mapper between two frames.

    Attributes:
        tracks: all tracks, including unpublished ones, those of the present drive apart from those
            of earlier ones. Pictures and embeddings of published objects
            are saved with their layer, not in this file.
        keyframe: the last one; None if there is none. Without a stamp in files of earlier versions.
        first_cell: row and column of the first cell of `log_odds`, from the origin of the map
            frame, int64, shape (2,).
        log_odds: of the cells of the occupancy layer, NaN if never seen, float32, shape (H, W);
            None if the layer is not made from depth.
        drives: all drives so far.
        counts: of all their frames.
        published: the published objects, by comparison with which edits by hand are found.
        alignment: the state of the `Aligner`; None if poses are not corrected.
        apart: ids of published objects whose track here lacks what the present drive has added to
            their pictures and embeddings.
        log: the newest frames, from which they can be mapped again from other poses.
    """

    tracks: TrackTable
    keyframe: Keyframe | None
    first_cell: NDArray[np.int64]
    log_odds: NDArray[np.float32] | None
    drives: Sequence[Drive]
    counts: Counts
    published: Sequence[SemanticObject]
    alignment: tuple[float, float, bool] | None = None
    log: Sequence[LogPart] = ()
    apart: frozenset[int] = frozenset()


def dump_state(state: MapperState) -> bytes:
    """Return the content of the file; `parse_state` restores the state bit for bit."""
    facts: dict[str, Any] = {"counts": asdict(state.counts), "alignment": state.alignment}
    facts["drives"], keys = drives.packed(list(state.drives))
    arrays: dict[str, NDArray[Any]] = {"frame_keys": keys}
    if state.keyframe is not None:
        arrays["keyframe"] = state.keyframe.map_T_camera.astype(np.float64)
        facts["keyframe"] = [state.keyframe.stamp, state.keyframe.wait]
    arrays["published"] = np.frombuffer(dump_objects(state.published), np.uint8)
    arrays |= _packed_maps(state)
    tables = packed_tables(state.tracks, [part.before.tracks for part in state.log])
    now, *facts["before"] = tables.facts
    facts |= now
    facts["apart"] = sorted(state.apart)
    published = {item.id for item in state.published} - state.apart  # pictures are with the layer
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
    version = VERSION if are_in_blocks(arrays) else 1
    return dump_arrays(ArrayFile(facts, {**arrays, **tables.arrays}), FORMAT, version)


def parse_state(content: bytes, config: EvidenceConfig, path: str = "mapper_state") -> MapperState:
    """Return the state in a file.

    Args:
        content: of the file.
        config: the settings that made the map.
        path: name of the file in messages.

    Raises:
        FormatError: If it is damaged, or of a later version.
    """
    file = parse_arrays(content, FORMAT, VERSION, path)
    facts, arrays = file.facts, file.arrays
    try:
        packed = PackedTables([facts, *facts.get("before", ())], arrays)
        now, *befores = _unpacked_maps(packed, config, path)
        pictures = unpacked_pictures(arrays) if "picture.object" in arrays else {}
        looks = None
        if "embedding_model" in facts:
            looks = unpacked_embeddings(facts["embedding_model"], arrays)
        for track in now.tracks.objects:
            track.buffer.embedding = None if looks is None else looks.embedding(track.id)
            track.buffer.pictures = pictures.get(track.id, ())
        return MapperState(
            tracks=now.tracks,
            published=_published(arrays, path),
            alignment=_alignment(facts["alignment"]),
            keyframe=_keyframe(facts.get("keyframe"), arrays.get("keyframe")),
            first_cell=now.first_cell,
            log_odds=now.log_odds,
            drives=drives.unpacked(facts["drives"], arrays["frame_keys"]),
            counts=Counts(**{fate: int(n) for fate, n in facts["counts"].items()}),
            log=unpacked_log(arrays, befores or _embedded_maps(arrays, config, path)),
            apart=frozenset(map(int, facts.get("apart", ()))),  # unknown in earlier files
        )
    except _WRONG as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def parse_published(
    content: bytes, path: str = "mapper_state"
) -> tuple[list[SemanticObject], dict[int, HandEdit]]:
    """Return the published objects, and earlier edits made by hand, by the objects' ids.

    Raises:
        FormatError: If the file is damaged, or of a later version.
    """
    arrays = parse_arrays(content, FORMAT, VERSION, path).arrays
    try:
        return _published(arrays, path), _edits("", arrays, path)
    except _WRONG as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def _keyframe(facts: Sequence[Any] | None, pose: NDArray[np.float64] | None) -> Keyframe | None:
    if pose is None:
        return None
    stamp, wait = (None, 0.0) if facts is None else facts
    return Keyframe(pose.reshape(4, 4), None if stamp is None else float(stamp), float(wait))


def _published(arrays: _Arrays, path: str) -> list[SemanticObject]:
    objects, rejected = parse_objects(arrays["published"].tobytes(), path)
    if rejected:
        raise ValueError(f"an object that was published: {rejected[0].reason}")
    return objects


def _edits(prefix: str, arrays: _Arrays, path: str) -> dict[int, HandEdit]:
    records = read_yaml(arrays[f"{prefix}by_hand"].tobytes(), path) or {}
    return {int(key): by_hand.from_record(record) for key, record in records.items()}


def _packed_maps(state: MapperState) -> dict[str, NDArray[Any]]:
    """Return the parts of maps other than tracks: edits made by hand, and occupancy.

    The maps are the present one, and the one before each part of the log.
    """
    arrays: dict[str, NDArray[Any]] = {}
    grids = {}
    present = MapBefore(state.tracks, state.first_cell, state.log_odds)
    for number, content in enumerate([present, *(part.before for part in state.log)]):
        prefix = table_prefix(number)
        edits = {track.id: track.by_hand for track in content.tracks.objects if track.by_hand}
        records = {number: by_hand.as_record(edit) for number, edit in edits.items()}
        arrays[f"{prefix}by_hand"] = np.frombuffer(write_yaml(records), np.uint8)
        if content.log_odds is not None:
            arrays[f"{prefix}first_cell"] = content.first_cell
            grids[prefix] = content.log_odds
    return arrays | packed_log_odds(grids)


def _unpacked_maps(packed: PackedTables, config: EvidenceConfig, path: str) -> list[MapBefore]:
    """Return the maps in a file: the present one, and the one before each part of the log."""
    tables = {table_prefix(n): one for n, one in enumerate(unpacked_tables(packed, config))}
    grids, found = unpacked_log_odds(tables, packed.arrays), []
    for prefix, tracks in tables.items():
        edits = _edits(prefix, packed.arrays, path)
        for track in tracks.objects:
            track.by_hand = edits.get(track.id)
        found.append(MapBefore(tracks, _first_cell(prefix, packed.arrays), grids[prefix]))
    return found


def _first_cell(prefix: str, arrays: _Arrays) -> NDArray[np.int64]:
    first_cell = arrays.get(f"{prefix}first_cell", np.zeros(2, np.int64)).reshape(2)
    if np.abs(first_cell.astype(np.float64)).max() > FARTHEST_CELL:
        raise ValueError(f"the occupancy layer begins at {first_cell}")
    return first_cell


def _embedded_maps(arrays: _Arrays, config: EvidenceConfig, path: str) -> list[MapBefore]:
    """Return the maps before each part of the log from the nested files of an earlier version.

    These hold neither blocks, whose memory would count anew for each, nor nested files themselves.
    """
    found = []
    for content in unpacked_befores(arrays):
        file = parse_arrays(content, FORMAT, 1, path)
        if are_in_blocks(file.arrays):
            raise ValueError("a nested file has grids in blocks")
        found += _unpacked_maps(PackedTables([file.facts], file.arrays), config, path)
    return found


def _alignment(learned: Any) -> tuple[float, float, bool] | None:
    if learned is None:
        return None
    size, expected, is_worse = learned
    return float(size), float(expected), bool(is_worse)
