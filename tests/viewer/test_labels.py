from __future__ import annotations

import itertools

import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.viewer.labels import Spot, place_labels

PAGE = (0.0, 0.0, 400.0, 300.0)


def spot(x: float, y: float, side: float, width: float = 40.0) -> Spot:
    half = side / 2
    return Spot(shapely.box(x - half, y - half, x + half, y + half), (width, 15.0))


def box(center: tuple[float, float], size: tuple[float, float]) -> tuple[float, ...]:
    (x, y), (width, height) = center, size
    return (x - width / 2, y - height / 2, x + width / 2, y + height / 2)


def share_area(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def test_a_large_shape_carries_its_label_in_its_middle():
    assert place_labels([spot(200, 150, 120)], PAGE) == [(200.0, 150.0)]


def test_a_small_shape_has_its_label_beside_it():
    [place] = place_labels([spot(200, 150, 10)], PAGE)
    assert place is not None
    assert not share_area(box(place, (40, 15)), (195, 145, 205, 155))


def test_the_label_of_a_large_shape_leaves_the_small_one_on_it_visible():
    table, cup = spot(200, 150, 160), spot(200, 150, 12)
    place, _ = place_labels([table, cup], PAGE)
    assert place is not None
    assert not share_area(box(place, table.size), cup.shape.bounds)


def test_a_room_around_a_corridor_with_a_corner_carries_its_label():
    corridor = shapely.union(shapely.box(50, 50, 60, 250), shapely.box(50, 50, 350, 60))
    room = shapely.box(0, 0, 400, 300).difference(corridor)
    [(x, y), _] = place_labels([Spot(room, (40, 15)), Spot(corridor, (40, 15))], PAGE)
    assert shapely.box(*box((x, y), (40, 15))).within(room)


def test_a_label_without_room_is_left_out():
    assert place_labels([spot(200, 150, 50, width=900)], PAGE) == [None]


def test_nothing_gives_nothing():
    assert place_labels([], PAGE) == []


spots = st.lists(
    st.builds(spot, st.floats(0, 400), st.floats(0, 300), st.floats(1, 200), st.floats(5, 90)),
    max_size=25,
)


@given(spots)
def test_labels_stay_on_the_page_and_never_overlap(shapes):
    places = place_labels(shapes, PAGE)
    assert len(places) == len(shapes)
    written = [box(place, shape.size) for place, shape in zip(places, shapes, strict=True) if place]
    for xmin, ymin, xmax, ymax in written:
        assert xmin >= 0
        assert ymin >= 0
        assert xmax <= 400
        assert ymax <= 300
    for one, other in itertools.combinations(written, 2):
        assert not share_area(one, other)
