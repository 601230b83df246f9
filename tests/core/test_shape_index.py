from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.arrays import as_objects
from hypermap.core.shape_index import ShapeIndex

places = st.tuples(st.integers(0, 9), st.integers(0, 9))


def square(place: tuple[int, int]) -> shapely.Polygon:
    return shapely.box(*place, place[0] + 2, place[1] + 2)


def expected_hits(queries: Any, shapes: Any) -> list[tuple[int, int]]:
    return [
        (i, row)
        for i, query in enumerate(queries)
        for row, shape in enumerate(shapes)
        if query.intersects(shape)
    ]


def hits(index: ShapeIndex, queries: Any) -> list[tuple[int, int]]:
    found, rows = index.hits(as_objects(queries))
    return list(zip(found.tolist(), rows.tolist(), strict=True))


@given(st.lists(places, max_size=30), st.lists(places, max_size=5))
def test_the_index_finds_what_looking_at_each_shape_finds(boxes, asked) -> None:
    shapes = [square(place) for place in boxes]
    queries = [square(place) for place in asked]
    assert hits(ShapeIndex.over(as_objects(shapes)), queries) == expected_hits(queries, shapes)


def test_touching_is_meeting() -> None:
    index = ShapeIndex.over(as_objects([shapely.box(0, 0, 1, 1)]))
    assert hits(index, [shapely.Point(1, 1), shapely.box(1, 0, 2, 1)]) == [(0, 0), (1, 0)]


def test_the_index_stays_right_while_it_grows_and_shrinks_one_by_one() -> None:
    shapes: list[shapely.Polygon] = []
    index = ShapeIndex.over(as_objects(shapes))
    queries = [square((3, 3))]
    for i in range(300):
        shapes.append(square((i * 7 % 10, i * 3 % 10)))
        index = index.after(as_objects(shapes), np.arange(i), np.array([i]))
        if i % 20 == 0:
            assert hits(index, queries) == expected_hits(queries, shapes)
    for i in range(299, 0, -1):
        gone = i * 7 % (i + 1)
        del shapes[gone]
        rows = np.arange(i + 1)
        moved_to = np.where(rows == gone, -1, rows - (rows > gone))
        index = index.after(as_objects(shapes), moved_to, np.empty(0, dtype=np.int64))
        if i % 20 == 0:
            assert hits(index, queries) == expected_hits(queries, shapes)


@pytest.mark.parametrize("start", [0, 5, 200])
@given(data=st.data())
def test_the_index_follows_any_sequence_of_changes(start: int, data: st.DataObject) -> None:
    shapes = [square((i % 10, i // 10 % 10)) for i in range(start)]
    index = ShapeIndex.over(as_objects(shapes))
    for _ in range(data.draw(st.integers(1, 6))):
        old = len(shapes)
        change = data.draw(st.sampled_from(["add", "remove", "replace"]))
        if change == "add":
            shapes = shapes + [square(p) for p in data.draw(st.lists(places, max_size=40))]
            moved_to, fresh = np.arange(old), np.arange(old, len(shapes))
        elif change == "remove":
            gone = data.draw(st.sets(st.integers(0, max(old - 1, 0)), max_size=40))
            keep = np.array([row not in gone for row in range(old)], dtype=bool)
            shapes = [shape for shape, kept in zip(shapes, keep, strict=True) if kept]
            moved_to, fresh = np.where(keep, np.cumsum(keep) - 1, -1), np.empty(0, np.int64)
        elif old:
            row = data.draw(st.integers(0, old - 1))
            shapes = [*shapes[:row], square(data.draw(places)), *shapes[row + 1 :]]
            moved_to, fresh = np.arange(old), np.array([row])
            moved_to[row] = -1
        else:
            continue
        index = index.after(as_objects(shapes), moved_to, fresh)
        queries = [square(p) for p in data.draw(st.lists(places, min_size=1, max_size=3))]
        assert hits(index, queries) == expected_hits(queries, shapes)
