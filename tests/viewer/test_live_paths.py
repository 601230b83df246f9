"""Paths and doors as the page's server tells them."""

from __future__ import annotations

import math
import shlex

import numpy as np
import pytest
import shapely

from hypermap.cli.main import main
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.rooms import Door, Room, Rooms, with_rooms
from hypermap.testing import square

from .live_tools import Window, serving
from .test_page_rooms import flat

LENGTH = 2 * math.hypot(2.4, 2.5) + 0.2  # from (2, 1) over both corners of the door to (7, 1)


@pytest.fixture
def window(tmp_path):
    path = tmp_path / "flat.hmap"
    save_map(flat(), path)
    with serving(path) as client:
        yield Window(client)


def test_a_path_is_reported_with_its_rooms_and_the_code_that_asks_the_same(window, capsys):
    answer = window.get("/api/path", **{"from": "2,1", "to": "7,1", "radius": 0})
    assert answer["length"] == pytest.approx(LENGTH, abs=0.01)
    assert (answer["points"][0], answer["points"][-1]) == ([2, 1], [7, 1])
    assert [room["name"] for room in answer["rooms"]] == ["kitchen", "office"]
    assert [door["width"] for door in answer["doors"]] == [0.9]
    for radius in (0, 0.2):
        answer = window.get("/api/path", **{"from": "2,1", "to": "7,1", "radius": radius})
        capsys.readouterr()
        exec(answer["python"], {})
        assert capsys.readouterr().out.startswith(str(answer["length"])[:10])
        with pytest.raises(SystemExit):
            main(shlex.split(answer["command"])[1:])
        assert capsys.readouterr().out.startswith(f"{answer['length']:.2f} m\n")


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"from": "2,1", "to": "4.5,1"}, "the goal (4.50, 1.00) is in a wall"),
        ({"from": "2,2", "to": "7,2", "radius": 0.6}, "no path leads from (2.00, 2.00)"),
        ({"from": "2,1", "to": "7,1", "radius": -1}, "radius: must not be negative"),
        ({"from": "2,1", "to": "7,1", "radius": "x"}, "radius: a number within"),
        ({"from": "2,1"}, "to: expected x,y, got None"),
        ({"from": "2,nan", "to": "7,1"}, "from: a number within"),
    ],
)
def test_what_is_no_path_is_refused_with_a_reason(window, values, reason):
    assert reason in window.get("/api/path", 400, **values)["error"]


def test_a_path_leads_over_the_map_as_it_is_now(window):
    asked = {"from": "2,1", "to": "2,2"}
    before = window.get("/api/path", **asked)["rooms"]
    rename = {"op": "update", "layer": "rooms", "id": 0, "name": "scullery"}
    window.edit(rename)
    after = window.get("/api/path", **asked)["rooms"]
    assert [room["name"] for room in before + after] == ["kitchen", "scullery"]


def test_rooms_that_are_merged_keep_their_doors_to_others_and_that_is_undone(tmp_path):
    boxes = [shapely.box(x, 0, x + 4, 4) for x in (0, 4, 8)]
    rooms = [Room(number, str(number), box) for number, box in enumerate(boxes)]
    doors = [
        Door((i, i + 1), shapely.LineString([(x, 1), (x, 2)]), 1.0) for i, x in ((0, 4), (1, 8))
    ]
    hypermap = with_rooms(flat(), Rooms("map", tuple(rooms), tuple(doors)))
    save_map(hypermap, tmp_path / "three.hmap")
    with serving(tmp_path / "three.hmap") as client:
        window = Window(client)
        for kept, gone, left in ((0, 1, [0, 2]), (2, 1, [0, 2])):
            window.edit({"op": "merge", "layer": "rooms", "id": kept, "others": [gone]})
            (door,) = window.get("/api/map")["doors"]
            assert door["rooms"] == left
            window.go("/api/undo")
            doors = [door["rooms"] for door in window.get("/api/map")["doors"]]
            assert doors == [[0, 1], [1, 2]]


def test_the_map_tells_its_doors_or_why_it_cannot(window, tmp_path):
    (door,) = window.get("/api/map")["doors"]
    assert door == {"rooms": [0, 1], "line": [[4.5, 3.5], [4.5, 4.4]], "width": 0.9}
    room = SemanticObject("a", square("a", 0, 0).footprint, 0, attributes={"doors": [{"to": 1}]})
    hypermap = flat()
    hypermap.remove("rooms")
    hypermap.add(SemanticLayer("rooms", "map", [room]))
    save_map(hypermap, tmp_path / "odd.hmap")
    with serving(tmp_path / "odd.hmap") as client:
        answer = Window(client).info
    assert answer["doors"] == []
    assert "its doors cannot be read" in answer["notes"][0]


def split(number: int, line: object, layer: str = "rooms") -> dict[str, object]:
    return {"op": "split", "layer": layer, "id": number, "line": line}


