"""What the default profile makes of rooms: what is moved, hidden, side by side, or wrong."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import affinity

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_buffer import evidence_from
from hypermap.mapping.missed_detections import penalize_missed
from hypermap.mapping.tracks import TrackTable
from hypermap.perception.observation import Observation, ObservedObject

from .evidence_tools import (
    CHAIR,
    DAY,
    DEFAULT,
    NOWHERE,
    level,
    only,
    published_all,
    seen,
    square,
    viewed,
)


def tracks(evidence: EvidenceMap) -> list[SemanticObject]:
    """Return the published tracks, before one class is decided on for each place."""
    return evidence.objects({number for number, *_ in evidence.summary()})


LEAKS = [square(2.05, 0, side=side) for side in (0.2, 0.3, 1.2)]  # one place, but not one shape


def test_a_moved_chair_is_gone_within_ten_seconds_of_looking_at_its_old_place() -> None:
    evidence = EvidenceMap(DEFAULT)
    for k in range(100):  # as well known as can be
        evidence.update(viewed(seen(CHAIR, stamp=k / 2), level(2.0)))
    assert only(evidence).existence == DEFAULT.max_existence
    moved = square(4.0, 1.0, side=0.5)
    for k in range(20):  # ten seconds at two frames per second
        evidence.update(viewed(seen(moved, stamp=50 + k / 2), level(4.0)))
    assert only(evidence).footprint.intersects(moved)


def test_what_is_hidden_loses_nothing() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    evidence.update(viewed(seen(CHAIR), level(2.0)))
    evidence.update(viewed(seen(), level(1.0)))  # someone stands before it
    assert only(evidence).existence == 1.5
    evidence.update(viewed(seen(), level(2.0)))  # it is there, and the detector missed it
    once = 1.5 - 0.3 * math.log(1 - 1.8 / 3) / math.log(1 - 0.8)  # it is found in 1.8 of 3 frames
    assert only(evidence).existence == pytest.approx(once)
    evidence.update(viewed(seen(), level(5.0)))  # it is not there
    assert only(evidence).existence == pytest.approx(once - 1)


def from_side(observation: Observation, x: float) -> Observation:
    """The same from a camera whose view is level, before or behind the chair at x = 2."""
    view = level(2.0, x)
    view.map_T_camera[:2, :3] *= 1 if x < 2 else -1
    return dataclasses.replace(observation, map_T_camera=view.map_T_camera, view=None)


def often_missed(
    shapes: Sequence[shapely.Polygon], sides: Sequence[float], **changed: Any
) -> EvidenceMap:
    """Return a map after frames that show a chair from some sides, each followed by 3 misses."""
    evidence = EvidenceMap(dataclasses.replace(DEFAULT, **changed))
    for k, (shape, x) in enumerate(zip(shapes, sides, strict=True)):
        evidence.update(from_side(seen(shape, stamp=4.0 * k, score=0.7), x))
        for n in range(3):
            evidence.update(viewed(seen(stamp=4.0 * k + 1 + n), level(2.0)))
    return evidence


def test_a_thing_that_is_seldom_found_is_there_if_all_views_agree() -> None:
    chairs, sides = [CHAIR] * 4, [0.0, 4.0, 0.0, 4.0]
    assert only(often_missed(chairs, sides)).confidence[0] > 0.9
    assert len(often_missed(chairs, sides, detection_rate="fixed")) == 0


@pytest.mark.parametrize(("y", "cost"), [(0.0, 0.3), (0.6, 0.171)])
def test_a_piece_of_a_chair_that_is_shown_was_not_missed_for_being_seldom_found(
    y: float, cost: float
) -> None:
    tracks = TrackTable(max_existence=20.0)
    frame = viewed(seen(CHAIR), level(2.0))
    for shape in (CHAIR, square(2.05, y, side=0.2)):
        ((_, evidence),) = evidence_from(seen(shape))
        tracks.objects[tracks.append("chair", 0, evidence, 100)].buffer.add(evidence)
    penalize_missed(tracks, frame, {0}, DEFAULT)
    assert tracks.existence.tolist() == pytest.approx([0, -cost], abs=1e-3)
    assert tracks.missed(1)[1] == pytest.approx(0.3 - cost, abs=1e-3)


def test_pieces_that_are_seldom_found_and_disagree_are_no_thing() -> None:
    assert len(often_missed(LEAKS, [0.0] * 3)) == 0
    assert len(often_missed(LEAKS, [0.0] * 3, min_probability=0.0)) == 1


def test_what_is_in_the_map_at_once_needs_to_be_probable() -> None:
    for config, count in ((DEFAULT, 0), (dataclasses.replace(DEFAULT, min_probability=0.0), 1)):
        evidence = EvidenceMap(config)
        for k, leak in enumerate(LEAKS):
            evidence.update(viewed(seen(leak, stamp=float(k), score=0.5), level(4.0)))
        assert len(evidence) == count


def test_where_only_the_area_counts_what_is_hidden_loses_too() -> None:
    evidence = EvidenceMap(published_all(dataclasses.replace(DEFAULT, sight="area")))
    evidence.update(viewed(seen(CHAIR), level(2.0)))
    evidence.update(viewed(seen(), level(1.0)))
    assert only(evidence).existence == 1.2


def test_a_false_train_does_not_survive_a_second_look() -> None:
    evidence = EvidenceMap(DEFAULT)
    wall = shapely.box(3.0, -1.5, 3.05, 1.5)
    for k in range(2):  # 0.6 is the best score that a wall gets
        evidence.update(viewed(seen(wall, name="train", score=0.6, stamp=k), level(3.0)))
    assert len(evidence) == 0
    evidence.update(viewed(seen(wall, name="train", score=0.6, stamp=2), level(3.0)))
    assert len(evidence) == 1  # three times at once is believed
    for k in range(4):
        evidence.update(viewed(seen(stamp=3 + k), level(3.0)))
    assert len(evidence) == 0


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.1))
@settings(deadline=None, max_examples=25)
def test_two_chairs_side_by_side_stay_two(seed: int, gap: float) -> None:
    # Their footprints wander by several centimeters, so that they overlap now and then.
    rng = np.random.default_rng(seed)
    evidence = EvidenceMap(DEFAULT)
    for k in range(30):
        left, right = square(0, 0, side=0.5), square(0, 0.5 + gap, side=0.5)
        drift = rng.normal(0, 0.03, 2)
        shown = [
            affinity.translate(chair, *(drift + rng.normal(0, 0.02, 2)))
            for chair in (left, right)
            if rng.random() > 0.15
        ]
        evidence.update(seen(*shown, stamp=k / 2, score=0.8))
    chairs = evidence.objects()
    assert len(chairs) == 2
    ys = sorted(chair.footprint.centroid.y for chair in chairs)
    assert ys == pytest.approx([0.0, 0.5 + gap], abs=0.08)


def test_what_was_seen_beside_a_part_of_an_object_is_not_combined_with_the_whole() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    left, right, beside = (shapely.box(x, 0, x + 1, 1) for x in (0, 1.5, 2.6))
    for _ in range(5):
        evidence.update(seen(left, area=NOWHERE))
        evidence.update(seen(right, beside, area=NOWHERE))
    for _ in range(5):  # left and right are parts of one
        evidence.update(seen(shapely.box(0, 0, 2.5, 1), area=NOWHERE))
    assert [found.id for found in evidence.objects()] == [0, 2]
    for _ in range(5):  # now the other one grows into it, by wrong shapes
        evidence.update(seen(shapely.box(0.5, 0, 3.6, 1), area=NOWHERE))
    assert [found.id for found in evidence.objects()] == [0, 2]


@pytest.mark.parametrize(("abstain", "width"), [("outside", 0.5), ("hidden", 1.0)])
def test_what_is_hidden_behind_walls_votes_as_configured(
    abstain: Literal["hidden", "outside"], width: float
) -> None:
    """A wall at x = 2 hides the second half of a table that most frames look at from afar."""
    evidence = EvidenceMap(dataclasses.replace(published_all(DEFAULT), abstain=abstain, align=0))
    table, half = shapely.box(1.5, -0.25, 2.5, 0.25), shapely.box(1.5, -0.25, 2.0, 0.25)
    evidence.update(viewed(seen(table), level(4.0)))
    for _ in range(9):
        evidence.update(viewed(seen(half), level(2.0)))
    xmin, _, xmax, _ = only(evidence).footprint.bounds
    assert xmax - xmin == pytest.approx(width, abs=0.05)


def test_two_shapes_of_one_frame_go_to_two_objects() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    evidence.update(seen(square(0)))
    evidence.update(seen(square(0), square(0.3)))
    assert [found.attributes["evidence"] for found in evidence.objects()] == [2, 1]


def test_a_slip_of_the_detector_adds_nothing() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    for _ in range(4):
        evidence.update(seen(square(0), name="table"))
    evidence.update(seen(square(0.1), name="chair"))
    table = only(evidence)
    assert (table.name, table.attributes["evidence"], table.existence) == ("table", 4, 6)


def test_without_slips_the_same_shape_of_another_class_is_another_object() -> None:
    evidence = EvidenceMap(published_all(dataclasses.replace(DEFAULT, slip=1.0)))
    for _ in range(4):
        evidence.update(seen(square(0), name="table"))
    evidence.update(seen(square(0), name="chair"))
    assert [found.name for found in evidence.objects()] == ["table", "chair"]


def test_what_is_like_an_object_of_its_own_class_is_no_slip() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    evidence.update(seen(square(0), name="chair"))
    for _ in range(4):
        evidence.update(seen(square(0), name="table", area=NOWHERE))
    evidence.update(seen(square(0), name="chair", area=NOWHERE))
    counts = {found.name: found.attributes["evidence"] for found in tracks(evidence)}
    assert counts == {"chair": 2, "table": 4}


def test_what_stands_on_a_table_is_no_slip() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    for _ in range(4):
        evidence.update(seen(square(0), name="table"))
    cloth = ObservedObject("cloth", 0.9, square(0), z_min=0.9, z_max=0.95)
    evidence.update(Observation(0.0, np.eye(4), (cloth,), NOWHERE))
    assert [found.name for found in evidence.objects()] == ["table", "cloth"]


def test_classes_compete_for_a_place() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    evidence.update(seen(square(0), name="train", area=NOWHERE))
    evidence.update(seen(square(0.1), name="table", area=NOWHERE))
    train, table = tracks(evidence)
    assert (train.existence, table.existence) == (1.0, 1.5)
    evidence.update(seen(square(5), name="table", area=NOWHERE))  # elsewhere
    assert [found.existence for found in tracks(evidence)] == [1.0, 1.5, 1.5]


def test_a_cup_that_another_drive_sees_from_as_far_as_before_is_told_to_have_moved() -> None:
    evidence = EvidenceMap(DEFAULT)
    cup, elsewhere = square(3.0, -1.5, side=0.08), square(3.0, 1.5, side=0.08)
    for day, (place, depth) in enumerate([(cup, 2.95), (elsewhere, 6.0)]):
        for k in range(9):
            observation = seen(place, name="cup", stamp=DAY * day + k, bottom=0.95, top=1.05)
            evidence.update(viewed(observation, level(depth)))
    found = only(evidence)
    assert found.id == 0
    assert "moved" in found.attributes
    assert found.footprint.intersects(elsewhere)


@pytest.mark.parametrize(("depth", "is_there"), [(0.06, False), (0.5, True)])
def test_a_curtain_that_is_not_found_before_its_wall_is_gone_and_not_a_cupboard(
    depth: float, is_there: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    thing = shapely.box(2.0, -0.5, 2.0 + depth, 0.5)
    for k in range(9):
        evidence.update(viewed(seen(thing, name="thing", stamp=float(k)), level(2.0)))
    for k in range(9):  # rays end as near as before: at the wall, or at the cupboard
        evidence.update(viewed(seen(name="thing", stamp=DAY + k), level(2.05)))
    assert len(evidence) == is_there


def test_a_second_track_of_a_curtain_that_stayed_is_not_another_one_that_was_moved() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    gone, kept = shapely.box(3.0, -1.6, 3.06, -0.6), shapely.box(3.0, 0.6, 3.06, 1.6)
    double = affinity.translate(kept, -0.2, 0)
    for k in range(12):
        evidence.update(viewed(seen(gone, kept, name="curtain", stamp=float(k)), level(3.0)))
    for k in range(12):  # poses put it to two places
        item = seen([kept, double][k % 2], name="curtain", stamp=DAY + k)
        evidence.update(viewed(item, level(3.0)))
    assert not any("moved" in item.attributes for item in evidence.objects() if item.id == 0)
