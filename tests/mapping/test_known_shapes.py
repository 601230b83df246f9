"""The shapes of known objects: which of them come into question, by their boxes."""

from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.mapping.known_shapes import KnownShapes
from hypermap.mapping.outlines import Outline

sides = st.integers(-5, 5), st.integers(-5, 5), st.integers(1, 4), st.integers(1, 4)
boxes = st.builds(lambda x, y, width, height: (x, y, x + width, y + height), *sides)
limits = st.builds(lambda x, y, size: (x, y, x + size, y + size), *sides[:2], st.integers(3, 14))
tables = st.lists(st.tuples(st.integers(0, 2), boxes), max_size=12)


def known(rows: list[tuple[int, tuple[int, ...]]]) -> KnownShapes:
    shapes = KnownShapes()
    for class_, box in rows:
        shapes.append(class_, Outline.of(shapely.box(*box)))
    return shapes


@given(tables, boxes, st.none() | st.integers(0, 3))
def test_near_is_what_touches_the_box_and_is_of_the_class(rows, box, class_) -> None:
    asked = shapely.box(*box)
    expected = [
        row
        for row, (its_class, its_box) in enumerate(rows)
        if class_ in (None, its_class) and shapely.intersects(shapely.box(*its_box), asked)
    ]
    assert known(rows).near(class_, box) == expected


@given(tables, limits, st.integers(-5, 5), st.integers(-5, 5), st.integers(0, 6))
def test_within_is_what_lies_inside_and_has_its_middle_in_range(rows, inside, x, y, far) -> None:
    middles = [((x0 + x1) / 2, (y0 + y1) / 2) for _, (x0, y0, x1, y1) in rows]
    covers = [shapely.covers(shapely.box(*inside), shapely.box(*box)) for _, box in rows]
    is_near = [np.hypot(a - x, b - y) <= far for a, b in middles]
    expected = [row for row in range(len(rows)) if covers[row] and is_near[row]]
    assert known(rows).within(inside, np.array([x, y]), float(far)) == expected


def test_the_rows_behind_one_that_is_removed_move_up() -> None:
    shapes = known([(0, (0, 0, 1, 1)), (1, (2, 0, 3, 1)), (2, (4, 0, 5, 1))])
    shapes.heights[2] = 0.5, 0.75
    shapes.keep(np.array([True, False, True]))
    assert len(shapes) == 2
    assert shapes.classes.tolist() == [0, 2]
    assert shapes.boxes.tolist() == [[0, 0, 1, 1], [4, 0, 5, 1]]
    assert shapes.heights.tolist() == [[0, 0], [0.5, 0.75]]
    assert [shape.geometry.centroid.x for shape in shapes.outlines] == [0.5, 4.5]
    shapes.replace(0, Outline.of(shapely.box(7, 0, 8, 1)))
    assert shapes.near(None, (7.5, 0, 7.5, 0)) == [0]
