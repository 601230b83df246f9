"""Questions about measured values: two offices and a kitchen between them."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap import GridGeometry, Hypermap, HypermapError, SemanticLayer
from hypermap.console.asked import document, lines, understood
from hypermap.console.questions import answered
from hypermap.core.value_layer import ValueLayer
from hypermap.questions import Query
from hypermap.questions.asking import answer_to
from hypermap.questions.english import NotUnderstood
from hypermap.rooms import Room, Rooms, with_rooms
from hypermap.testing import square


@pytest.fixture(scope="module")
def flat() -> Hypermap:
    """18 to 29.9 °C and -40 to -99 dBm along 12 m; 0 and 1 are desks, 2 a cup."""
    things = [square("desk", 2.0, 2.0), square("desk", 10.0, 2.0), square("cup", 6.0, 2.0)]
    grid = GridGeometry(120, 40, 0.1)
    along = np.tile(np.arange(120.0), (40, 1))
    deviations = np.full((40, 120), 0.25)
    warmth = ValueLayer("temperature", "map", grid, 18 + along / 10, "°C", deviations=deviations)
    wifi = ValueLayer("wifi_level", "map", grid, -40 - along / 2, "dBm", quantity="wifi")
    hypermap = Hypermap([SemanticLayer("semantic", "map", things), warmth, wifi])
    boxes = [shapely.box(4 * i, 0, 4 * i + 4, 4) for i in range(3)]
    kinds = ("office", "kitchen", "office")
    rooms = [
        Room(i, f"{kind} {i}", box, kind=kind)
        for i, kind, box in zip(range(3), kinds, boxes, strict=True)
    ]
    return with_rooms(hypermap, Rooms("map", tuple(rooms), ()))


@pytest.mark.parametrize(
    ("question", "from_x", "to_x"),
    [
        ("where is it warmer than 25 degrees?", 7.1, 12),
        ("Where is it hotter than 77 °F", 7.1, 12),
        ("where is it colder than 20 degrees celsius?", 0, 2),
        ("where is the wifi weaker than -75 dBm?", 7.1, 12),
        ("where is the wifi level above -50", 0, 2),
        ("where is it warmer than 21 degrees in the kitchen?", 4, 8),
        ("where is the temperature over 25 in office 2?", 8, 12),
    ],
)  # fmt: skip
def test_places_where_a_quantity_is_so(
    flat: Hypermap, question: str, from_x: float, to_x: float
) -> None:
    (place,) = answer_to(flat, question).cells
    x0, _, x1, _ = shapely.from_wkt(place.more["outline"]).bounds
    assert (x0, x1) == pytest.approx((from_x, to_x))


@pytest.mark.parametrize(
    ("question", "found"),
    [
        ("which is the coldest office?", [0]),
        ("what is the warmest room?", [2]),
        ("which room is the hottest", [2]),
        ("where is the warmest desk?", [1]),
        ("which desk has the weakest wifi?", [1]),
        ("the room with the best wifi level", [0]),
        ("which desks have wifi below -75 dBm?", [1]),
        ("desks where it is colder than 25 degrees", [0]),
        ("which offices are warmer than 25 degrees?", [2]),
    ],
)  # fmt: skip
def test_objects_and_rooms_of_which_a_quantity_is_so(
    flat: Hypermap, question: str, found: list[int]
) -> None:
    assert [item.object.id for item in answer_to(flat, question).objects] == found


@pytest.mark.parametrize(
    ("question", "said"),
    [
        ("how warm is it in the kitchen?", "temperature: mean 23.9 °C, 22 to 25.9"),
        ("what is the temperature at 1.05, 2?", "temperature at (1.05, 2.00): 19.0 °C ± 0.25"),
        ("how strong is the wifi signal in office 0?", "wifi_level: mean -49.8 dBm, -59.5 to -40"),
        ("how cold is it?", "temperature: mean 23.9 °C, 18 to 29.9"),
    ],
)  # fmt: skip
def test_how_much_there_is(flat: Hypermap, question: str, said: str) -> None:
    answer = answer_to(flat, question)
    assert list(lines(flat, answer)) == [said]
    assert document(flat, answer)["cells"][0]["unit"] in ("°C", "dBm")
    assert ("asked", "what was measured") in understood(answer.query)


def test_a_query_of_values_is_the_same_as_json(flat: Hypermap) -> None:
    query = answer_to(flat, "which is the coldest office?").query
    assert Query.from_json(query.to_json()) == query
    with pytest.raises(HypermapError, match="need measured values"):
        Query.from_json({"names": ["desk"], "which": "lowest"})


@pytest.mark.parametrize(
    ("question", "kind", "said"),
    [
        ("where is it brighter than 200 lux?", HypermapError, "no layer of measured light"),
        ("where is it warmer than 25 dBm?", HypermapError, "cannot be converted"),
        ("which is the coldest?", HypermapError, "of what"),
        ("how warm is it on the desk?", HypermapError, "need a room or a point"),
        ("where is the wifi weaker than the radio?", NotUnderstood, "cannot read"),
    ],
)  # fmt: skip
def test_what_cannot_be_answered_says_why(
    flat: Hypermap, question: str, kind: type[Exception], said: str
) -> None:
    with pytest.raises(kind, match=said):
        answer_to(flat, question)


def test_a_map_without_values_says_that_none_were_measured() -> None:
    hypermap = Hypermap([SemanticLayer("semantic", "map", [square("desk", 1.0, 1.0)])])
    with pytest.raises(HypermapError, match="no layer of measured temperature"):
        answer_to(hypermap, "which is the coldest desk?")
    assert answer_to(hypermap, "where is the desk?").count == 1


def test_options_ask_the_rooms_of_a_kind_for_what_was_measured(flat: Hypermap) -> None:
    options = {"--layer": ["rooms"], "--in": "office", "--measured": "wifi_level"}
    rows = answered(flat, options).rows
    assert [row["label"] for row in rows] == ["office 2", "office 0"]
    assert rows[0]["measured"]["label"] == "-89.8 dBm"
