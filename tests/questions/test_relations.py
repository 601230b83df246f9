"""How objects lie to each other: of few, of very many in one place, and of unknown height."""

from __future__ import annotations

import math
import resource
import time
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap import Hypermap, HypermapError, Pose2D, SemanticLayer, SemanticObject
from hypermap.console.asked import lines
from hypermap.questions.asking import answer_to

POINTS = st.tuples(st.integers(0, 20), st.integers(0, 20))


@given(st.lists(POINTS, max_size=8), st.lists(POINTS, max_size=8), st.integers(0, 10))
def test_near_is_as_the_distance_between_shapes(
    cups: list[Any], tables: list[Any], within: int
) -> None:
    shapes = [("cup", x, y) for x, y in cups] + [("table", x, y) for x, y in tables]
    things = [SemanticObject(name, shapely.box(x, y, x + 1, y + 1)) for name, x, y in shapes]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    found = answer_to(hypermap, f"cups within {within} m of a table").objects
    expected = [
        i
        for i, (x, y) in enumerate(cups)
        if any(
            math.hypot(max(abs(x - u) - 1, 0), max(abs(y - v) - 1, 0)) <= within for u, v in tables
        )
    ]
    assert sorted(int(item.object.id or 0) for item in found) == expected


def test_a_thing_in_the_same_place_as_another_is_near_it() -> None:
    box = shapely.box(0, 0, 1, 1)
    far = shapely.box(5, 0, 6, 1)
    things = [SemanticObject("chair", shape) for shape in (box, box, far)]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    found = answer_to(hypermap, "chairs within 0 m of a chair").objects
    assert sorted(int(item.object.id or 0) for item in found) == [0, 1]
    assert len(answer_to(hypermap, "chairs within 4 m of a chair").objects) == 3


def test_near_is_as_the_distance_where_there_are_many() -> None:
    draw = np.random.default_rng(4)
    corners = draw.uniform(0, 60, (900, 2)).round(1)
    shapes = [shapely.box(x, y, x + 0.5, y + 0.5) for x, y in corners]
    names = ["cup" if number < 300 else "table" for number in range(900)]
    things = [SemanticObject(*thing) for thing in zip(names, shapes, strict=True)]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    for name, others in (("table", slice(300, 900)), ("cup", slice(0, 300))):
        found = answer_to(hypermap, f"cups within 1 m of a {name}").objects
        far = shapely.distance(np.array(shapes[:300])[:, np.newaxis], np.array(shapes[others]))
        if name == "cup":
            np.fill_diagonal(far, np.inf)
        expected = np.flatnonzero((far <= 1).any(axis=1)).tolist()
        assert 0 < len(expected) < 300
        assert sorted(int(item.object.id or 0) for item in found) == expected


def test_many_things_near_many_others_are_compared_in_little_time_and_memory() -> None:
    things = [SemanticObject(name, shapely.box(0, 0, 1, 1)) for name in ("cup", "table")] * 20_000
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    assert answer_to(hypermap, "how many cups are within 1 m of a table").count == 20_000
    assert answer_to(hypermap, "how many cups are in a table").count == 20_000  # 4 x 10^8 pairs
    assert time.process_time() - began < 10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB


def test_many_things_around_the_corner_of_many_others_are_compared() -> None:
    corners = np.random.default_rng(5).uniform(0, 20, (5000, 2)).round(2)
    corners[2500:] += 120
    shapes = np.asarray(shapely.box(*corners.T, *(corners.T + 0.5)))
    names = ["cup"] * 2500 + ["table"] * 2500
    things = [SemanticObject(*thing) for thing in zip(names, shapes, strict=True)]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    tables = shapely.union_all(shapes[2500:])
    for within in (140, 150, 160):
        near = np.count_nonzero(shapely.distance(shapes[:2500], tables) <= within)
        far = answer_to(hypermap, f"how many cups are more than {within} m from a table").count
        assert far == 2500 - near  # of 2500 to about 1000


def test_what_would_compare_too_many_pairs_is_refused() -> None:
    things = [SemanticObject(name, shapely.box(0, 0, 1, 1)) for name in ("cup", "table")] * 2100
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    with pytest.raises(HypermapError, match="more than 4,000,000 pairs of objects"):
        answer_to(hypermap, "which cups are left of a table", Pose2D(5, 5, 0))  # each is on all


def test_heights_that_are_no_numbers_are_unknown() -> None:
    heights = [10**400, math.inf, "high", None, True]
    things = [
        SemanticObject("cup", shapely.box(0, 0, 1, 1), attributes={"z_min": one, "z_max": one})
        for one in heights
    ]
    table = SemanticObject("table", shapely.box(0, 0, 2, 2), attributes={"z_min": 0, "z_max": 1})
    hypermap = Hypermap([SemanticLayer("semantic", "map", [*things, table])])
    assert answer_to(hypermap, "which cups are on a table").count == 5  # by their sizes
    for line in lines(hypermap, answer_to(hypermap, "how big are the cups")):
        assert line.endswith(": 1.00 x 1.00 m, 1.00 m²")
