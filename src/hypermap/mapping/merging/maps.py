"""Merges two maps made by mapping, so that mapping can continue the result."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.alignment.frames import (
    frames_of,
    free_name,
    in_frame_of,
    with_frames_renamed,
)
from hypermap.core.errors import FormatError, FrameError
from hypermap.core.frames import FrameTree, Pose2D
from hypermap.core.grid import GridGeometry, along
from hypermap.core.history import ADDED, Change, Mapped
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.drives import BETWEEN, Drive
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.frame_log import FrameLog, MapBefore
from hypermap.mapping.going_on import (
    SEMANTIC,
    CannotGoOn,
    edits_of,
    layer_of_objects,
    state_of,
)
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.mapper_state import MapperState, dump_state
from hypermap.mapping.merging.again import MappedAgain, map_both_again
from hypermap.mapping.merging.grids import added_layers, added_log_odds, log_odds_of
from hypermap.mapping.merging.logged import Side, in_order, kept_drives
from hypermap.mapping.merging.moving import moved_tracks
from hypermap.mapping.merging.settings import CannotMerge, common_config
from hypermap.mapping.merging.tracks import IsFree, Joined, join_tracks
from hypermap.mapping.second_look import SecondLook
from hypermap.mapping.track_colors import objects_differ_in_color
from hypermap.mapping.tracks import TrackTable

_Cells: TypeAlias = "tuple[NDArray[np.int64], NDArray[np.float32] | None]"
"""The first cell, and the log-odds, as in `MapperState`."""

_FREE = 0.9  # share of an area that must be free for it to contain no object
_SAME_FRAMES = 0.01  # share of a map's frames; fewer have the same key by chance


@dataclass(frozen=True, eq=False)
class Merged:
    """Two maps as one.

    Attributes:
        hypermap: the map, in the base frame of the first.
        both: number of its objects that were in both maps.
        first: number of objects only in the first map.
        second: number of objects only in the second map.
        gone: number of objects of the first map that are not in the result, because later views of
            the second did not show them.
        left_out: number of objects only in the second map that are not in the result, likewise.
        conflicts: ids of objects edited by hand in both maps; the first map's edits are kept.
        renamed: new names of layers of the second map whose names were in use, by their old names.
        settings: what the second map was made with otherwise, where the defaults have changed; the
            result has the settings of the first.
    """

    hypermap: Hypermap
    both: int
    first: int
    second: int
    gone: int
    left_out: int
    conflicts: tuple[int, ...]
    renamed: dict[str, str]
    settings: tuple[str, ...] = ()


def merge_maps(first: Hypermap, second: Hypermap, a_T_b: Pose2D) -> Merged:
    """Return two maps of one place as one map, from the evidence in both.

    The frames that both maps keep are mapped again in the order of time, as if one map had been
    made of both: the later drives decide. Of older drives, objects in both maps become one, those
    in only one map lose existence by later views of the other that should have shown them, and the
    log-odds of the occupancy grids are added. Objects keep their ids of the first map. All other
    layers of both maps are kept, in frames of their own.

    Args:
        first: a map made by mapping; its id, frame and metadata become those of the result.
        second: a map made by mapping with the same configuration, or with the same profile by a
            version with other defaults.
        a_T_b: transforms points from the base frame of the second map to that of the first.

    Raises:
        CannotGoOn: If a map was not made by mapping, or lacks the mapper state.
        CannotMerge: If the configurations differ, or both contain the same frames.
        FrameError: If the frames of both maps cannot be joined in one tree.
    """
    config, settings = common_config(first, second)
    a, b = state_of(first, config), state_of(second, config)
    _check_drives(a.drives, b.drives)
    grids = _grid_of(first), _grid_of(second)
    later = _later(a.drives, b.drives)
    tracks = _tracks(second, b, config)
    sides = (
        Side(a, _tracks(first, a, config), Pose2D(), 0.0),
        Side(b, moved_tracks(tracks, a_T_b, config.evidence, later), a_T_b, later),
    )
    kept = len(sides[0].logged), len(sides[1].logged)
    if config.evidence.moves:  # otherwise, drives are not told apart
        kept = kept_drives(sides)
    occupancy = _occupancy(a, grids, a_T_b)
    made = _merged_sides(sides, kept, grids, config, occupancy)
    drives = [drive for n, side in zip(kept, sides, strict=True) for drive in side.drives_before(n)]
    drives += [side.in_time(d) for side, one in in_order(sides, kept) for d in one.drives]
    state = MapperState(
        tracks=made.joined.tracks,
        keyframe=None,
        first_cell=made.first_cell,
        log_odds=made.log_odds,
        drives=drives,
        counts=a.counts + b.counts,
        published=[],  # `Mapper.onto` publishes all
        alignment=a.alignment,
        log=() if _are_at_the_same_time(sides) else made.log,
    )
    others = _other_layers(first, second, a_T_b, skip={grids[1].name, SEMANTIC})
    merged = Hypermap(
        [*_layers_of(first, occupancy, second), *others.layers], others.frames, first.metadata
    )
    merged.mapper_state, merged.history = dump_state(state), first.history
    hypermap = Mapper.onto(merged, None).hypermap()
    assert hypermap.history is not None  # of a mapper's map
    doubt = None
    if _is_after(b, state):
        doubt = _doubt(replace(state, log=made.log), len(b.drives), config, first, hypermap)
    doubt = _doubt_of_both(first, doubt)
    hypermap.history = replace(hypermap.history, mapped=_source(first, b.drives, doubt))
    counted = _counted(hypermap, (first, second), made.joined, others.renamed)
    return replace(counted, settings=settings)


def _later(first: Sequence[Drive], second: Sequence[Drive]) -> float:
    """Return by how much the times of the second map are later in the merged one [s].

    Clocks that do not count from 1970 do not tell which drive was first where the stamps overlap:
    the second map is later then, as when mapping continues a map.
    """
    mine, theirs = (
        [(d.first + d.offset, d.last + d.offset) for d in some] for some in (first, second)
    )
    overlap = any(a <= d and c <= b for (a, b), (c, d) in itertools.product(mine, theirs))
    if not overlap or not all(drive.has_no_clock for drive in (*first, *second)):
        return 0.0
    return max(end for _, end in mine) + BETWEEN - min(begin for begin, _ in theirs)


def _are_at_the_same_time(sides: tuple[Side, Side]) -> bool:
    """Return whether the stamps of a trajectory do not tell which map's frames it is of."""
    mine, theirs = ([side.in_time(drive) for drive in side.state.drives] for side in sides)
    pairs = itertools.product(mine, theirs)
    return any(one.offset == other.offset and one.overlaps(other) for one, other in pairs)


