from __future__ import annotations

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


@given(
    ids=st.lists(st.integers(0, 2**31 - 1), unique=True, max_size=12),
    asked=st.lists(st.integers(0, 2**31 - 1), max_size=6),
    data=st.data(),
)
def test_rows_are_found_left_out_and_replaced(
    ids: list[int], asked: list[int], data: st.DataObject
) -> None:
    table = ObjectTable.of([square(f"n{number}", k, 0, id=number) for k, number in enumerate(ids)])
    wanted = [*asked, *data.draw(st.lists(st.sampled_from(ids or [0])))]
    rows = table.rows_of_ids(np.array(wanted, dtype=np.int64))
    assert rows.tolist() == [ids.index(w) if w in ids else -1 for w in wanted]

    gone = sorted(data.draw(st.sets(st.sampled_from(range(len(ids))))) if ids else [])
    others = [table.object(row) for row in range(len(ids)) if row not in gone]
    left = table.without(np.array(gone, dtype=np.int64))
    assert_same_objects([left.object(row) for row in range(len(left))], others)

    some = sorted(data.draw(st.sets(st.sampled_from(range(len(ids))))) if ids else [])
    new = [square("new", 9, 9, id=ids[row], tags=("a",), confidence=(1.0,)) for row in some]
    changed = table.with_rows(np.array(some, dtype=np.int64), ObjectTable.of(new, table.vocabulary))
    expected = [table.object(row) for row in range(len(ids))]
    for row, item in zip(some, new, strict=True):
        expected[row] = item
    assert_same_objects([changed.object(row) for row in range(len(ids))], expected)
    assert table.names.tolist() == [f"n{number}" for number in ids]  # the old table stays


def test_lists_of_tags_become_tuples() -> None:
    item = square("cup", 0, 0, tags=["cup", "bowl"], confidence=[0.75, 0.25])
    assert item.tags == ("cup", "bowl")
    assert item.confidence == (0.75, 0.25)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"name": None}, TypeError, "an object's name must be text, got None"),
        ({"id": -1}, ValueError, "an object's id must lie between 0 and 2147483647, got -1"),
        ({"id": 2**31}, ValueError, "an object's id must lie between 0 and 2147483647, got "
         "2147483648"),
        ({"id": 1.0}, TypeError, "an object's id must be an integer, got 1.0"),
        ({"id": True}, TypeError, "an object's id must be an integer, got True"),
        ({"tags": "cup"}, TypeError, "tags must be several texts, got the text 'cup'"),
        ({"confidence": [float("nan")]}, ValueError, "confidence must be finite, got (nan,)"),
        ({"existence": float("nan")}, ValueError, "existence must be finite, got nan"),
        ({"last_seen": float("inf")}, ValueError, "last_seen must be finite, got inf"),
        ({"footprint": shapely.Polygon()}, ValueError, "a footprint must not be empty"),
    ],
)  # fmt: skip
def test_what_is_no_object_is_refused(
    changes: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        SemanticObject(**{"name": "cup", "footprint": shapely.box(0, 0, 1, 1), **changes})
    assert str(caught.value) == message


def test_what_is_computed_from_footprints_is_carried_along_by_changes() -> None:
    table = ObjectTable.of([square(f"n{k}", 3 * k, 0, id=k) for k in range(4)])
    assert "shapes" not in vars(table)  # nobody has asked for them
    centroids = table.centroids
    taken = table.take(np.array([3, 1]))
    assert vars(taken)["centroids"].tolist() == centroids[[3, 1]].tolist()
    assert "areas" not in vars(taken)
    other = ObjectTable.of([square("n0", 50, 0, id=0)], table.vocabulary)
    moved = table.with_rows(np.array([0]), other)
    fresh = ObjectTable.of([moved.object(row) for row in range(4)])
    assert moved.centroids.tolist() == fresh.centroids.tolist() != centroids.tolist()


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("ids", np.array([1, 1]), "two objects have the id 1"),
        ("ids", np.array([-1, 1]), "must lie between 0 and 2147483647"),
        ("ids", np.array([0, 2**31]), "must lie between 0 and 2147483647"),
        ("footprints", shapely.points([0, 1], [0, 1]), "must be a polygon or multipolygon"),
        ("existence", np.array([np.nan, np.inf]), "existence must be finite"),
    ],
)
def test_columns_from_outside_are_checked(column: str, values: Any, message: str) -> None:
    table = ObjectTable.of([square("a", 0, 0, id=0), square("b", 0, 0, id=1)])
    table.check()
    with pytest.raises((ValueError, TypeError), match=message):
        replace(table, **{column: values}).check()
