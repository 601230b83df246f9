from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

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
