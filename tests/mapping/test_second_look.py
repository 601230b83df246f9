"""What a drive has detected is not called new or gone, though only one map has it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity
from numpy.typing import NDArray

from hypermap.core.history import ADDED, GONE, Change
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.trajectory import pose_from_rpy
from hypermap.mapping.config import profile
from hypermap.mapping.drives import Drive
from hypermap.mapping.frame_log import FrameLog, LoggedFrame, MapBefore, packed_frame
from hypermap.mapping.second_look import SecondLook
from hypermap.mapping.tracks import TrackTable
from hypermap.perception.depth_view import DepthView
from hypermap.perception.frame import Camera
from hypermap.perception.observation import Observation, ObservedObject

DAY = 86_400.0
CAMERA = Camera.from_intrinsics(60.0, 60.0, 39.5, 29.5, width=80, height=60)
HEIGHTS = {"z_min": 0.0, "z_max": 1.0}
CHAIR = SemanticObject("chair", shapely.box(1.8, -0.2, 2.2, 0.2), id=3, attributes=HEIGHTS)


INSIDE = shapely.box(1.85, -0.15, 2.15, 0.15)


def looked(
    stamp: float,
    shows: str | None,
    x: float = 0.0,
    reach: float | NDArray[np.float64] = 6.0,
    shapes: Sequence[shapely.Polygon] = (INSIDE,),
) -> LoggedFrame:
    """Return a frame that looks along x, at a chair's place, and may detect something there."""
    pose = pose_from_rpy(x, 0, 0.5, -np.pi / 2, 0, -np.pi / 2)
    view = DepthView(CAMERA, pose, np.full((60, 80), reach, np.float32), 6.0)
    found = () if shows is None else shapes
    objects = tuple(ObservedObject(shows or "", 0.9, shape, 0.0, 1.0) for shape in found)
    area = shapely.box(0, -3, 6, 3)
    return LoggedFrame(Observation(stamp, pose, objects, area, view, (0.0, 0.0, 0.0)), None, True)


def look(*days: list[LoggedFrame]) -> SecondLook:
    """Return a second look at drives, of which the log has all frames."""
    log = FrameLog()
    log.begin_part(MapBefore(TrackTable(20.0), np.zeros(2, np.int64), None))
    for frame in (frame for day in days for frame in day):
        seen = frame.observation
        log.add(seen.stamp, packed_frame(frame), seen.map_T_camera)
    drives = [Drive(f"day {n}", keys=[1] * len(day)) for n, day in enumerate(days)]
    return SecondLook(log, drives, profile("default"))


def frames(day: int, *shows: str | None, **kwargs: Any) -> list[LoggedFrame]:
    return [looked(day * DAY + i, one, **kwargs) for i, one in enumerate(shows)]


SEEN = ("chair", "chair", None, "chair")
EMPTY = (None, None, None, None)
CAME, LEFT = (Change(ADDED, "semantic", None, CHAIR), Change(GONE, "semantic", CHAIR, None))


def test_what_one_drive_has_detected_did_not_come_or_go() -> None:
    assert look(frames(0, *SEEN), frames(1, *SEEN)).chance(CAME) > 0.98
    assert look(frames(0, *EMPTY), frames(1, *SEEN)).chance(CAME) < 0.02
    assert look(frames(0, *SEEN), frames(1, *SEEN)).chance(LEFT) > 0.98
    assert look(frames(0, *SEEN), frames(1, *EMPTY)).chance(LEFT) < 0.02


def test_the_last_drive_that_could_see_the_place_decides() -> None:
    aside = frames(1, *EMPTY, x=-9.0)  # too far away
    hidden = frames(1, *EMPTY, reach=1.0)
    for unseen in (aside, hidden):
        assert look(frames(0, *SEEN), unseen, frames(2, *SEEN)).chance(CAME) > 0.98
    assert look(frames(0, *SEEN), frames(1, *EMPTY), frames(2, *SEEN)).chance(CAME) < 0.02
    assert look(frames(0, *SEEN), aside).chance(LEFT) == 0
    assert look(frames(0, *SEEN)).chance(CAME) == 0  # there is no earlier drive


