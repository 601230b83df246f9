"""Paths and doors as the page's server tells them."""

from __future__ import annotations

import math
import shlex

import pytest
import shapely

from hypermap.cli.main import main
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


def test_a_path_is_told_with_its_rooms_and_the_code_that_asks_the_same(window, capsys):
    told = window.get("/api/path", **{"from": "2,1", "to": "7,1", "radius": 0})
    assert told["length"] == pytest.approx(LENGTH, abs=0.01)
    assert (told["points"][0], told["points"][-1]) == ([2, 1], [7, 1])
    assert [room["name"] for room in told["rooms"]] == ["kitchen", "office"]
    assert [door["width"] for door in told["doors"]] == [0.9]
    for radius in (0, 0.2):
        told = window.get("/api/path", **{"from": "2,1", "to": "7,1", "radius": radius})
        capsys.readouterr()
        exec(told["python"], {})
        assert capsys.readouterr().out.startswith(str(told["length"])[:10])
        with pytest.raises(SystemExit):
            main(shlex.split(told["command"])[1:])
        assert capsys.readouterr().out.startswith(f"{told['length']:.2f} m\n")


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
        told = Window(client).info
    assert told["doors"] == []
    assert "its doors cannot be read" in told["notes"][0]
