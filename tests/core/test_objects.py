from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.testing import assert_same_objects, square


def test_everything_that_an_object_holds_comes_back_from_the_table() -> None:
    objects = [
        square("cup", 0, 0, id=4, tags=("cup", "bowl"), confidence=(0.75, 0.25), existence=2.5,
               first_seen=1.0, last_seen=9.0, attributes={"color": "red"}),
        square("cup", 5, 5, id=1, first_seen=0.0),
        SemanticObject("ring", shapely.Point(0, 0).buffer(2).boundary.buffer(0.1), id=2**31 - 1),
    ]  # fmt: skip
    table = ObjectTable.of(objects)
    assert_same_objects([table.object(row) for row in range(len(table))], objects)
    assert table.names.tolist() == ["cup", "cup", "ring"]
    assert table.ids.tolist() == [4, 1, 2**31 - 1]
    assert table.take(np.array([2, 0])).names.tolist() == ["ring", "cup"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"name": 3}, "an object's name must be text, got 3"),
        ({"id": -1}, "an object's id must be between 0 and 2147483647, got -1"),
        ({"id": 2**31}, "an object's id must be between 0 and 2147483647, got 2147483648"),
        ({"id": 1.0}, "an object's id must be an integer, got 1.0"),
        ({"id": True}, "an object's id must be an integer, got True"),
        ({"tags": "cup"}, "tags must be several texts, got the text 'cup'"),
        ({"confidence": [0.5, math.nan]}, "confidence must be finite, got (0.5, nan)"),
        ({"existence": math.inf}, "existence must be finite, got inf"),
        ({"first_seen": math.nan}, "first_seen must be finite, got nan"),
        ({"last_seen": -math.inf}, "last_seen must be finite, got -inf"),
    ],
)
def test_what_no_object_can_hold_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises((ValueError, TypeError)) as caught:
        SemanticObject(**{"name": "cup", "footprint": shapely.box(0, 0, 1, 1), **wrong})
    assert str(caught.value) == message


def test_an_object_may_have_the_first_and_the_last_id_and_keeps_tuples() -> None:
    for number in (0, np.int64(2**31 - 1)):
        cup = square("cup", 0, 0, tags=["cup", "mug"], confidence=[0.5, 0.25]).with_id(number)
        assert (cup.id, cup.tags, cup.confidence) == (number, ("cup", "mug"), (0.5, 0.25))
        assert cup.with_id(number) is cup
        with pytest.raises(ValueError, match="id must be between"):
            cup.with_id(2**31)


@given(
    ids=st.lists(st.integers(0, 2**31 - 1), unique=True, max_size=12),
    asked=st.lists(st.integers(0, 2**31 - 1), max_size=6),
    data=st.data(),
)
def test_rows_are_found_by_their_ids(ids: list[int], asked: list[int], data: st.DataObject) -> None:
    table = ObjectTable.of([square(f"n{number}", k, 0, id=number) for k, number in enumerate(ids)])
    wanted = [*asked, *data.draw(st.lists(st.sampled_from(ids or [0])))]
    assert [table.row_of_id(w) for w in wanted] == [
        ids.index(w) if w in ids else -1 for w in wanted
    ]


def test_what_is_computed_from_footprints_is_carried_along_by_changes() -> None:
    table = ObjectTable.of([square(f"n{k}", 3 * k, 0, id=k) for k in range(4)])
    assert "shapes" not in vars(table)  # nobody has asked for them
    centroids = table.centroids
    taken = table.take(np.array([3, 1]))
    assert vars(taken)["centroids"].tolist() == centroids[[3, 1]].tolist()
    assert "areas" not in vars(taken)
    others = ObjectTable.of([square("n0", 50 + k, 0, id=9 - k) for k in range(2)], table.vocabulary)
    more = table.take_with(np.array([2, 9, 0, 4]), others)
    assert more.ids.tolist() == [2, 9, 0, 8]
    fresh = ObjectTable.of([more.object(row) for row in range(4)])
    assert vars(more)["centroids"].tolist() == fresh.centroids.tolist()


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("ids", np.array([1, 1]), "two objects have the id 1"),
        ("ids", np.array([-1, 1]), "must be between 0 and 2147483647"),
        ("ids", np.array([0, 2**31]), "must be between 0 and 2147483647"),
        ("footprints", shapely.points([0, 1], [0, 1]), "must be a polygon or multipolygon"),
        ("existence", np.array([np.nan, np.inf]), "existence must be finite"),
    ],
)
def test_columns_from_outside_are_checked(column: str, values: Any, message: str) -> None:
    table = ObjectTable.of([square("a", 0, 0, id=0), square("b", 0, 0, id=1)])
    table.check()
    with pytest.raises((ValueError, TypeError), match=message):
        replace(table, **{column: values}).check()


def test_columns_from_outside_may_have_the_first_and_the_last_id() -> None:
    ObjectTable.of([square("a", 0, 0, id=2**31 - 1), square("b", 0, 0, id=0)]).check()
    ObjectTable.of([square("a", 0, 0, id=2**31 - 1)]).check()
    ObjectTable.of([]).check()


@pytest.mark.parametrize(
    ("confidence", "existence", "probability"),
    [((0.4, 0.1), 3.0, 0.4), ((), 0.0, 0.5), ((), 1e9, 1.0), ((), None, None)],
)
def test_the_probability_of_an_object_is_its_confidence_or_follows_from_its_existence(
    confidence: tuple[float, ...], existence: float | None, probability: float | None
) -> None:
    cup = SemanticObject("cup", shapely.box(0, 0, 1, 1), confidence=confidence, existence=existence)
    assert cup.probability == probability