def test_drives_whose_clocks_begin_at_zero_are_told_apart() -> None:
    assert look(frames(0, *SEEN), frames(0, *EMPTY)).chance(LEFT) < 0.02
    assert look(frames(0, *EMPTY), frames(0, *SEEN)).chance(CAME) < 0.02


def test_the_log_may_have_lost_the_oldest_frames() -> None:
    second = look(frames(0, *SEEN), frames(1, *EMPTY))
    second.drives[0].keys.extend([1] * 1000)
    assert second.chance(CAME) > 0.98
    second.drives[1].keys.extend([1] * 1000)
    assert second.chance(CAME) == 0


def test_other_things_and_a_rare_false_detection_do_not_count() -> None:
    assert look(frames(0, *["table"] * 4), frames(1)).chance(CAME) < 0.02
    assert look(frames(0, "chair", *EMPTY), frames(1)).chance(CAME) < 0.2
    assert look(frames(0, "chair"), frames(1)).chance(CAME) == pytest.approx(15 / 16)


def test_a_damaged_log_does_not_keep_a_map_from_being_saved() -> None:
    second = look(frames(0, *SEEN), frames(1, *SEEN))
    second.log.parts[0].frames[1] = b"damaged"
    assert second.chance(CAME) == 0


NEIGHBOR = SemanticObject("chair", shapely.box(1.8, 0.25, 2.2, 0.65), id=2, attributes=HEIGHTS)


def neighbor(found: int, y: float = 0.0, name: str = "chair") -> SemanticObject:
    """Return a chair beside `CHAIR`, found in so many frames."""
    shape = shapely.affinity.translate(NEIGHBOR.footprint, 0, y)
    attributes = HEIGHTS | {"evidence": found}
    return dataclasses.replace(NEIGHBOR, name=name, footprint=shape, attributes=attributes)


@pytest.mark.parametrize(
    ("item", "before", "after", "was_there", "is_there"),
    [
        (CHAIR, neighbor(8), neighbor(16), False, False),
        (CHAIR, neighbor(8), neighbor(8), True, True),  # the present drive has not found it
        (CHAIR, neighbor(8), neighbor(16, y=1.0), False, True),  # it was moved since
        (CHAIR, neighbor(8, name="bin"), neighbor(16, name="bin"), True, True),
        # Both may be one, mapped twice, unless the present drive shows both at once.
        (CHAIR, neighbor(8, y=-0.2), neighbor(16, y=-0.2), False, True),
        (dataclasses.replace(CHAIR, footprint=shapely.box(2, 0, 2.2, 0.2)),
         neighbor(8), neighbor(16), True, True),  # too small to tell
    ],
)  # fmt: skip
def test_detections_of_an_unmoved_neighbor_are_of_that_one(
    item: SemanticObject,
    before: SemanticObject,
    after: SemanticObject,
    was_there: bool,
    is_there: bool,
) -> None:
    shown = [shapely.box(1.85, 0.18, 2.15, 0.6)]
    drives = [frames(day, *SEEN, shapes=shown) for day in (0, 1)]
    both = [frames(day, *SEEN, shapes=[*shown, INSIDE]) for day in (0, 1)]
    layer = SemanticLayer("semantic", "map", [before])
    came, left = Change(ADDED, "semantic", None, item), Change(GONE, "semantic", item, None)
    for change, days, expected in (
        (came, (drives[0], both[1]), was_there),
        (left, (both[0], drives[1]), is_there),
    ):
        second = dataclasses.replace(look(*days), before=layer, after=[after, item])
        assert (second.chance(change) > 0.98) == expected
        assert (second.chance(change) < 0.02) != expected


