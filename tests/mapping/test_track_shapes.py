"""The shapes of tracks: which of them are candidates, by their bounding boxes."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.track_shapes import TrackShapes

ROUNDS = 300


def any_boxes(rng: np.random.Generator, count: int, largest: int) -> NDArray[np.int64]:
    """Whole numbers of which many are equal, so that boxes touch each other."""
    corners = rng.integers(-4, 5, (count, 2))
    return np.hstack([corners, corners + rng.integers(1, largest + 1, (count, 2))])


def known(classes: NDArray[np.int64], boxes: NDArray[np.int64]) -> TrackShapes:
    shapes = TrackShapes()
    for class_, shape in zip(classes.tolist(), shapely.box(*boxes.T), strict=True):
        shapes.append(class_, PreparedPolygon.of(shape))
    return shapes


def test_near_is_what_touches_the_box_and_is_of_the_class() -> None:
    rng = np.random.default_rng(1)
    for _ in range(ROUNDS):
        classes, boxes, (asked,) = rng.integers(0, 3, 8), any_boxes(rng, 8, 3), any_boxes(rng, 1, 3)
        touches = shapely.intersects(shapely.box(*boxes.T), shapely.box(*asked))
        shapes, box = known(classes, boxes), tuple(asked.tolist())
        assert shapes.near(None, box) == np.flatnonzero(touches).tolist()
        for class_ in range(4):
            expected = np.flatnonzero(touches & (classes == class_))
            assert shapes.near(class_, box) == expected.tolist()


def test_within_is_what_lies_inside_and_has_its_middle_in_range() -> None:
    rng = np.random.default_rng(2)
    for _ in range(ROUNDS):
        boxes, (limits,) = any_boxes(rng, 8, 3), any_boxes(rng, 1, 12)
        position, far = rng.integers(-4, 5, 2), rng.integers(0, 11) / 2
        is_inside = shapely.covers(shapely.box(*limits), shapely.box(*boxes.T))
        away = (boxes[:, :2] + boxes[:, 2:]) / 2 - position
        expected = np.flatnonzero(is_inside & (np.hypot(*away.T) <= far))
        shapes = known(np.zeros(8, dtype=np.int64), boxes)
        assert shapes.within(tuple(limits.tolist()), position, far) == expected.tolist()


def test_the_rows_behind_one_that_is_removed_move_up() -> None:
    shapes = known(np.arange(3), np.array([[0, 0, 1, 1], [2, 0, 3, 1], [4, 0, 5, 1]]))
    shapes.heights[2] = 0.5, 0.75
    shapes.keep(np.array([0, 2]))
    assert len(shapes) == 2
    assert shapes.classes.tolist() == [0, 2]
    assert shapes.boxes.tolist() == [[0, 0, 1, 1], [4, 0, 5, 1]]
    assert shapes.heights.tolist() == [[0, 0], [0.5, 0.75]]
    assert [shape.geometry.centroid.x for shape in shapes.polygons] == [0.5, 4.5]
    shapes.replace(0, PreparedPolygon.of(shapely.box(7, 0, 8, 1)))
    assert shapes.near(None, (7.5, 0, 7.5, 0)) == [0]
