"""What stays when rooms are found again, what they are called, and how they hang together."""

from __future__ import annotations

import dataclasses

import pytest
import shapely

from hypermap import Hypermap, SemanticLayer, SemanticObject, open_map, save_map
from hypermap.core.errors import FormatError, HypermapError
from hypermap.rooms import (
    Kinds,
    Rooms,
    find_rooms,
    graph,
    load_kinds,
    rooms_of_map,
    with_rooms,
)

from .conftest import Plan, along_a_corridor, two_rooms


def at(name: str, x: float, y: float) -> SemanticObject:
    return SemanticObject(name, shapely.box(x - 0.1, y - 0.1, x + 0.1, y + 0.1))


KITCHEN = [at("refrigerator", 1, 1), at("Microwave", 2, 1)]


def test_rooms_are_named_by_what_stands_in_them():
    objects = [*KITCHEN, at("toilet", 6, 3)]
    rooms = find_rooms(two_rooms().layer(), objects=objects)
    assert {room.name for room in rooms} == {"kitchen", "bathroom"}
    kitchen = rooms["kitchen"]
    assert kitchen.outline.covers(shapely.Point(1, 1))
    assert kitchen.sure == pytest.approx(6 / 7, abs=1e-3)  # both 3, and 1 for no kind


def test_a_thing_in_the_wall_is_in_the_room_beside_it():
    rooms = find_rooms(Plan(5, 4).clear(1, 1, 4, 3).layer(), objects=[at("toilet", 0.8, 2)])
    assert [room.name for room in rooms] == ["bathroom"]


def test_rooms_of_one_kind_are_numbered():
    rooms = find_rooms(two_rooms().layer())
    assert [room.name for room in rooms] == ["room", "room 2"]


def test_ids_and_names_given_by_hand_stay_where_the_map_grows():
    first = find_rooms(two_rooms().layer())
    layer = first.layer()
    layer.rename(1, "Ada's")
    grown = Plan(14, 6).clear(0.4, 0.5, 4.4, 4.5).clear(4.6, 0.5, 8.6, 4.6)
    grown.clear(4.4, 2, 4.6, 2.9).clear(9, 0.2, 13, 4).clear(8.6, 2, 9, 2.9)
    again = find_rooms(grown.layer(), previous=layer, objects=[*KITCHEN, at("toilet", 6, 3)])
    assert [(room.id, room.name, room.is_named) for room in again] == [
        (0, "kitchen", False),
        (1, "Ada's", True),
        (2, "room", False),
    ]
    assert again[1].kind == "bathroom"
    assert [door.rooms for door in again.doors] == [(0, 1), (1, 2)]


def test_an_id_is_not_given_again():
    layer = find_rooms(two_rooms().layer()).layer()
    layer.remove(1)
    assert [room.id for room in find_rooms(two_rooms().layer(), previous=layer)] == [0, 2]


def test_rooms_in_another_frame_are_not_taken_for_the_same():
    other = SemanticLayer("rooms", "odom", find_rooms(two_rooms().layer()).layer())
    with pytest.raises(HypermapError, match="'rooms' is in frame 'odom'"):
        find_rooms(two_rooms().layer(), previous=other)


def test_rooms_are_kept_in_a_file_as_objects(tmp_path):
    hypermap = Hypermap([two_rooms().layer(), SemanticLayer("semantic", "map", KITCHEN)])
    rooms = rooms_of_map(hypermap)
    save_map(with_rooms(hypermap, rooms), tmp_path / "a.hmap")
    layer = open_map(tmp_path / "a.hmap").semantic("rooms")
    assert layer.label_at([[1, 1], [6, 3]]).tolist() == ["kitchen", "room"]
    read = Rooms.of_layer(layer)
    for one, other in zip(read, rooms, strict=True):
        assert one.outline.equals(other.outline)
        without = {"outline": None, "attributes": None}
        assert dataclasses.replace(one, **without).__dict__ == (
            dataclasses.replace(other, **without).__dict__
        )
    assert [(d.rooms, d.line.wkt, d.width) for d in read.doors] == [
        (d.rooms, d.line.wkt, d.width) for d in rooms.doors
    ]
    twice = with_rooms(open_map(tmp_path / "a.hmap"), rooms)
    assert [each.name for each in twice] == ["occupancy", "semantic", "rooms"]