@pytest.mark.parametrize(
    ("other", "shows", "is_second"),
    [
        (neighbor(8), [NEIGHBOR.footprint], True),
        (neighbor(8), [shapely.box(1.85, 0.18, 2.15, 0.6)], True),  # it reaches over both
        (neighbor(8, y=-0.2), [NEIGHBOR.footprint], True),  # both share floor
        (neighbor(8), [NEIGHBOR.footprint, INSIDE], False),
        (neighbor(8, y=-0.2), [shapely.box(1.85, 0.1, 2.15, 0.5), INSIDE], False),
        (neighbor(8, y=0.5), [shapely.box(1.8, 0.2, 2.2, 0.3)], False),  # far from each other
        (neighbor(8, name="bin"), [INSIDE], False),
    ],
)
def test_a_second_object_of_one_thing_did_not_come_or_go(
    other: SemanticObject, shows: list[shapely.Polygon], is_second: bool
) -> None:
    layer = SemanticLayer("semantic", "map", [other, CHAIR])
    for change, days in (
        (CAME, (frames(0, *EMPTY), frames(1, *SEEN, shapes=shows))),
        (LEFT, (frames(0, *SEEN, shapes=shows), frames(1, *EMPTY))),
    ):
        second = dataclasses.replace(look(*days), before=layer, after=layer.objects())
        assert (second.chance(change) > 0.98) == is_second
        assert (second.chance(change) < 0.02) != is_second


@pytest.mark.parametrize("are_two", [True, False])
def test_detections_of_one_of_another_color_that_stood_there_instead_are_of_that_one(
    are_two: bool,
) -> None:
    other = dataclasses.replace(neighbor(8), id=2)
    theirs, own = ([shape] for shape in (shapely.box(1.85, 0.18, 2.15, 0.6), INSIDE))
    for change, shows in ((CAME, (theirs, own)), (LEFT, (own, theirs))):
        days = [frames(day, *SEEN, shapes=shapes) for day, shapes in enumerate(shows)]
        before, after = ([other], [CHAIR]) if change is CAME else ([CHAIR], [other])
        layer = SemanticLayer("semantic", "map", before)
        second = dataclasses.replace(
            look(*days),
            before=layer,
            after=after,
            differ=lambda was, now: are_two and {was, now} == {2, 3},
        )
        assert (second.chance(change) < 0.02) == are_two


def test_what_no_frame_could_see_is_no_second_object() -> None:
    layer = SemanticLayer("semantic", "map", [neighbor(8), CHAIR])
    hidden = look(frames(0, *EMPTY), frames(1, *SEEN, reach=1.0))
    second = dataclasses.replace(hidden, before=layer, after=layer.objects())
    assert second.chance(CAME) < 0.02


def test_what_a_frame_shows_beside_an_unmoved_neighbor_is_another_one() -> None:
    shown = [NEIGHBOR.footprint, shapely.box(1.85, 0.1, 2.15, 0.5)]
    second = look(frames(0, *SEEN, shapes=shown), frames(1, *SEEN, shapes=shown))
    layer = SemanticLayer("semantic", "map", [neighbor(8)])
    second = dataclasses.replace(second, before=layer, after=[neighbor(16), CHAIR])
    assert second.chance(CAME) > 0.98


def test_outlines_that_cross_themselves_are_compared_all_the_same() -> None:
    bow = shapely.Polygon([(1.8, 0.25), (2.2, 0.65), (2.2, 0.25), (1.8, 0.65)])
    shown = [shapely.box(1.85, 0.18, 2.15, 0.6)]
    both = [*shown, INSIDE]
    second = look(frames(0, *SEEN, shapes=shown), frames(1, *SEEN, shapes=both))
    crossed = [dataclasses.replace(neighbor(found), footprint=bow) for found in (8, 16)]
    layer = SemanticLayer("semantic", "map", crossed[:1])
    second = dataclasses.replace(second, before=layer, after=[crossed[1], CHAIR])
    assert second.chance(CAME) < 0.02


THING = SemanticObject("bin", shapely.box(1.8, 0.1, 2.2, 0.5), id=8, attributes=HEIGHTS)
SHELF = dataclasses.replace(CHAIR, footprint=shapely.box(1.94, -0.2, 2.06, 0.2))
PLANT = dataclasses.replace(CHAIR, footprint=shapely.box(1.92, -0.2, 2.08, 0.2))


@pytest.mark.parametrize(
    ("item", "here", "reach", "stays"),
    [
        (CHAIR, 2.0, 2.0, True),
        (CHAIR, 2.0, 6.0, False),  # the place is empty
        (CHAIR, 6.0, 6.0, False),  # rays pass it in any case
        (PLANT, 2.0, 2.0, True),
        (SHELF, 2.0, 2.0, False),  # rays would end at the wall behind
    ],
)
def test_what_stops_as_many_rays_as_before_did_not_come_or_go(
    item: SemanticObject, here: float, reach: float, stays: bool
) -> None:
    with_it = {"reach": here, "shapes": [item.footprint]}
    for kind, days in (
        (ADDED, (frames(0, *EMPTY, reach=reach), frames(1, *SEEN, **with_it))),
        (GONE, (frames(0, *SEEN, **with_it), frames(1, *EMPTY, reach=reach))),
    ):
        change = Change(kind, "semantic", *((None, item) if kind == ADDED else (item, None)))
        assert (look(*days).chance(change) > 0.8) == stays


