"""By how much corrected poses shift what a map had before, drive by drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from hypermap.core.history import History, Mapped
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.mapping.drives import Drive
from hypermap.mapping.frame_log import FrameLog, LogPart, MapBefore
from hypermap.mapping.shifts import Shifts
from hypermap.mapping.tracks import TrackTable

MORNING = Drive("morning", first=0.0, last=4.0, keys=list(range(5)))
EVENING = Drive("evening", first=0.0, last=4.0, keys=list(range(5)), offset=7200.0)
"""Their clocks began at 0; each has a frame each second."""


def chair(number: int, first: float | None, last: float | None) -> SemanticObject:
    return SemanticObject(
        "chair", shapely.box(0, 0, 1, 1), id=number, first_seen=first, last_seen=last
    )


def history_of(*objects: SemanticObject, mapped: Mapped | None = None) -> History:
    return History(layers={"semantic": SemanticLayer("semantic", "map", objects)}, mapped=mapped)


def log(xs: Mapping[str, Sequence[float]], lost: int = 0) -> FrameLog:
    """Return the log of drives whose camera is at these places along x, without the oldest."""
    stamps: list[float] = []
    frames: list[bytes] = []
    poses: list[NDArray[np.float64]] = []
    for name, places in xs.items():
        for second, x in enumerate(places):
            pose = np.eye(4)
            pose[0, 3] = x
            stamps.append(float(second))
            frames.append(f"{name} {second}".encode())
            poses.append(pose)
    before = MapBefore(TrackTable(20.0), np.zeros(2, np.int64), None)
    return FrameLog([LogPart(before, stamps[lost:], frames[lost:], poses[lost:])])


BEFORE = {"morning": [0.0] * 5, "evening": [0.0] * 5}
DRIVES = [MORNING, EVENING]


def test_an_object_shifts_with_its_last_drive() -> None:
    seen = history_of(chair(1, 1, 3), chair(2, 1, 7202), chair(3, 7201, 7202))
    shifts = Shifts(seen)
    shifts.add(log(BEFORE), log(BEFORE | {"evening": [0.5] * 5}), DRIVES)
    by = shifts.by_id()
    assert by is not None
    assert [by[number][0] for number in (1, 2, 3)] == pytest.approx([0, 0.5, 0.5])


def test_within_a_drive_that_drifted_it_shifts_by_the_mean_of_both_ends() -> None:
    shifts = Shifts(history_of(chair(1, 1, 3)))
    shifts.add(log(BEFORE), log(BEFORE | {"morning": [0.0, 0.1, 0.2, 0.3, 0.4]}), DRIVES)
    assert shifts.by_id() == {1: pytest.approx((0.2, 0.0))}


def test_what_people_have_drawn_stays() -> None:
    shifts = Shifts(history_of(chair(1, None, None)))
    shifts.add(log(BEFORE), log({name: [1.0] * 5 for name in BEFORE}), DRIVES)
    assert shifts.by_id() == {1: (0.0, 0.0)}


def test_poses_that_stay_correct_nothing() -> None:
    shifts = Shifts(history_of(chair(1, 1, 3)))
    shifts.add(log(BEFORE), log(BEFORE), DRIVES)
    assert shifts.by_id() is None


def test_corrections_add_up_and_old_frames_may_be_lost() -> None:
    unsaved = Mapped("morning", None, shifts={1: (1.0, 2.0)})
    shifts = Shifts(history_of(chair(1, 7201, 7203), mapped=unsaved))
    assert shifts.by_id() == {1: (1.0, 2.0)}
    half = BEFORE | {"evening": [0.5] * 5}
    shifts.add(log(BEFORE), log(half, lost=4), DRIVES)
    shifts.add(log(half), log(BEFORE | {"evening": [0.75] * 5}, lost=4), DRIVES)
    assert shifts.by_id() == {1: pytest.approx((1.75, 2.0))}
    shifts.add(log(half), FrameLog(), DRIVES)  # of which nothing is known any more
    assert shifts.by_id() == {1: pytest.approx((1.75, 2.0))}
