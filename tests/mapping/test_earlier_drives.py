"""What a drive has found is joined to what earlier ones knew: nothing is lost, or there twice."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.track_arrays import packed_tables, unpacked_tables

from .evidence_tools import DAY, DEFAULT, only, seen, square

places = st.tuples(st.integers(-8, 8), st.integers(-8, 8)).map(lambda at: (at[0] / 2, at[1] / 2))
frames = st.lists(places, max_size=5, unique=True)
drives = st.lists(frames, min_size=1, max_size=12)


def mapped(*days: list[list[tuple[float, float]]]) -> EvidenceMap:
    """Return a map of drives a day apart, whose frames show chairs at some places."""
    evidence = EvidenceMap(DEFAULT)
    for day, drive in enumerate(days):
        for second, shown in enumerate(drive):
            shapes = [square(x, y, side=0.6) for x, y in shown]
            evidence.update(seen(*shapes, stamp=day * DAY + second))
    return evidence


@settings(max_examples=60, deadline=None)
@given(drives, drives, drives)
def test_joining_drives_loses_and_doubles_nothing(
    first: list[list[tuple[float, float]]],
    second: list[list[tuple[float, float]]],
    third: list[list[tuple[float, float]]],
) -> None:
    evidence = mapped(first, second, third)
    apart = evidence.tracks()
    before = packed_tables(apart)
    table = evidence.settled()

    ids = [track.id for track in table.objects]
    assert ids == sorted(set(ids))
    known = {track.id for track in apart.objects if track.id < apart.first_id}
    assert known <= set(ids) <= {track.id for track in apart.objects}

    for track in table.objects:  # frames that show two tracks show each of them
        for other, count in track.co_occurrences.items():
            (row,) = table.rows_of([other])
            assert table.objects[row].co_occurrences[track.id] == count
            assert other != track.id

    own = [
        item for track in apart.objects if track.id >= apart.first_id for item in track.buffer.items
    ]
    kept = [id(item) for track in table.objects for item in track.buffer.items]
    assert len(kept) == len(set(kept))
    assert {id(item) for item in own} <= set(kept)

    after = packed_tables(evidence.tracks())
    assert before.facts == after.facts
    for name, values in before.arrays.items():
        np.testing.assert_array_equal(values, after.arrays[name])


@settings(max_examples=30, deadline=None)
@given(drives)
def test_the_first_drive_has_nothing_to_be_joined_to(
    drive: list[list[tuple[float, float]]],
) -> None:
    evidence = mapped(drive)
    assert evidence.tracks().first_id == 0
    assert evidence.settled() is evidence.settled()
    assert len(evidence.settled().objects) == len(evidence.tracks().objects)


def test_equal_chairs_in_a_row_keep_their_ids_whichever_is_seen_first() -> None:
    row = [(float(x), 0.0) for x in (-1, 0, 1)]
    first = {item.footprint.centroid.x: item.id for item in mapped([row] * 6).objects()}
    for order in (row, row[::-1]):
        shifted = [(x + 0.1, y) for x, y in order]
        evidence = mapped([row] * 6, [shifted[: n + 1] for n in range(3)] * 4)
        found = [(item.footprint.centroid.x, item.id) for item in evidence.objects()]
        assert len(found) == 3
        for x, number in found:
            assert first[min(first, key=lambda was: abs(was - x))] == number


def test_of_two_equal_chairs_the_one_that_is_gone_is_not_the_one_that_was_moved() -> None:
    """The second one comes to half a meter from where the first one stood."""
    evidence = mapped([[(0.0, 0.0), (1.5, 0.0)]] * 6, [[(0.5, 0.0)]] * 40)
    chair = only(evidence)
    assert chair.attributes["moved"]["confidence"] < 1
    left = 1 - chair.id
    (row,) = evidence.settled().rows_of([left])
    assert evidence.settled().objects[row].gone_since is not None


def test_a_drive_adds_to_an_edited_object_at_once() -> None:
    evidence = mapped([[(0.0, 0.0)]] * 6)
    evidence.go_on_with(evidence.tracks(), {0: HandEdit(name="Anna's chair")})
    for second in range(6):
        evidence.update(seen(square(0.0, side=0.6), stamp=DAY + second))
    chair = only(evidence)
    assert (chair.id, chair.name, chair.attributes["evidence"]) == (0, "Anna's chair", 12)


def test_edits_of_what_a_drive_has_just_found_to_be_moved_are_of_the_object_there() -> None:
    evidence = mapped([[(-3.0, 0.0)]] * 6, [[(3.0, 0.0)]] * 40)
    chair = only(evidence)
    assert (chair.id, chair.footprint.centroid.x) == (0, pytest.approx(3, abs=0.05))
    evidence.go_on_with(evidence.tracks(), {0: HandEdit(name="Anna's chair")})
    chair = only(evidence)
    assert (chair.id, chair.name) == (0, "Anna's chair")
    assert chair.footprint.centroid.x == pytest.approx(3, abs=0.05)


def test_a_shape_without_area_that_people_have_drawn_is_no_obstacle() -> None:
    drawn = SemanticObject("chair", shapely.Polygon([(0, 0), (1, 0), (2, 0)]), id=7)
    evidence = mapped([[(0.0, 0.0)]] * 6)
    evidence.go_on_with(evidence.tracks(), {7: HandEdit(drawn=drawn)})
    for second in range(6):
        evidence.update(seen(square(2.0, side=0.6), stamp=DAY + second))
    assert 7 in {item.id for item in evidence.objects()}


def test_what_is_drawn_while_a_drive_goes_on_is_not_taken_for_what_earlier_drives_knew() -> None:
    drawn = SemanticObject("chair", square(2.0, side=0.6), id=7)
    evidence = mapped([[(0.0, 0.0)]] * 6, [[]] * 40 + [[(4.0, 3.0)]])
    evidence.go_on_with(evidence.tracks(), {7: HandEdit(drawn=drawn)})
    for second in range(50, 60):
        evidence.update(seen(square(2.0, side=0.6), stamp=DAY + second))
    assert only(evidence).id == 7


def test_edits_from_before_a_drive_do_not_end_it_in_the_middle() -> None:
    """A save in the middle keeps apart what the drive has seen, as without edits."""
    evidence = mapped([[(0.0, 0.0), (3.0, 0.0)]] * 6)
    evidence.go_on_with(evidence.tracks(), {0: HandEdit(name="Anna's chair")})
    for second in range(6):
        evidence.update(seen(square(3.0, side=0.6), stamp=DAY + second))
    before = packed_tables(evidence.tracks())
    evidence.go_on_with(evidence.tracks(), evidence.hand_edits())
    after = packed_tables(evidence.tracks())
    np.testing.assert_array_equal(before.arrays["track.id"], after.arrays["track.id"])
    np.testing.assert_array_equal(before.arrays["track.kept"], after.arrays["track.kept"])


@settings(max_examples=20, deadline=None)
@example([0, 2, 1], [[(0.0, 0.0)]], [[(0.0, 0.0)]] * 6, [[(0.0, 0.0)]], 4)
@given(st.permutations([0, 1, 2]), drives, drives, drives, st.integers(0, 35))
def test_a_save_and_a_look_in_the_middle_of_any_drive_change_nothing(
    order: list[int],
    first: list[list[tuple[float, float]]],
    second: list[list[tuple[float, float]]],
    third: list[list[tuple[float, float]]],
    cut: int,
) -> None:
    """Of an older drive, too, that is mapped after later ones."""
    one, other = EvidenceMap(DEFAULT), EvidenceMap(DEFAULT)
    days = [first, second, third]
    views = [(day * DAY + n, shown) for day in order for n, shown in enumerate(days[day])]
    for number, (stamp, shown) in enumerate(views):
        view = seen(*(square(x, y, side=0.6) for x, y in shown), stamp=stamp)
        one.update(view)
        other.update(view)
        other.settled()
        if number == cut:
            (tracks,) = unpacked_tables(packed_tables(other.tracks()), DEFAULT)
            other = EvidenceMap(DEFAULT)
            other.go_on_with(tracks)
    for found, expected in ((other.tracks(), one.tracks()), (other.settled(), one.settled())):
        packed, wanted = packed_tables(found), packed_tables(expected)
        assert packed.facts == wanted.facts
        for name, values in wanted.arrays.items():
            np.testing.assert_array_equal(packed.arrays[name], values)


def test_what_no_new_frame_shows_is_not_joined_anew() -> None:
    """`live` and the page that watches look at the map after each frame."""
    evidence = mapped([[(-3.0, 0.0), (3.0, 0.0)]] * 6, [[(-3.0, 0.0), (3.0, 0.0)]] * 6)
    before = evidence.settled()
    evidence.update(seen(square(3.0, side=0.6), area=square(3.0), stamp=DAY + 6))
    after = evidence.settled()
    assert [track.buffer.count for track in after.objects] == [12, 13]
    assert after.shapes.polygons[0] is before.shapes.polygons[0]
    assert after.shapes.polygons[1] is not before.shapes.polygons[1]
    assert before.objects[1].buffer.count == 12


def test_nothing_is_decided_before_the_next_drive_begins() -> None:
    """A chair seems to be new, until its old place is seen, too; the tracks are kept apart."""
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(6):
        evidence.update(seen(square(3), area=shapely.box(0, -10, 10, 10), stamp=DAY + second))
    seen_so_far = [item.id for item in evidence.objects()]
    assert len(seen_so_far) == 2
    assert len(evidence.tracks().objects) == 2
    for second in range(6, 60):
        evidence.update(seen(square(3), stamp=DAY + second))
    assert only(evidence).id == 0
    assert len(evidence.tracks().objects) == 2
    evidence.update(seen(square(3), stamp=2 * DAY))
    (known, *_) = evidence.tracks().objects
    assert (known.id, known.moved_since) == (0, DAY)


def test_a_drive_that_goes_on_after_a_break_gives_the_same_map() -> None:
    whole, parts = EvidenceMap(DEFAULT), EvidenceMap(DEFAULT)
    for evidence in (whole, parts):
        for second in range(6):
            evidence.update(seen(square(-3), square(0, 3), stamp=second))
    for second in range(40):
        for evidence in (whole, parts):
            evidence.update(seen(square(3), square(0.1, 3), stamp=DAY + second))
        saved = unpacked_tables(packed_tables(parts.tracks()), DEFAULT)[0]
        parts = EvidenceMap(DEFAULT)
        parts.go_on_with(saved)
    one, other = (
        [(o.id, o.footprint.wkb, o.existence, o.attributes) for o in each.objects()]
        for each in (whole, parts)
    )
    assert [number for number, *_ in one] == [0, 1]
    assert one == other


@pytest.mark.parametrize(
    ("other", "count"),
    [
        (shapely.box(0, 0.17, 1.2, 0.27), 1),  # poses were off
        (shapely.box(1.3, 0.17, 2.5, 0.27), 2),  # the next one in a row
        (shapely.box(0, 0.35, 1.2, 0.45), 2),  # too far away
        (shapely.box(0, 0.12, 1.2, 0.52), 2),  # too thick
    ],
)
def test_a_screen_that_poses_put_to_two_places_is_one(other: shapely.Polygon, count: int) -> None:
    screen, evidence = shapely.box(0, 0, 1.2, 0.1), EvidenceMap(DEFAULT)
    for second in range(8):
        evidence.update(seen(screen, stamp=second))
    for second in range(8):
        evidence.update(seen(screen, area=screen, stamp=DAY + second))
    for second in range(8, 16):
        evidence.update(seen(other, area=other, stamp=DAY + second))
    assert len(evidence.objects()) == count


def test_two_screens_back_to_back_that_frames_show_together_are_two() -> None:
    screens = shapely.box(0, 0, 1.2, 0.05), shapely.box(0, 0.16, 1.2, 0.21)
    evidence = EvidenceMap(DEFAULT)
    for day, shown in ((0, screens[:1]), (1, screens)):
        for second in range(8):
            evidence.update(seen(*shown, stamp=day * DAY + second))
    assert len(evidence.objects()) == 2