def test_doors_that_cannot_be_read_are_an_error():
    box = SemanticObject("room", shapely.box(0, 0, 1, 1), 3, attributes={"doors": [{"to": "x"}]})
    with pytest.raises(HypermapError, match="'rooms', object 3: its doors cannot be read"):
        Rooms.of_layer(SemanticLayer("rooms", "map", [box]))


def test_a_room_is_found_by_id_and_name():
    rooms = find_rooms(two_rooms().layer())
    assert rooms[1] is rooms["room 2"]
    with pytest.raises(HypermapError, match=r"there is no room 'rom 2'; did you mean 'room 2'\?"):
        rooms["rom 2"]
    with pytest.raises(HypermapError, match="no room with the id 7"):
        rooms[7]
    layer = rooms.layer()
    layer.rename([0, 1], "den")
    with pytest.raises(HypermapError, match="2 rooms are called 'den'; ask by id: 0 or 1"):
        Rooms.of_layer(layer)["den"]


def test_a_robot_reaches_the_rooms_whose_doors_it_fits_through():
    rooms = find_rooms(along_a_corridor().layer())
    assert set(graph(rooms).parts()) == {0}
    assert graph(rooms, robot_radius=0.4).is_reachable(0, 6)
    wide = graph(rooms, robot_radius=0.6)
    assert not wide.is_reachable(0, 6)
    assert (wide.edges.shape, wide.widths.shape, wide.doors_xy.shape) == ((0, 2), (0,), (0, 2))
    with pytest.raises(ValueError, match="a robot's radius"):
        graph(rooms, robot_radius=-1)
    with pytest.raises(ValueError, match="no room with the id 9"):
        wide.is_reachable(0, 9)


def test_a_graph_of_networkx_has_rooms_and_doors():
    networkx = pytest.importorskip("networkx", reason="networkx is not installed")
    found = graph(find_rooms(two_rooms().layer())).to_networkx()
    assert networkx.has_path(found, 0, 1)
    assert found.nodes[1]["name"] == "room 2"
    assert found.edges[0, 1, 0]["width"] == pytest.approx(0.9, abs=0.1)


def test_a_table_of_ones_own_decides(tmp_path):
    file = tmp_path / "kinds.yaml"
    file.write_text("cold store: {Refrigerator: 9}\n")
    rooms = find_rooms(two_rooms().layer(), objects=KITCHEN, kinds=load_kinds(file))
    assert {room.name for room in rooms} == {"cold store", "room"}


def test_what_speaks_for_two_kinds_alike_is_not_sure():
    kinds = Kinds({"a": {"x": 1}, "b": {"x": 1}})
    assert kinds.guess(["x"]) == ("", 0.0)
    assert Kinds({}).guess(["x"]) == ("", 0.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("- kitchen", "each kind with names and numbers is expected"),
        ("kitchen: sink", "kitchen: each kind with names"),
        ("kitchen: {sink: much}", "kitchen.sink: 'much' is not a number of at least 0"),
        ("kitchen: {sink: -1}", "kitchen.sink: -1 is not a number of at least 0"),
        ("kitchen: {", "this is not a readable YAML file"),
        ("Küche: {sink: 1}", r"kinds\.yaml: is not text in UTF-8"),
    ],
)
def test_a_table_that_is_none_is_an_error(tmp_path, text, reason):
    file = tmp_path / "kinds.yaml"
    file.write_text(text, encoding="latin-1")
    with pytest.raises(FormatError, match=reason) as raised:
        load_kinds(file)
    assert str(file) in str(raised.value)


def test_a_drawn_room_that_crosses_a_wall_ends_there_and_that_is_said(caplog):
    drawn = SemanticLayer("rooms", "map", [SemanticObject("den", shapely.box(0.4, 0.5, 8.6, 4.5))])
    rooms = find_rooms(two_rooms().layer(), previous=drawn)
    assert sorted(room.name for room in rooms) == ["den", "room"]
    assert "room 'den' (id 0) reached through a wall" in caplog.text
