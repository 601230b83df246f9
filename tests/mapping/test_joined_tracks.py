"""Which tracks of two maps are of one object."""

from __future__ import annotations

import pytest
import shapely

from hypermap.mapping.merging.tracks import join_tracks

from .evidence_tools import DEFAULT, square, tracks_of

NEVER_FREE = (lambda *_: False,) * 2
CHAIR = square(0, 0, 0.5)
ROWS = {
    "a piece of it, seen once": [(square(0.1, 0.1, 0.15), 1), (CHAIR, 9)],
    "a double of it, seen once": [(square(0.01, 0, 0.5), 1), (square(0.06, 0, 0.5), 9)],
    "a piece of it, seen often": [(square(0.1, 0.1, 0.15), 12), (CHAIR, 9)],
}


@pytest.mark.parametrize("things", ROWS.values(), ids=ROWS.keys())
@pytest.mark.parametrize("is_first", [True, False])
def test_an_object_of_both_maps_is_matched_and_not_what_lies_at_its_place(
    things: list[tuple[shapely.Polygon, int]], is_first: bool
) -> None:
    tables = tracks_of(*things), tracks_of((CHAIR, 9))
    first, second = tables if is_first else tables[::-1]
    joined = join_tracks(first, second, DEFAULT, (lambda *_: False, lambda *_: False))
    assert joined.pairs == {1 if is_first else 0}
    assert joined.ids[0 if is_first else 1] in joined.pairs


def test_of_two_chairs_side_by_side_one_that_was_hardly_seen_is_still_itself() -> None:
    beside = square(0.35, 0, 0.5)  # the shapes of both overlap
    first = tracks_of((CHAIR, 9), (beside, 1))
    joined = join_tracks(first, tracks_of((beside, 9)), DEFAULT, (lambda *_: False,) * 2)
    assert joined.pairs == {1}


CUP = square(0, 0, 0.07)


def test_a_cup_that_poses_put_beside_its_place_is_one_in_the_map_of_both() -> None:
    there = square(0.09, 0, 0.07)  # the shapes of both are apart
    joined = join_tracks(tracks_of((CUP, 9)), tracks_of((there, 9)), DEFAULT, NEVER_FREE)
    assert joined.pairs == {0}
    assert [len(track.buffer) for track in joined.tracks.objects] == [18]


def test_two_cups_of_one_map_that_are_one_in_the_other_map_are_one() -> None:
    twice = tracks_of((CUP, 9), (square(0.09, 0, 0.07), 3))
    joined = join_tracks(tracks_of((CUP, 9)), twice, DEFAULT, NEVER_FREE)
    assert joined.ids == {0: 0, 1: 0}
    assert [len(track.buffer) for track in joined.tracks.objects] == [21]


def test_two_cups_that_frames_show_together_stay_two() -> None:
    cups = tracks_of((CUP, 9), (square(0.09, 0, 0.07), 9))
    for one, other in zip(cups.objects, cups.objects[::-1], strict=True):
        one.co_occurrences[other.id] = 9
    joined = join_tracks(tracks_of((CUP, 9)), cups, DEFAULT, NEVER_FREE)
    assert joined.ids == {0: 0, 1: 1}
    assert [len(track.buffer) for track in joined.tracks.objects] == [18, 9]


def test_what_stands_higher_or_is_large_is_not_what_is_beside_it() -> None:
    chairs = tracks_of((CHAIR, 9)), tracks_of((square(0.52, 0, 0.5), 9))
    assert join_tracks(*chairs, DEFAULT, NEVER_FREE).ids == {0: 1}
    above = tracks_of((square(0.09, 0, 0.07), 9))
    above.shapes.heights[0] = 1.2, 1.3
    assert join_tracks(tracks_of((CUP, 9)), above, DEFAULT, NEVER_FREE).ids == {0: 1}


def test_a_map_without_objects_is_merged_with_one_that_has_some() -> None:
    for first, second in ((tracks_of(), tracks_of((CHAIR, 9))), (tracks_of(), tracks_of())):
        joined = join_tracks(first, second, DEFAULT, (lambda *_: False,) * 2)
        assert not joined.pairs
        assert len(joined.tracks.objects) == len(second.objects)
