"""What a small flat answers: two rooms, a table with a cup on it, and things around."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
import pytest
import shapely
from shapely import LineString

from hypermap import (
    GridGeometry,
    Hypermap,
    HypermapError,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
)
from hypermap.console.asked import document, lines, understood
from hypermap.questions import Answer, Condition, Measured, Query, Reference, When, ask, asking
from hypermap.questions.asking import answer_to
from hypermap.questions.english import NotUnderstood
from hypermap.rooms import Door, Room, Rooms, with_rooms


def thing(name: str, x: float, y: float, side: float, low: float, high: float) -> SemanticObject:
    """Return a square thing with its middle at a point."""
    half = side / 2
    box = shapely.box(x - half, y - half, x + half, y + half)
    return SemanticObject(name, box, existence=x, attributes={"z_min": low, "z_max": high})


# 0 table, 1 cup on it, 2 mug under it, 3 and 4 chairs left and right of it, 5 couch in the kitchen.
THINGS = [
    replace(thing("table", 3, 2, 1.0, 0.0, 0.75), tags=("wooden",)),
    thing("cup", 3, 2, 0.1, 0.74, 0.85),
    thing("mug", 3.2, 2.35, 0.12, 0.0, 0.1),
    thing("chair", 2, 2, 0.5, 0.0, 0.9),
    thing("chair", 4, 2, 0.5, 0.0, 0.9),
    thing("couch", 8, 2, 1.0, 0.0, 0.8),
]


@pytest.fixture(scope="module")
def flat() -> Hypermap:
    cells = np.full((40, 100), 100, dtype=np.int8)
    cells[1:39, 1:49] = cells[1:39, 51:99] = cells[18:22, 49:51] = 0
    grid = OccupancyLayer("occupancy", "map", GridGeometry(100, 40, 0.1), cells)
    hypermap = Hypermap([grid, SemanticLayer("semantic", "map", THINGS)])
    outlines = shapely.box(0.1, 0.1, 4.9, 3.9), shapely.box(5.1, 0.1, 9.9, 3.9)
    pairs = zip((0, 1), ("hall", "kitchen"), outlines, strict=True)
    rooms = [Room(i, name, outline, kind=name) for i, name, outline in pairs]
    return with_rooms(hypermap, Rooms("map", tuple(rooms), ()))


def ids(answer: Answer) -> list[int | None]:
    return [item.object.id for item in answer.objects]


@pytest.fixture(scope="module")
def with_doors(flat: Hypermap) -> Hypermap:
    """The flat with a bath behind the kitchen: the hall leads to the kitchen, this to the bath."""
    rooms = [
        Room(room.id, room.name, room.outline, kind=room.kind)
        for room in Rooms.of_layer(flat["rooms"])
    ]
    bath = Room(2, "bath", shapely.box(10.1, 0.1, 12, 3.9), kind="bathroom")
    doors = [
        Door(pair, LineString([(x, 1.8), (x, 2.2)]), 0.4) for pair, x in (((0, 1), 5), ((1, 2), 10))
    ]
    return with_rooms(flat, Rooms("map", (*rooms, bath), tuple(doors)))


@pytest.mark.parametrize(
    ("question", "found"),
    [
        ("which rooms are connected to the kitchen?", ["hall", "bath"]),
        ("which rooms are next door to the hall?", ["kitchen"]),
        ("which kitchens are connected to the bath?", ["kitchen"]),
        ("which bathrooms are connected to the hall?", []),
        ("rooms with a couch", ["kitchen"]),
    ],
)
def test_rooms_are_next_door_if_a_door_is_between(
    with_doors: Hypermap, question: str, found: list[str]
) -> None:
    answer = answer_to(with_doors, question)
    assert [room.name for room in answer.rooms if room is not None] == found


def test_whether_rooms_are_connected_and_to_how_many(with_doors: Hypermap) -> None:
    assert answer_to(with_doors, "is the hall connected to the kitchen?").exists
    assert not answer_to(with_doors, "is the hall connected to the bath?").exists
    assert answer_to(with_doors, "how many rooms are connected to the kitchen?").count == 2


def test_doors_between_rooms_are_listed_where_the_map_has_none_as_objects(
    with_doors: Hypermap, flat: Hypermap
) -> None:
    listed = r"no object 'door', but doors between its rooms: hall to kitchen at \(5\.00, 2\.00\), "
    for question in ("where are the doors?", "how many doors are there in the hall?"):
        with pytest.raises(HypermapError, match=listed + r"0\.40 m wide; kitchen to bath at "):
            answer_to(with_doors, question)
    (note,) = answer_to(flat, "where are the doors?").notes
    assert note.startswith("there is no door in the map")
    answer = answer_to(with_doors, "where are the doors and couches?")  # has something to show
    assert [item.object.name for item in answer.objects] == ["couch"]
    assert re.match(r"the map has " + listed, answer.notes[0])


def test_a_map_without_doors_says_so_when_asked_which_rooms_are_connected(flat: Hypermap) -> None:
    answer = answer_to(flat, "which rooms are connected to the kitchen?")
    assert [*answer.rooms] == []
    assert answer.notes == ("the map knows no doors between its rooms",)


def test_how_big_a_room_is_may_be_asked_by_what_is_in_it(with_doors: Hypermap) -> None:
    for question in ("how big is the room with the couch?", "how large is the room with a couch?"):
        (room,) = answer_to(with_doors, question).objects
        assert room.object.name == "kitchen"


@pytest.mark.parametrize(
    ("question", "found"),
    [
        ("where are the cups?", [1, 2]),  # a mug is a cup
        ("where is the mug?", [2]),
        ("what seating is there", [3, 4, 5]),
        ("which seats are in the kitchen", [5]),
        ("which seats are not in the kitchen", [3, 4]),
        ("what is on the table?", [1]),
        ("what is under the table?", [2]),
        ("cups on the table", [1]),
        ("what is at 3, 2?", [0, 1]),
        ("chairs within 24 cm of the table", []),
        ("chairs within 25 cm of the table", [3, 4]),
        ("seats more than 1 m from the table", [5]),
        ("what is next to chair 3?", [0, 1, 2]),
        ("chairs near a chair", []),  # none is its own neighbor, and they are 1.5 m apart
        ("everything in the hall except the chairs", [0, 1, 2]),
        ("chairs and tables", [3, 4, 0]),
        ("the nearest chair to the couch", [4]),
        ("the 2 nearest seats to the couch", [4, 3]),  # it is not near itself
        ("the farthest chair from the couch", [3]),
        ("the second nearest seat to the couch", [3]),
        ("the third largest thing in the hall", [4]),  # a chair as large as the one before
        ("the tallest thing", [3]),
        ("the third tallest thing", [5]),
        ("tables with a cup on them", [0]),
        ("what has anything on it", [0]),
        ("chairs with a cup on them", []),
        ("what furniture has nothing on it", [3, 4, 5]),
        ("seats without a cup on them", [3, 4, 5]),
        ("seats near a table with a cup on it", [3, 4]),
        ("the largest object", [0]),
        ("the smallest thing in the hall", [1]),
        ("which seat are you most sure of?", [5]),
        ("what is left of the table?", [4]),  # the asker stands above it in y and looks down
        ("what is to the right of the table?", [3]),
        ("what is within 1 m of me?", []),
        ("where is object 2", [2]),
        ("where is cup 1", [1]),
        ("where is chair 5", []),
        ("what is between chair 3 and chair 4?", [0, 1]),  # neither mug nor the chairs themselves
        ("what is between chair 3 and the sink?", []),
        ("is anything between me and the couch?", []),
        ("what is between 1, 2 and the couch?", [0, 1, 3, 4]),
        ("chairs that are not between me and the couch", [3, 4]),
        ("what is in this room?", [0, 1, 2, 3, 4]),
        ("which seats are not in this room?", [5]),
        ("the largest thing here", [0]),
        ("seats within 5 m of a table but not within 2 m of a mug", [5]),
        ("seats within 5 m of a table except those within 2 m of a mug", [5]),
        ("things tagged wooden", [0]),
        ('which chairs are tagged "wooden"', []),
    ],
)
def test_which_objects_are_found(flat: Hypermap, question: str, found: list[int]) -> None:
    answer = answer_to(flat, question, Pose2D(3, 3.9, -math.pi / 2))
    if answer.query.which is None:
        assert sorted(map(int, filter(lambda i: i is not None, ids(answer)))) == sorted(found)
    else:
        assert ids(answer) == found


@pytest.mark.parametrize(
    ("question", "said"),
    [
        ("which room is the couch in?", "couch 5 in kitchen"),
        ("where are the chairs and cups?", "cup 1, mug 2, chair 3, ..."),
        ("how many chairs are there?", "2"),
        ("how many things are in each room?", "5 in hall, 1 in kitchen"),
        ("is there a couch in the hall?", "no"),
        ("which rooms have a chair?", "hall"),
        ("where is the piano?", "none; there is no piano in the map"),
        ("how big is the cup 1?", "cup 1: 0.10 x 0.10 m, 100 cm², from 0.74 to 0.85 m high"),
    ],
)
def test_the_short_form_of_an_answer_says_what_was_found(
    flat: Hypermap, question: str, said: str
) -> None:
    assert repr(answer_to(flat, question)) == f"<Answer: {said}>"


def test_of_too_few_it_is_said_how_many_there_are(flat: Hypermap) -> None:
    answer = answer_to(flat, "the third nearest couch", Pose2D(0, 0))
    assert (answer.count, answer.notes) == (0, ("there is 1",))
    assert ("which", "the 3rd nearest") in understood(answer.query)
    assert answer_to(flat, "the third largest room").notes == ("there are 2",)


def test_the_tallest_is_among_those_whose_heights_are_known(flat: Hypermap) -> None:
    plain = SemanticLayer("plain", "map", [SemanticObject("mast", shapely.box(0, 0, 1, 1))])
    answer = answer_to(Hypermap([*flat, plain]), "the tallest thing")
    assert (ids(answer), answer.notes) == ([3], ("1 more has no known height",))
    with pytest.raises(HypermapError, match="does not have the heights of objects"):
        answer_to(Hypermap([plain]), "the tallest thing")


@pytest.mark.parametrize("question", ["the newest room", "which room is the tallest"])
def test_rooms_are_ordered_by_size_or_distance_alone(flat: Hypermap, question: str) -> None:
    with pytest.raises(HypermapError, match="ask for the largest or the nearest"):
        answer_to(flat, question, Pose2D(1, 1))


@pytest.mark.parametrize(
    ("question", "heading"),
    [
        ("what is in front of me?", 0),
        ("what is ahead of me", 0),
        ("what is to the right of me?", 90),
        ("what is behind me?", 180),
        ("what is on my left?", -90),
    ],
)
def test_what_is_around_someone_depends_on_the_heading(
    flat: Hypermap, question: str, heading: float
) -> None:
    # Up to 2 m away are the chair, the table and the cup on it, all in the direction of x.
    answer = answer_to(flat, question, Pose2D(1, 2, math.radians(heading)))
    assert sorted(map(str, ids(answer))) == ["0", "1", "3"]
    assert answer.notes == (f"you look along {heading} degrees",)
    other = answer_to(flat, question, Pose2D(1, 2, math.radians(heading + 90)))
    assert ids(other) == []


@pytest.mark.parametrize(
    ("question", "count", "rooms"),
    [
        ("how many chairs are there", 2, []),
        ("is there a couch in the kitchen", 1, []),
        ("is there a couch in the hall", 0, []),
        ("which room is the couch in", 1, ["kitchen"]),
        ("which rooms have a chair", 1, ["hall"]),
        ("which rooms are there", 2, ["hall", "kitchen"]),
        ("how many rooms are there", 2, ["hall", "kitchen"]),
        ("which is the largest room", 1, ["hall"]),
        ("which is the second largest room", 1, ["kitchen"]),
        ("is there a library", 0, []),
        ("how far is the kitchen from the couch", 1, ["kitchen"]),
        ("how many chairs are in each room", 2, ["hall", "kitchen"]),
        ("which room has the most chairs", 1, ["hall"]),
        ("which room has the fewest chairs", 1, ["kitchen"]),
        ("which room has the most sinks", 2, ["hall", "kitchen"]),  # none, and so has the other
        ("which two rooms have the most seats", 2, ["hall", "kitchen"]),
        ("which kitchen has the most chairs", 1, ["kitchen"]),
        ("rooms with two chairs", 1, ["hall"]),
        ("two chairs in one room", 1, ["hall"]),
        ("which rooms have more than two chairs", 0, []),
        ("which rooms have at most two chairs", 2, ["hall", "kitchen"]),
        ("rooms without a chair", 1, ["kitchen"]),
        ("is there a room without a chair", 1, ["kitchen"]),
        ("is there a room with three chairs", 0, []),
        ("how many rooms have a chair", 1, ["hall"]),
        ("which kitchens have a cup", 0, []),
        ("which kitchens have a couch", 1, ["kitchen"]),
        ("which rooms have a chair and a table", 1, ["hall"]),
        ("which rooms have both a chair and a couch", 0, []),
        ("which rooms have a chair, a cup and a mug", 1, ["hall"]),
        ("kitchens with a chair and a table", 0, []),
        ("which rooms have a seat but no table", 1, ["kitchen"]),
        ("which rooms have a seat and no table", 1, ["kitchen"]),
        ("rooms with a seat, but without a table or a mug", 1, ["kitchen"]),
        ("rooms with a chair near a table but no couch", 1, ["hall"]),
        ("which rooms have a seat other than a couch", 1, ["hall"]),
        ("which rooms have neither a table nor a chair", 1, ["kitchen"]),
        ("which rooms have no chair and no couch", 0, []),
        ("how many rooms have no cup and no mug", 1, ["kitchen"]),
        ("is there a room with a chair and a couch", 0, []),
        ("is there a room with a chair and a table", 1, []),
        ("how many rooms have a seat but no couch", 1, []),
    ],
)
def test_counts_and_rooms(flat: Hypermap, question: str, count: int, rooms: list[str]) -> None:
    answer = answer_to(flat, question)
    assert (answer.count, answer.exists) == (count, count > 0)
    assert [room.name for room in answer.rooms if room is not None] == rooms


@pytest.mark.parametrize(
    ("question", "said"),
    [
        ("are there two chairs in the hall", ["yes, 2"]),
        ("are there more than two chairs", ["no, 2"]),
        ("are there exactly two seats", ["no, 3"]),
        ("are there fewer than 3 chairs", ["yes, 2"]),
    ],
)
def test_a_number_is_compared_with_how_many_there_are(
    flat: Hypermap, question: str, said: list[str]
) -> None:
    answer = answer_to(flat, question)
    assert list(lines(flat, answer))[:1] == said
    assert document(flat, answer)["exists"] == said[0].startswith("yes")


def test_each_room_is_answered_with_its_count_in_words_and_values(flat: Hypermap) -> None:
    answer = answer_to(flat, "how many chairs are in each room?")
    assert [line.rsplit(": ")[-1] for line in lines(flat, answer)] == ["2", "0"]
    assert [(row["name"], row["count"]) for row in document(flat, answer)["rooms"]] == [
        ("hall", 2),
        ("kitchen", 0),
    ]
    assert ("asked", "how many objects are in each room") in understood(answer.query)


def test_what_stands_in_no_room_is_counted_apart(flat: Hypermap) -> None:
    outside = thing("chair", 20, 2, 0.5, 0.0, 0.9)
    layer = SemanticLayer("more", "map", [outside])
    answer = answer_to(Hypermap([*flat, layer]), "how many chairs are in each room?")
    assert (answer.count, answer.counts) == (2, (2, 0))
    assert answer.notes == ("1 more is in no room",)


def test_a_room_is_called_by_its_name_and_not_by_its_number(flat: Hypermap) -> None:
    answer = answer_to(flat, "how far is the kitchen from the chair")
    [kitchen] = [room for room in answer.rooms if room is not None]
    assert [note.split(" is ")[0] for note in answer.notes] == ["kitchen"]
    assert next(iter(lines(flat, answer))).startswith(f"kitchen (id {kitchen.id}) at (")
    assert len(answer_to(flat, "nearest room to 0,0").notes) == 1  # and not of all others


def test_an_unknown_tag_is_named_beside_those_that_are_known(flat: Hypermap) -> None:
    (note,) = answer_to(flat, "what is tagged woden").notes
    assert note == "nothing there has the tag 'woden'; did you mean 'wooden'?"


def test_distances_are_between_shapes_or_along_paths(flat: Hypermap) -> None:
    (item,) = answer_to(flat, "how far is the couch from the table").objects
    assert item.distance == pytest.approx(4.0)  # from 3.5 to 7.5
    asked = Query("distance", ("couch",), by="path")
    (walked,) = ask(flat, asked, asker=Pose2D(1, 3.5)).objects
    assert walked.distance is not None
    through_door = math.hypot(3.9, 1.4) + math.hypot(2.5, 0.1)
    assert walked.distance == pytest.approx(through_door, abs=0.3)


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("where is the nearest cup", "depends on where you are"),
        ("what is left of the table", "depends on where you are"),
        ("what is in this room", "depends on where you are"),
        ("what is between a chair and the couch", "names 2 things called chair; write one"),
        ("which room has the most seats and no table", "ask one at a time"),
        ("which room has the fewest chairs but a table", "ask one at a time"),
        ("rooms with two chairs but no couch", "ask one at a time"),
        ("rooms with a chair but no mug near a table", "ask one at a time"),
        ("what is in the office", "there is no room or kind of room 'office'"),
        ('{"names": ["cup"], "which": "best"}', "'best' is not one of nearest"),
        ('{"names": ', "the query is not JSON"),
    ],
)
def test_what_cannot_be_answered_is_said(flat: Hypermap, question: str, words: str) -> None:
    with pytest.raises(HypermapError, match=words):
        answer_to(flat, question)


def test_a_thing_that_the_map_does_not_have_is_noted(flat: Hypermap) -> None:
    answer = answer_to(flat, "where is the giraffe")
    assert (answer.exists, answer.notes) == (False, ("there is no giraffe in the map",))


@pytest.mark.parametrize(
    ("question", "note"),
    [
        ("where is the bench", "there is no bench in the map; similar: chair, couch"),
        ("where is the tankard", "there is no tankard in the map; similar: cup, mug"),
    ],
)
def test_things_like_one_that_the_map_does_not_have_are_noted(
    flat: Hypermap, question: str, note: str
) -> None:
    assert answer_to(flat, question).notes == (note,)


@pytest.mark.parametrize(
    ("question", "found"),
    [
        ("what is in the same room as the table?", [1, 2, 3, 4]),
        ("which chairs are in the same room as the table?", [3, 4]),
        ("which chairs are in the same room as a chair?", [3, 4]),
        ("what is in the same room as the couch?", []),
        ("what is not in the same room as the table?", [0, 5]),
        ("which tables are in the same room as a giraffe?", []),
    ],
)
def test_objects_that_share_a_room_with_another_are_found(
    flat: Hypermap, question: str, found: list[int]
) -> None:
    assert sorted(item.object.id for item in answer_to(flat, question).objects) == found


def test_a_size_is_that_of_the_smallest_rectangle_around_the_shape() -> None:
    turned = shapely.affinity.rotate(shapely.box(0, 0, 2.0, 0.5), 30)
    shelf = SemanticObject("shelf", turned, id=7, attributes={"z_min": -0.01, "z_max": 1.8})
    rug = SemanticObject("rug", shapely.Point(1, 1).buffer(0.05), id=8)
    cluttered = Hypermap([SemanticLayer("semantic", "map", [shelf, rug])])
    answer = answer_to(cluttered, "how big is the shelf?")
    (line,) = lines(cluttered, answer)
    assert line.endswith(": 2.00 x 0.50 m, 1.00 m², from 0.00 to 1.80 m high")
    (row,) = document(cluttered, answer)["objects"]
    size = {"length": 2.0, "width": 0.5, "area": 1.0, "z_min": -0.01, "z_max": 1.8}
    assert row["size"] == pytest.approx(size)
    (line,) = lines(cluttered, answer_to(cluttered, "how large is the rug"))
    assert line.endswith(": 0.10 x 0.10 m, 78 cm²")


def test_the_size_of_rooms_is_told(flat: Hypermap) -> None:
    answer = answer_to(flat, "how large is the kitchen?")
    assert [*lines(flat, answer)] == ["kitchen (id 1): 4.80 x 3.80 m, 18.2 m²"]
    (row,) = document(flat, answer)["rooms"]
    assert row["size"]["area"] == pytest.approx(4.8 * 3.8)


def test_the_size_of_this_room_is_that_of_the_room_with_the_asker(flat: Hypermap) -> None:
    answer = answer_to(flat, "how big is this room?", Pose2D(8, 2, 0))
    (line,) = lines(flat, answer)
    assert line == "kitchen 1 at (7.50, 2.00), in kitchen: 4.80 x 3.80 m, 18.2 m²"


def test_without_rooms_or_heights_the_answer_says_what_is_missing() -> None:
    things = [SemanticObject("cup", shapely.box(0, 0, 1, 1)) for _ in range(2)]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    with pytest.raises(HypermapError, match="the map has no rooms; `hypermap rooms MAP -o OUT`"):
        answer_to(hypermap, "what is in the kitchen")
    with pytest.raises(HypermapError, match="does not have the heights of objects"):
        answer_to(hypermap, "what is under the cup")
    assert answer_to(Hypermap(), "how many cups are there").count == 0


# Times

NOON = datetime(2026, 11, 20, 12, tzinfo=timezone.utc)
SEEN = [  # hours from noon, first and last
    ("cup", -48, -30),  # 0
    ("cup", -48, -10),  # 1
    ("mug", -8, -2),  # 2
    ("chair", -48, -1),  # 3
    ("chair", None, None),  # 4: unknown
]


@pytest.fixture(scope="module")
def diary() -> Hypermap:
    def stamp(hours: float | None) -> float | None:
        return None if hours is None else NOON.timestamp() + 3600 * hours

    things = [
        SemanticObject(
            name, shapely.box(i, 0, i + 0.5, 1), first_seen=stamp(first), last_seen=stamp(last)
        )
        for i, (name, first, last) in enumerate(SEEN)
    ]
    return Hypermap([SemanticLayer("semantic", "map", things)])


def hours_ago(hours: float) -> datetime:
    return NOON - timedelta(hours=hours)


@pytest.mark.parametrize(
    ("when", "found"),
    [
        (When("seen", hours_ago(12)), [1, 2, 3]),
        (When("seen", hours_ago(12), hours_ago(5)), [1, 2]),
        (When("seen", None, hours_ago(20)), [0, 1, 3]),
        (When("new", hours_ago(12)), [2]),
        (When("new", None, hours_ago(12)), [0, 1, 3]),
        (When("not seen", hours_ago(5)), [0, 1]),
        (When("not seen", hours_ago(72)), []),
    ],
)
def test_when_objects_were_seen(diary: Hypermap, when: When, found: list[int]) -> None:
    assert ids(ask(diary, Query(when=(when,)))) == found


def test_what_may_have_been_seen_in_a_time_that_is_over_is_counted(diary: Hypermap) -> None:
    answer = ask(diary, Query(when=(When("seen", hours_ago(12), hours_ago(5)),)))
    assert answer.notes == ("1 more were seen before and after, and may have been then",)


def test_the_surest_object_is_the_most_probable_one_not_that_with_most_existence() -> None:
    often, sure = (
        replace(thing("cup", x, 1, 0.1, 0.0, 0.1), existence=existence, confidence=(probability,))
        for x, existence, probability in ((1, 20.0, 0.6), (2, 9.0, 0.9))
    )
    unknown = replace(thing("cup", 3, 1, 0.1, 0.0, 0.1), existence=None)
    cups = Hypermap([SemanticLayer("semantic", "map", [unknown, often, sure])])
    assert ids(ask(cups, Query(names=("cup",), which="surest"))) == [2]
    assert ids(ask(cups, Query(names=("cup",), which="surest", count=3))) == [2, 1, 0]


def test_last_seen_is_answered_newest_first(diary: Hypermap) -> None:
    assert ids(ask(diary, Query("last_seen", ("cup", "mug")))) == [2, 1, 0]
    assert ids(ask(diary, Query("last_seen", ("cup",), which="newest"))) == [2]  # a mug is a cup


def test_a_recording_without_a_calendar_cannot_say_on_which_day() -> None:
    thing = SemanticObject("cup", shapely.box(0, 0, 1, 1), first_seen=3.0, last_seen=40.0)
    hypermap = Hypermap([SemanticLayer("semantic", "map", [thing])])
    with pytest.raises(HypermapError, match="the dates"):
        ask(hypermap, Query(when=(When("seen", NOON),)))
    assert ids(ask(hypermap, Query("last_seen", ("cup",)))) == [0]


# What only programs ask


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ({"ids": [1, 5]}, [1, 5]),
        ({"ids": [1, 5], "names": ["cup"]}, [1]),
        ({"tags": ["red"]}, [4]),
        ({"tags": ["red", "old"]}, []),
        ({"names": ["cup"], "exact": True}, [1]),  # not the mug
        ({"names": ["seating"], "exact": True}, []),
        ({"where": [{"relation": "at", "what": {"area": "POLYGON((7 1, 9 1, 9 3, 7 1))"}}]}, [5]),
        ({"where": [{"relation": "at", "what": {"point": [3, 2]}}]}, [1, 0]),  # the smallest first
        ({"where": [{"relation": "in", "what": {"names": ["kitchen"]}}]}, [5]),  # a room
        ({"where": [{"relation": "in", "what": {"names": ["table"]}}]}, [1, 2]),
        ({"where": [{"relation": "visible from", "what": {"point": [1, 1]}}]}, [0, 1, 2, 3, 4]),
        ({"where": [{"relation": "visible from", "what": {"point": [6, 3.5]}}]}, [5]),
        ({"where": [{"relation": "visible from", "what": {"names": ["couch"]}}]}, [0, 1, 2, 3, 4]),
        (
            {"layers": ["rooms"], "where": [{"relation": "with", "what": {"names": ["seating"]}}]},
            [0, 1],
        ),
        ({"layers": ["rooms"], "where": [{"relation": "with", "what": {"names": ["mug"]}}]}, [0]),
    ],
)
def test_what_programs_ask_for(flat: Hypermap, query: dict[str, Any], found: list[int]) -> None:
    things = flat.semantic("semantic").objects()
    things[4] = replace(things[4], tags=("red",))
    layers = [layer if layer.name != "semantic" else semantic_of(things) for layer in flat]
    assert ids(flat.with_layers(layers).ask(query)) == found


def semantic_of(things: list[SemanticObject]) -> SemanticLayer:
    return SemanticLayer("semantic", "map", things)


def test_layers_without_objects_say_their_labels(flat: Hypermap) -> None:
    at = Condition("at", Reference(point_xy=(3.0, 2.0)))
    answer = flat.ask(Query("labels", where=(at,)))
    assert ids(answer) == [1, 0]
    assert [(cell.layer, cell.label) for cell in answer.cells] == [
        ("occupancy", "Free"),
        ("rooms", "hall"),
    ]
    walls = flat.ask({"give": "labels", "names": ["Occupied"], "exact": True})
    assert walls.count == len(walls.cells) == 100 * 40 - 2 * 38 * 48 - 8
    nearest = flat.ask(
        {"give": "labels", "names": ["Occupied"], "exact": True, "which": "nearest", "count": 2},
        pose=(0.45, 2.05),
    )
    assert [cell.distance for cell in nearest.cells] == pytest.approx([0.4, 0.41231], abs=1e-4)


def test_a_query_by_words_and_one_by_values_have_the_same_answer(flat: Hypermap) -> None:
    asked = flat.ask("where is the nearest chair?", pose=(1, 2))
    assert ids(asked) == [3]
    assert ids(flat.ask(asked.query, pose=Pose2D(1, 2))) == [3]
    assert ids(flat.ask(asked.query.to_json(), pose=(1, 2))) == [3]


@pytest.mark.parametrize(
    ("query", "words"),
    [
        (Query(as_of=datetime(2026, 11, 20, tzinfo=timezone.utc)), "keeps no history"),
        (Query(layers=("semantics",)), "there is no layer 'semantics'; did you mean 'semantic'"),
        (Query(layers=("occupancy",)), "layer 'occupancy' has none"),
        (Query("places", measured=Measured("warmth", 25.0)), "there is no layer 'warmth'"),
        (Query(where=(Condition("visible from", Reference(names=("chair",))),)), "names 2"),
    ],
)
def test_what_a_map_does_not_have_is_said(flat: Hypermap, query: Query, words: str) -> None:
    with pytest.raises(HypermapError, match=words):
        flat.ask(query)


def test_a_question_that_is_too_long_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "value_query", lambda *_: pytest.fail("it is read"))
    monkeypatch.setattr(asking, "without_as_of", lambda *_: pytest.fail("it is read"))
    with pytest.raises(NotUnderstood, match="at most 500 characters, not 1000002"):
        answer_to(Hypermap([]), "what is at " + "1,2 " * 249_997 + "now")


def test_an_area_may_reach_as_far_as_numbers_do(flat: Hypermap) -> None:
    area = Reference(area="POLYGON((2.5 0, 1e308 0, 1e308 3, 2.5 3, 2.5 0))")
    found = ask(flat, Query(where=(Condition("at", area),))).objects
    names = sorted(each.object.name for each in found if each.layer == "semantic")
    assert names == ["chair", "couch", "cup", "mug", "table"]


def test_a_question_in_english_is_for_another_function() -> None:
    with pytest.raises(TypeError, match="got 'where is the cup'; ask_map takes questions in Eng"):
        ask(Hypermap(), "where is the cup")  # type: ignore[arg-type]


def test_a_place_has_two_coordinates() -> None:
    with pytest.raises(ValueError, match=r"a point is \(x, y\), got \(1,\)"):
        Reference(point_xy=(1,))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"pose must be \(x, y\) or a Pose2D, got \(1,\)"):
        Hypermap().ask("where is the nearest chair?", pose=(1,))