def _merged_sides(
    sides: tuple[Side, Side],
    kept: tuple[int, int],
    grids: tuple[OccupancyLayer, OccupancyLayer],
    config: MappingConfig,
    occupancy: OccupancyLayer,
) -> MappedAgain:
    """Return two maps as one: joined as they were, then with all later frames mapped again."""
    first, second = sides
    tracks = _tracks_before(first, kept[0], config), _tracks_before(second, kept[1], config)
    tracks[0].next_id = max(tracks[0].next_id, first.tracks.next_id)
    is_free = (
        _is_free(grids[0], Pose2D(), config.occupancy.free_below),
        _is_free(grids[1], second.a_T_b.inverse(), config.occupancy.free_below),
    )
    joined = join_tracks(tracks[0], tracks[1], config.evidence, is_free)
    cells = _cells_before(first, kept[0]), _cells_before(second, kept[1])
    first_cell, log_odds = _added_cells(*cells, grids[1], second.a_T_b, config)
    if not in_order(sides, kept):
        return MappedAgain(joined, first_cell, log_odds, [])
    base = MapBefore(joined.tracks, first_cell, log_odds)
    known = partial(free_share, occupancy) if log_odds is None else None
    try:
        return map_both_again(sides, kept, base, joined, config, known)
    except FormatError as error:
        raise CannotGoOn(f"{error}; map all recordings again") from error


def _tracks_before(side: Side, kept: int, config: MappingConfig) -> TrackTable:
    """Return the tracks of a map before all but some of its logged drives, one per object.

    What people had drawn by then, and have deleted since, is left out.
    """
    if kept == len(side.logged):
        return side.tracks.snapshot()
    evidence, before = EvidenceMap(config.evidence), side.logged[kept].parts[0].before.tracks
    edited = side.tracks.hand_edits().keys()
    edits = {number: edit for number, edit in before.hand_edits().items() if number in edited}
    evidence.go_on_with(before.snapshot(), edits)
    tracks = evidence.settled().snapshot()
    return moved_tracks(tracks, side.a_T_b, config.evidence, side.later)


