"""Merges two maps made by mapping, so that mapping can continue the result."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.drives import BETWEEN, Drive
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.going_on import edits_of, layer_of_objects, state_of
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.mapper_state import MapperState, dump_state
from hypermap.mapping.merging.again import MappedAgain, map_both_again
from hypermap.mapping.merging.before import joined_before
from hypermap.mapping.merging.edits import Deleted
from hypermap.mapping.merging.grids import added_layers
from hypermap.mapping.merging.layers import grid_of, merged_layers
from hypermap.mapping.merging.logged import Side, in_order, kept_drives
from hypermap.mapping.merging.moving import moved_tracks
from hypermap.mapping.merging.settings import CannotMerge, common_config, naming
from hypermap.mapping.merging.source import merged_source
from hypermap.mapping.merging.tracks import Joined
from hypermap.mapping.tracks import TrackTable

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
        deleted: names of objects of one map that people have deleted in the other, and that are not
            in the result, by their ids in the first map.
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
    deleted: dict[int, str] = field(default_factory=dict)


def merge_maps(
    first: Hypermap,
    second: Hypermap,
    a_T_b: Pose2D,
    names: tuple[str, str] = ("the first map", "the second map"),
) -> Merged:
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
        names: of both maps, in messages.

    Raises:
        CannotGoOn: If a map was not made by mapping, lacks the mapper state, or is damaged.
        CannotMerge: If the configurations differ, or both contain the same frames.
        FrameError: If the frames of both maps cannot be joined in one tree.
    """
    config, settings = common_config(first, second, names)
    sides = _sides((first, second), names, a_T_b, config)
    grids = grid_of(first), grid_of(second)
    kept = len(sides[0].logged), len(sides[1].logged)
    if config.evidence.moves:  # otherwise, drives are not told apart
        kept = kept_drives(sides)
    # One that was made from depth is made of log-odds again.
    is_given = sides[0].state.log_odds is None
    occupancy = added_layers(*grids, a_T_b) if is_given else grids[0]
    made = _mapped(sides, kept, grids, occupancy, config)
    state = _state_of(sides, kept, made)
    layers = merged_layers(first, second, a_T_b, occupancy)
    merged = Hypermap(layers.layers, layers.frames, first.metadata)
    merged.mapper_state, merged.history = dump_state(state), first.history
    hypermap = Mapper.onto(merged, None).hypermap()
    assert hypermap.history is not None  # of a mapper's map
    source = merged_source(first, sides[1].state.drives, state, config, hypermap)
    hypermap.history = replace(hypermap.history, mapped=source)
    return _counted(hypermap, (first, second), sides, made.joined, layers.renamed, settings)


def _sides(
    maps: tuple[Hypermap, Hypermap], names: tuple[str, str], a_T_b: Pose2D, config: MappingConfig
) -> tuple[Side, Side]:
    """Return two maps with their tracks in the frame and the time of the merged one."""
    (a, mine), (b, theirs) = (
        _opened(one, name, config) for one, name in zip(maps, names, strict=True)
    )
    _check_drives(a.drives, b.drives)
    later = _later(a.drives, b.drives)
    theirs = moved_tracks(theirs, a_T_b, config.evidence, later)
    return Side(names[0], a, mine, Pose2D(), 0.0), Side(names[1], b, theirs, a_T_b, later)


def _opened(hypermap: Hypermap, name: str, config: MappingConfig) -> tuple[MapperState, TrackTable]:
    """Return the state of a map, and its tracks with the edits made by hand."""
    with naming(name):
        state = state_of(hypermap, config)
        edits = edits_of(hypermap, state, config.evidence)
    evidence = EvidenceMap(config.evidence)
    evidence.go_on_with(state.tracks, edits)
    return state, evidence.settled().snapshot()


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


def _mapped(
    sides: tuple[Side, Side],
    kept: tuple[int, int],
    grids: tuple[OccupancyLayer, OccupancyLayer],
    occupancy: OccupancyLayer,
    config: MappingConfig,
) -> MappedAgain:
    """Return two maps as one: joined as they were, then with all later frames mapped again."""
    joined, base = joined_before(sides, kept, grids, config)
    if not in_order(sides, kept):
        return MappedAgain(joined, base.first_cell, base.log_odds, [])
    is_free = partial(free_share, occupancy) if base.log_odds is None else None
    return map_both_again(sides, kept, base, joined, config, is_free)


def _state_of(sides: tuple[Side, Side], kept: tuple[int, int], made: MappedAgain) -> MapperState:
    """Return the state from which mapping can continue, with the log of all frames in it."""
    drives = [drive for n, side in zip(kept, sides, strict=True) for drive in side.drives_before(n)]
    drives += [side.in_time(d) for side, one in in_order(sides, kept) for d in one.drives]
    first, second = (side.state for side in sides)
    return MapperState(
        tracks=made.joined.tracks,
        keyframe=None,
        first_cell=made.first_cell,
        log_odds=made.log_odds,
        drives=_marked(drives, sides),
        counts=first.counts + second.counts,
        published=[],  # `Mapper.onto` publishes all
        alignment=first.alignment,
        log=made.log,
    )


def _marked(drives: Iterable[Drive], sides: tuple[Side, Side]) -> list[Drive]:
    """Return the drives of both maps; those at the same time as one of the other map are marked."""
    mine, theirs = ([side.in_time(drive) for drive in side.state.drives] for side in sides)
    pairs = itertools.product(mine, theirs)
    beside = [
        drive.keys
        for one, other in pairs
        if one.offset == other.offset and one.overlaps(other)
        for drive in (one, other)
    ]
    return [replace(d, is_beside=True) if d.keys in beside else d for d in drives]


def _names(hypermap: Hypermap) -> dict[int, str]:
    """Return the names of a map's objects, by their ids."""
    layer = layer_of_objects(hypermap)
    return {} if layer is None else {item.id: item.name for item in layer if item.id is not None}


def _counted(
    hypermap: Hypermap,
    maps: tuple[Hypermap, Hypermap],
    sides: tuple[Side, Side],
    joined: Joined,
    renamed: dict[str, str],
    settings: tuple[str, ...],
) -> Merged:
    """Return the merged map, with the numbers of objects that came from the two maps."""
    mine, others, there = _names(maps[0]), _names(maps[1]), _names(hypermap).keys()
    own_ids = {joined.ids[own]: own for own in others if own in joined.ids}
    theirs = {number: others[own] for number, own in own_ids.items()}
    by_hand = Deleted.of(joined.tracks)
    deleted = {
        number: name
        for side, names, ids in ((sides[1], theirs, own_ids), (sides[0], mine, {}))
        for number, name in names.items()
        if number not in there and by_hand.at(side.tracks, ids.get(number, number)) is not None
    }
    return Merged(
        hypermap=hypermap,
        both=len(there & joined.pairs & mine.keys() & theirs.keys()),
        first=len((there & mine.keys()) - theirs.keys()),
        second=len(there - mine.keys()),
        gone=len(mine.keys() - there - deleted.keys()),
        left_out=len(theirs.keys() - mine.keys() - there - deleted.keys()),
        conflicts=tuple(sorted(joined.conflicts & there)),
        renamed=renamed,
        settings=settings,
        deleted=dict(sorted(deleted.items())),
    )