@pytest.mark.parametrize(("passing", "stays"), [(0, True), (2, False)])
def test_the_last_drive_that_shows_it_tells_how_many_rays_it_stops(
    passing: int, stays: bool
) -> None:
    """The one before may have overlooked it, or it was gone already."""
    reach = np.where(np.arange(80) % 4 < passing, 6.0, 2.0)  # of some columns, rays pass
    later = [frames(n, *EMPTY, reach=reach) for n in (1, 2)]
    assert (look(frames(0, *SEEN, reach=2.0), *later).chance(LEFT) > 0.8) == stays
    assert look(*later).chance(LEFT) < 0.1  # no drive shows it


@pytest.mark.parametrize(("x", "stays"), [(0.0, False), (0.5, True)])
def test_another_thing_that_has_come_instead_stops_rays_too(x: float, stays: bool) -> None:
    bin_ = dataclasses.replace(THING, footprint=shapely.affinity.translate(THING.footprint, 0, x))
    with_it, without = frames(0, *SEEN, reach=2.0), frames(1, *EMPTY, reach=2.0)
    before = SemanticLayer("semantic", "map", [CHAIR])
    second = dataclasses.replace(look(with_it, without), before=before, after=[bin_])
    assert (second.chance(LEFT) > 0.8) == stays
    known = SemanticLayer("semantic", "map", [CHAIR, bin_])
    second = dataclasses.replace(look(with_it, without), before=known, after=[bin_])
    assert second.chance(LEFT) > 0.8  # it was there before
    moved = [dataclasses.replace(bin_, footprint=shapely.box(4, 0, 4.4, 0.4)), CHAIR]
    second = dataclasses.replace(look(without, with_it), before=before, after=moved)
    second = dataclasses.replace(second, before=SemanticLayer("semantic", "map", [bin_]))
    assert (second.chance(CAME) > 0.8) == stays  # it was there, and has made room


@pytest.mark.parametrize(("passing", "is_there"), [(0, True), (3, False)])
def test_where_most_rays_pass_that_it_stopped_it_is_not_there(passing: int, is_there: bool) -> None:
    """What that drive detects is the chair beside it."""
    beside = shapely.box(1.85, 0.18, 2.15, 0.6)
    reach = np.where(np.arange(80) % 4 < passing, 6.0, 2.0)  # of some columns, rays pass
    without = {"reach": reach, "shapes": [beside]}
    layer = SemanticLayer("semantic", "map", [neighbor(8), CHAIR])
    for shown in ([INSIDE], [INSIDE, beside]):
        with_it = {"reach": 2.0, "shapes": shown}
        for change, days in (
            (CAME, (frames(0, *SEEN, **without), frames(1, *SEEN, **with_it))),
            (LEFT, (frames(0, *SEEN, **with_it), frames(1, *SEEN, **without))),
        ):
            second = dataclasses.replace(look(*days), before=layer, after=layer.objects())
            assert (second.chance(change) > 0.8) == is_there
            assert (second.chance(change) < 0.2) != is_there


@pytest.mark.parametrize(
    ("passing", "looks", "is_there"),
    [(2, 4, True), (2, 12, False), (0, 12, True)],
    ids=["few looks", "many looks", "all rays end there"],
)
def test_what_many_frames_do_not_detect_is_gone_where_most_rays_pass_in_any_case(
    passing: int, looks: int, is_there: bool
) -> None:
    """As below a table: few rays tell whether it is there."""
    reach = np.where(np.arange(80) % 4 < passing, 6.0, 2.0)  # of some columns, rays pass
    without = frames(1, *[None] * looks, reach=reach)
    assert (look(frames(0, *SEEN, reach=reach), without).chance(LEFT) > 0.8) == is_there