def _cells_before(side: Side, kept: int) -> _Cells:
    """Return the cells of a map before all but some of its logged drives."""
    if kept == len(side.logged):
        return side.state.first_cell, side.state.log_odds
    before = side.logged[kept].parts[0].before
    return before.first_cell, before.log_odds


def _is_after(second: MapperState, merged: MapperState) -> bool:
    """Return whether the drives of the second map are the last ones of the merged one."""
    count = len(second.drives)
    own = [drive.keys for drive in merged.drives[-count:]]
    return count > 0 and own == [drive.keys for drive in second.drives]


def _doubt(
    state: MapperState, count: int, config: MappingConfig, first: Hypermap, merged: Hypermap
) -> Callable[[Change], float]:
    """Return how likely it is that what seems to have changed has not, given the last drives."""
    layer = layer_of_objects(merged)
    differ = partial(objects_differ_in_color, state.tracks.snapshot())
    return SecondLook(
        FrameLog(state.log),
        state.drives,
        config,
        layer_of_objects(first),
        [] if layer is None else layer.objects(),
        differ,
        count,
    ).chance


def _doubt_of_both(
    first: Hypermap, doubt: Callable[[Change], float] | None
) -> Callable[[Change], float] | None:
    """Return the doubt about changes by drives merged with a map, and by those before, unsaved."""
    if first.history is None or first.history.mapped is None:
        return doubt
    before, layer = first.history.mapped.doubt, layer_of_objects(first)
    there = set() if layer is None else {item.id for item in layer}

    def of_both(change: Change) -> float:
        is_of_first = (change.object.id in there) == (change.kind == ADDED)
        own = before if is_of_first else doubt
        return 0.0 if own is None else own(change)

    return of_both


def _source(
    first: Hypermap, drives: Iterable[Drive], doubt: Callable[[Change], float] | None
) -> Mapped:
    """Return what the changes come from, by the names and the last time of the second map's drives.

    What was merged with the first map, and not saved since, counts, too, as do corrected poses.
    """
    before = None if first.history is None else first.history.mapped
    sources = [] if before is None else [(before.drive, before.time)]
    sources += [(drive.name, drive.time) for drive in drives]
    times = [time for _, time in sources if time is not None]
    names = ", ".join(name for name, _ in sources if name)
    shifts = None if before is None else before.shifts
    return Mapped(names, max(times, default=None), doubt, shifts)


def _check_drives(first: Iterable[Drive], second: Iterable[Drive]) -> None:
    """Raise a CannotMerge if both maps contain the same frames, which would count twice."""
    for one in first:
        for other in second:
            same = len(set(one.keys) & set(other.keys))
            if same > max(1, _SAME_FRAMES * min(len(one.keys), len(other.keys))):
                raise CannotMerge(
                    f"both maps contain {same} frames of the drive {other.name!r}, which would "
                    "count twice; continue one of the maps with `hypermap map --onto` instead"
                )


def _grid_of(hypermap: Hypermap) -> OccupancyLayer:
    """Return the occupancy layer that belongs to the objects: the first one."""
    grids = (layer for layer in hypermap if isinstance(layer, OccupancyLayer))
    layer = next(grids, OccupancyLayer("occupancy", hypermap.base_frame))
    if layer.frame_id != hypermap.base_frame:
        raise CannotMerge(
            f"the occupancy layer {layer.name!r} is in {layer.frame_id!r}, not in the base frame "
            f"{hypermap.base_frame!r}"
        )
    return layer


def _tracks(hypermap: Hypermap, state: MapperState, config: MappingConfig) -> TrackTable:
    """Return the tracks of a map, with the edits made by hand."""
    evidence = EvidenceMap(config.evidence)
    evidence.go_on_with(state.tracks, edits_of(hypermap, state, config.evidence))
    return evidence.settled().snapshot()


def _is_free(grid: OccupancyLayer, grid_T_a: Pose2D, free_below: float) -> IsFree:
    def is_free(area: BaseGeometry, bottom: float) -> bool:
        # A cell is free if rays pass below a height: a table may be over it, with a cup on it.
        return bottom < free_below and free_share(grid, grid_T_a.apply_geometry(area)) >= _FREE

    return is_free


def _occupancy(
    state: MapperState, grids: tuple[OccupancyLayer, OccupancyLayer], a_T_b: Pose2D
) -> OccupancyLayer:
    """Return the merged occupancy layer; from log-odds if it was made from depth."""
    if state.log_odds is not None:
        return grids[0]
    return added_layers(*grids, a_T_b)


