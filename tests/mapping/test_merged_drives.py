"""Which drives of two maps are mapped again, in which order, and which poses can be corrected."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.trajectory import trajectory_of
from hypermap.mapping.config import profile
from hypermap.mapping.correcting import CannotCorrect
from hypermap.mapping.counts import Counts
from hypermap.mapping.drives import Drive
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.frame_log import LogPart, MapBefore
from hypermap.mapping.going_on import state_of
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.mapper_state import MapperState
from hypermap.mapping.merging import merge_maps
from hypermap.mapping.merging.logged import Side, kept_drives
from hypermap.mapping.tracks import TrackTable

from .evidence_tools import DEFAULT, seen, square
from .merging_tools import (
    ALL,
    DAY,
    HERE,
    HOUR,
    MOVED,
    OTHER_FRAME,
    SOURCE,
    centroid,
    changed,
    first_day,
    frames,
    mapped,
    objects_of,
    second_day,
)

pytestmark = pytest.mark.xdist_group("merging")  # they share what takes long to make


def test_without_a_clock_the_second_map_is_the_later_one() -> None:
    later = mapped(frames(*MOVED), later=0.3)
    for first, second in ((first_day(), later), (later, first_day())):
        merged = merge_maps(first, second, HERE)
        assert merged.both == 3
        place = centroid(objects_of(second)["chair"])
        assert centroid(objects_of(merged.hypermap)["chair"]) == pytest.approx(place, abs=0.05)
        drives = state_of(merged.hypermap, profile("default")).drives
        assert drives[1].first + drives[1].offset > drives[0].last + 3600


def test_drives_of_two_maps_are_mapped_in_the_order_of_time() -> None:
    days = mapped(frames(*MOVED), later=2 * DAY, onto=first_day())
    between = second_day("table", "plant")
    for first, second, pose in (
        (days, between, OTHER_FRAME),
        (between, days, OTHER_FRAME.inverse()),
    ):
        merged = merge_maps(first, second, pose).hypermap
        names = [drive["name"] for drive in merged.metadata["drives"]]
        assert names == ["day 0", "day 1", "day 2"]
        found = objects_of(merged)
        assert found.keys() == {"table", "plant", "chair"}
        place = HERE if first is days else OTHER_FRAME
        assert place.apply([centroid(found["chair"])])[0] == pytest.approx((2.3, 0.9), abs=0.15)


def side_of(
    logged: Sequence[tuple[float, float]], until: float = -math.inf, later: float = 0.0
) -> Side:
    """Return a map of drives whose frames are kept, from one stamp to another, and older ones."""
    drives = [Drive("older", until - 60, until, [0, 1])] if until > -math.inf else []
    parts = []
    for begin, end in logged:
        tracks = TrackTable(DEFAULT.max_existence)
        if drives:
            evidence = EvidenceMap(DEFAULT)
            evidence.update(seen(square(0, 0, 0.5), stamp=drives[-1].last))
            tracks = evidence.tracks()
        before = MapBefore(tracks, np.zeros(2, np.int64), None)
        parts.append(LogPart(before, [begin, end], [b""] * 2, [np.eye(4)] * 2))
        drives.append(Drive(f"{begin}", begin, end, [0, 1]))
    table = TrackTable(DEFAULT.max_existence)
    state = MapperState(table, None, np.zeros(2, np.int64), None, drives, Counts(), [], log=parts)
    return Side("map", state, table, HERE, later)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        # The next day goes on from the first map, in both orders.
        (([(0, 60)],), ([(DAY, DAY + 60)],), (1, 0)),
        (([(DAY, DAY + 60)],), ([(0, 60)],), (0, 1)),
        # Days in turn: from the second one on.
        (([(0, 60), (2 * DAY, 2 * DAY + 60)],), ([(DAY, DAY + 60)],), (1, 0)),
        # What is older than what the other map keeps no frames of is joined as it is.
        (([(8 * DAY, 8 * DAY + 60)], 7 * DAY), ([(5 * DAY, 5 * DAY + 60)],), (0, 1)),
        # Two robots at the same time, of which the frames of the last minutes are kept.
        (([(3 * HOUR, 3.3 * HOUR)], 3 * HOUR), ([(3.1 * HOUR, 3.4 * HOUR)], 3.1 * HOUR), (0, 0)),
        # A map without drives, or without frames.
        (([],), ([(0, 60)],), (0, 1)),
        (([], DAY), ([(0, 60)],), (0, 1)),
        (([(0, 60)],), ([], DAY), (1, 0)),
    ],
)
def test_frames_are_mapped_again_from_where_the_maps_meet(
    first: tuple[Any, ...], second: tuple[Any, ...], expected: tuple[int, int]
) -> None:
    assert kept_drives((side_of(*first), side_of(*second))) == expected


def test_drives_that_go_on_with_a_part_of_the_log_are_mapped_together() -> None:
    side = side_of([(0, 60)])
    drives = [Drive("one", 0, 0, [0]), Drive("two", 60, 60, [1])]
    both = dataclasses.replace(side, state=dataclasses.replace(side.state, drives=drives))
    (logged,) = both.logged
    assert (logged.drives, logged.is_whole) == (tuple(drives), True)
    assert not dataclasses.replace(logged, parts=()).is_whole


def test_what_two_robots_see_at_the_same_time_is_kept() -> None:
    monday, shots = 19_000 * DAY, frames(*ALL)
    left = mapped([shot for shot in shots if shot.map_T_camera[1, 2] > 0.5], later=monday)
    right = mapped([shot for shot in shots if shot.map_T_camera[1, 2] < -0.5], later=monday)
    alone = objects_of(left), objects_of(right)
    assert alone[0].keys() != alone[1].keys()
    assert (
        state_of(left, profile("default"))
        .drives[0]
        .overlaps(state_of(right, profile("default")).drives[0])
    )
    found = [
        objects_of(merge_maps(one, other, HERE).hypermap)
        for one, other in ((left, right), (right, left))
    ]
    assert found[0].keys() == found[1].keys() == alone[0].keys() | alone[1].keys()
    for name, item in found[0].items():
        assert item.footprint.equals_exact(found[1][name].footprint, 1e-9)


def test_a_trajectory_of_one_robot_does_not_move_what_another_has_seen_at_the_same_time() -> None:
    monday, shots = 19_000 * DAY, frames(*ALL)
    maps = [mapped(shots[begin::2], later=monday) for begin in (0, 1)]
    merged = merge_maps(*maps, HERE)
    assert merged.both == 3
    mapper = Mapper.onto(merged.hypermap, SOURCE)
    stamps = np.array([shot.stamp + monday for shot in shots[::2]])
    poses = np.array([shot.map_T_camera for shot in shots[::2]])
    with pytest.raises(CannotCorrect, match="stamps do not tell which the poses are of"):
        mapper.correct(trajectory_of(stamps, poses))


def test_a_map_of_two_robots_at_the_same_time_is_merged_like_that_of_one_drive(
    tmp_path: Path,
) -> None:
    monday, shots = 19_000 * DAY, frames(*MOVED)
    earlier = mapped(frames(*ALL), later=monday)
    robots = [mapped(shots[begin::2], later=monday + DAY) for begin in (0, 1)]
    both = changed(merge_maps(*robots, HERE).hypermap, tmp_path / "both.hmap")
    for first, second in ((earlier, both), (both, earlier)):
        merged = merge_maps(first, second, HERE)
        assert (merged.both, merged.first, merged.second, merged.gone) == (3, 0, 0, 0)
        found = objects_of(merged.hypermap)
        assert found["chair"].id == objects_of(first)["chair"].id
        assert centroid(found["chair"]) == pytest.approx((2.3, 0.9), abs=0.15)
    mapper = Mapper.onto(changed(both, tmp_path / "again.hmap"), SOURCE)
    assert len(mapper.logged_poses()[0]) == 0
