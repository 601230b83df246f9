"""A part of a thing is not another thing of another class."""

from __future__ import annotations

import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.misnamed_parts import without_misnamed_parts

from .evidence_tools import square


def thing(
    number: int, name: str, shape: shapely.Polygon, top: float, low: float = 0.0, evidence: int = 20
) -> SemanticObject:
    heights = {"z_min": low, "z_max": top}
    return SemanticObject(name, shape, id=number, attributes={"evidence": evidence, **heights})


PLANT = thing(0, "plant", square(0, side=0.4), 1.1)
LEAF = thing(1, "bench", square(0.1, side=0.15), 0.9, low=0.6, evidence=4)
BENCHES = [thing(2 + n, "bench", shapely.box(3 + n, 2, 3.5 + n, 4), 0.45) for n in range(2)]


def ids(*objects: SemanticObject, fixed: tuple[int, ...] = ()) -> set[int | None]:
    return {item.id for item in without_misnamed_parts(objects, fixed)}


def test_a_bench_that_is_a_leaf_of_a_plant_is_none() -> None:
    assert ids(PLANT, LEAF, *BENCHES) == {0, 2, 3}
    assert ids() == set()


@pytest.mark.parametrize(
    "other",
    [
        thing(1, "bench", square(0.1, side=0.15), 2.0, low=1.0, evidence=4),
        thing(1, "bench", square(0.3, side=0.15), 0.9, low=0.6, evidence=4),
        thing(1, "bench", square(0.1, side=0.15), 0.9, low=0.6, evidence=30),
        thing(1, "cup", square(0.1, side=0.08), 0.7, low=0.6, evidence=4),
        thing(1, "bench", shapely.box(-0.2, -0.2, 0.2, 2), 0.45, evidence=4),
    ],
    ids=["above", "beside", "seen more often", "the only one of its class", "of usual size"],
)
def test_others_stay(other: SemanticObject) -> None:
    assert ids(PLANT, other, *BENCHES) == {0, 1, 2, 3}


def test_a_side_of_a_table_is_no_bench_and_a_chair_under_it_is_one() -> None:
    table = thing(0, "table", square(0, side=0.5), 1.0)
    side = thing(1, "bench", square(0, side=0.45), 0.8, low=0.3, evidence=9)
    assert ids(table, side, *BENCHES) == {0, 2, 3}
    chairs = [thing(n, "chair", square(x, side=0.4), 0.9) for n, x in ((2, 3.0), (3, 5.0))]
    front = thing(1, "chair", square(0, side=0.2), 0.9, evidence=9)  # most of it is hidden
    assert ids(table, front, *chairs) == {0, 1, 2, 3}


def test_a_cup_in_a_sink_is_as_large_as_other_cups() -> None:
    sink = thing(0, "sink", square(0), 1.1, low=0.8, evidence=90)
    cups = [thing(n, "cup", square(x, side=0.08), 1.0, low=0.9) for n, x in ((1, 0.2), (2, 3.0))]
    assert ids(sink, *cups) == {0, 1, 2}


def test_what_people_have_named_stays() -> None:
    assert ids(PLANT, LEAF, *BENCHES, fixed=(1,)) == {0, 1, 2, 3}
    drawn = SemanticObject("bench", square(0.1, side=0.15), id=1)  # it has no heights
    assert ids(PLANT, drawn, *BENCHES, fixed=(1,)) == {0, 1, 2, 3}