def _added_cells(
    first: _Cells, second: _Cells, grid: OccupancyLayer, a_T_b: Pose2D, config: MappingConfig
) -> _Cells:
    """Return the cells of two maps; no log-odds if the first has none.

    Args:
        first: of one map.
        second: of the other, whose log-odds are those of `grid` if it has none.
        grid: the occupancy layer of the second map.
        a_T_b: transforms points of the second map to the first.
        config: of both.
    """
    other = None if first[1] is None else _log_odds_of(second, grid, config)
    if first[1] is None or other is None:
        return first
    return added_log_odds(first[0], first[1], other, a_T_b, config.occupancy)


def _log_odds_of(
    cells: _Cells, grid: OccupancyLayer, config: MappingConfig
) -> tuple[GridGeometry, NDArray[np.float32]] | None:
    """Return the cells of a map as a grid and log-odds; None for none."""
    (row, col), log_odds = cells[0].tolist(), cells[1]
    if log_odds is None:
        return None if grid.grid is None else (grid.grid, log_odds_of(grid))
    if not log_odds.size:
        return None
    side = config.occupancy.resolution
    height, width = log_odds.shape
    origin = Pose2D(along(col, side), along(row, side))
    return GridGeometry(width, height, side, origin), log_odds


def _layers_of(first: Hypermap, occupancy: OccupancyLayer, second: Hypermap) -> list[Layer]:
    """Return the first map's layers, with the given occupancy layer and an empty semantic one."""
    layers: list[Layer] = []
    for layer in first:
        if isinstance(layer, SemanticLayer) and layer.name == SEMANTIC:
            empty = SemanticLayer(layer.name, layer.frame_id)
            empty.settings, empty.rejected = layer.settings, layer.rejected
            layers.append(empty)
        else:
            layers.append(occupancy if layer.name == occupancy.name else layer)
    if layer_of_objects(first) is None and layer_of_objects(second) is not None:
        layers.append(SemanticLayer(SEMANTIC, first.base_frame))
    return layers


@dataclass(frozen=True, eq=False)
class _Others:
    """Layers of the second map that are kept unchanged, and the frames of both maps."""

    layers: list[Layer]
    frames: FrameTree
    renamed: dict[str, str]


def _other_layers(first: Hypermap, second: Hypermap, a_T_b: Pose2D, skip: set[str]) -> _Others:
    kept = [layer for layer in second if layer.name not in skip]
    if not kept:
        return _Others([], first.frames, {})
    base = first.base_frame
    if second.base_frame == base or base not in frames_of(second):
        second = in_frame_of(first, second, a_T_b)
    known = frames_of(first)
    taken = {*known, *frames_of(second)}
    names = {}
    for frame in sorted((known & frames_of(second)) - {base}):
        names[frame] = free_name(frame, taken)
        taken.add(names[frame])
    second = with_frames_renamed(second, names)
    try:
        frames = FrameTree([*first.frames, *second.frames])
    except FrameError as error:
        raise FrameError(f"the frames of the two maps do not fit together: {error}") from None
    layers, renamed = [], {}
    used = {layer.name for layer in first} | {SEMANTIC}
    for layer in second:
        if layer.name in skip:
            continue
        name = layer.name if layer.name not in used else free_name(layer.name, used)
        used.add(name)
        if name != layer.name:
            renamed[layer.name] = name
            layer = copy.copy(layer)
            layer.name = name
        layers.append(layer)
    return _Others(layers, frames, renamed)


def _counted(
    hypermap: Hypermap, maps: tuple[Hypermap, Hypermap], joined: Joined, renamed: dict[str, str]
) -> Merged:
    layers = [layer_of_objects(one) for one in maps]
    ids = [set() if layer is None else {item.id for item in layer} for layer in layers]
    made = layer_of_objects(hypermap)
    there = {item.id for item in made} if made is not None else set()
    theirs = {joined.ids[number] for number in ids[1] if number in joined.ids}
    both = there & joined.pairs & ids[0] & theirs
    return Merged(
        hypermap=hypermap,
        both=len(both),
        first=len((there & ids[0]) - theirs),
        second=len(there - ids[0]),
        gone=len(ids[0] - there),
        left_out=len(theirs - ids[0] - there),
        conflicts=tuple(sorted(joined.conflicts & there)),
        renamed=renamed,
    )