def test_a_room_is_split_in_the_base_frame_and_that_is_undone_and_redone(window):
    window.edit({"op": "update", "layer": "rooms", "id": 1, "name": "Emma's place"})
    before = window.get("/api/map")["doors"]
    window.edit(split(1, [[4.5, 2.5], [8.6, 2.5]]))
    kept, new = (window.get(f"/api/objects/rooms/{number}") for number in (1, 2))
    assert [kept["name"], new["name"]] == ["Emma's place", "Emma's place 2"]
    assert kept["area"] == pytest.approx(4.1 * 2)
    assert new["area"] == pytest.approx(4.1 * 2)
    doors = {tuple(door["rooms"]): door["width"] for door in window.get("/api/map")["doors"]}
    # The old door is at y = 3.5 to 4.4; both parts are as large.
    upper = 1 if kept["at"][1] > 2.5 else 2
    assert doors == {(0, upper): 0.9, (1, 2): pytest.approx(4.0, abs=0.05)}
    window.go("/api/undo")
    assert window.get("/api/map")["doors"] == before
    assert window.get("/api/objects/rooms/2", if_there=1) is None
    window.go("/api/redo")
    assert len(window.get("/api/map")["doors"]) == 2


@pytest.mark.parametrize(
    ("operation", "status", "reason"),
    [
        (split(1, [[0, 9], [1, 9]]), 400, "the line does not divide 'office'"),
        (split(1, [[4, 2]]), 400, "line: a line needs at least two different points"),
        (split(1, [[4, 2], [4, 2]]), 400, "line: a line needs at least two different points"),
        (split(1, [[4, 2], [4, "x"]]), 400, "line: a number within"),
        (split(1, None), 400, "line: a list of corners [x, y] is expected"),
        (split(9, [[4, 2], [9, 2]]), 404, "no object with id 9"),
        (split(0, [[4, 2], [9, 2]], "things"), 400, "layer: only 'rooms' has rooms"),
        ({"op": "find_rooms", "layer": "things"}, 400, "layer: only 'rooms' has rooms"),
        ({"op": "find_rooms", "layer": "rooms"}, 400, "the map has rooms already"),
    ],
)
def test_an_edit_of_rooms_that_cannot_be_is_refused(window, operation, status, reason):
    assert reason in window.edit(operation, expected=status)["error"]


def test_rooms_are_found_once_all_are_deleted_and_that_is_one_step(window):
    for number in (0, 1):
        window.edit({"op": "remove", "layer": "rooms", "id": number})
    window.edit({"op": "find_rooms", "layer": "rooms"})
    answer = window.get("/api/map")
    assert [len(door["rooms"]) for door in answer["doors"]] == [2]
    (layer,) = (layer for layer in answer["layers"] if layer["name"] == "rooms")
    assert layer["count"] == 2
    window.go("/api/undo")
    assert window.get("/api/map")["doors"] == []


@pytest.mark.parametrize(
    ("value", "reason"),
    [(-1, "has no free cell"), (None, "the map has no occupancy layer")],
)
def test_rooms_that_cannot_be_found_change_nothing(tmp_path, value, reason):
    hypermap = flat()
    grid = hypermap.occupancy()
    assert grid.grid is not None
    cells = np.full((grid.grid.height, grid.grid.width), value or 0)
    changed = [] if value is None else [OccupancyLayer("occupancy", "map", grid.grid, cells)]
    hypermap = hypermap.with_layers([*changed, hypermap.semantic("things")])
    save_map(hypermap, tmp_path / "none.hmap")
    with serving(tmp_path / "none.hmap") as client:
        window = Window(client)
        assert reason in window.edit({"op": "find_rooms", "layer": "rooms"}, expected=400)["error"]
        assert "rooms" not in [layer["name"] for layer in window.get("/api/map")["layers"]]


def test_objects_are_reported_with_their_room_and_found_by_its_kind_or_id(window):
    window.edit({"op": "update", "layer": "rooms", "id": 0, "name": "Emma's place"})
    (cup,) = window.get("/api/find", name="cup")["rows"]
    assert cup["room"] == "Emma's place"
    assert window.get("/api/objects/things/0")["room"] == "Emma's place"
    assert "room" not in window.get("/api/objects/rooms/0")
    for inside, count in (("kitchen", 1), ("room 0", 1), ("Emma's place", 1), ("room 1", 0)):
        found = window.get("/api/find", name="cup", inside=inside)
        assert (found["total"], found["inside"], found["unknown"]) == (count, inside, {})


def test_objects_are_found_where_the_rooms_cannot_be_read(tmp_path):
    room = SemanticObject("a", square("a", 0, 0).footprint, 0, attributes={"doors": [{"to": 1}]})
    hypermap = flat()
    hypermap.remove("rooms")
    hypermap.add(SemanticLayer("rooms", "map", [room]))
    save_map(hypermap, tmp_path / "odd.hmap")
    with serving(tmp_path / "odd.hmap") as client:
        (row,) = Window(client).get("/api/find", name="cup")["rows"]
    assert "room" not in row
