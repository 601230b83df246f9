from __future__ import annotations

import pytest
import shapely

from hypermap import Hypermap, SemanticLayer, SemanticObject, save_map
from hypermap.questions import cells
from hypermap.testing import square

from .conftest import assert_one_error


def places(result) -> list[tuple[str, float, float]]:
    assert result.code == 0
    return [
        (row["label"], round(row["x"], 3), round(row["y"], 3)) for row in result.json["answers"]
    ]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        # the base frame: x = 10 - y_room, y = x_room
        (["--name", "chair"], [("chair", 9.5, 0.5), ("chair", 9.5, 4.5)]),
        (["--name", "potted plant"], [("potted plant", 7.5, 2.5)]),
        (["--id", "1"], [("chair", 9.5, 4.5)]),
        (["--value", "2"], [("potted plant", 7.5, 2.5)]),
        (["--name", "chair", "--nearest"], [("chair", 9.5, 0.5)]),
        (["--name", "chair", "--nearest", "--from", "9,6"], [("chair", 9.5, 4.5)]),
        (["--name", "chair", "-k", "5", "--from", "9,6"],
         [("chair", 9.5, 4.5), ("chair", 9.5, 0.5)]),
        (["--name", "chair", "--in", "9,4,10,5"], [("chair", 9.5, 4.5)]),
        (["--name", "chair", "--in", "4,0,5,1", "--frame", "room"], [("chair", 9.5, 4.5)]),
        (["--name", "chair", "--near", "potted plant", "--within", "1.5"],
         [("chair", 9.5, 0.5), ("chair", 9.5, 4.5)]),
        (["--name", "chair", "--near", "potted plant", "--within", "1"], []),
        (["--near", "7.5,2.5", "--within", "0.1"], [("potted plant", 7.5, 2.5)]),
        (["--name", "chair", "--inside", "9,0,10,2"], [("chair", 9.5, 0.5)]),
        (["--inside", "POLYGON((7 2, 8 2, 8 3, 7 3, 7 2))"], [("potted plant", 7.5, 2.5)]),
        (["--in", "9.1,0.1 9.9,0.1 9.5,0.9", "--layer", "semantic"], [("chair", 9.5, 0.5)]),
        (["--name", "Occupied", "--layer", "occupancy", "--nearest", "--from", "2.6,0"],
         [("Occupied", 2.75, 2.75)]),
        (["--name", "unicorn"], []),
        (["--name", "chair", "--name", "potted plant"],
         [("chair", 9.5, 0.5), ("chair", 9.5, 4.5), ("potted plant", 7.5, 2.5)]),
        (["--name", "potted plant", "--name", "chair", "--nearest", "--from", "9,6"],
         [("chair", 9.5, 4.5)]),
    ],
)  # fmt: skip
def test_the_map_answers(hypermap, room_map, arguments, expected):
    assert places(hypermap("query", room_map, *arguments, "--json")) == expected


def test_every_layer_answers_at_a_point(hypermap, room_map):
    result = hypermap("query", room_map, "--at", "9.5,4.5", "--json")
    assert result.json == {
        "map": str(room_map),
        "frame_id": "map",
        "answers": [
            {"layer": "occupancy", "label": "Free", "value": 0, "x": 9.5, "y": 4.5},
            {"layer": "semantic", "label": "chair", "value": 1, "x": 9.5, "y": 4.5},
        ],
    }
    asked_in_room = hypermap("query", room_map, "--at", "4.5,0.5", "--frame", "room", "--json")
    assert [row["label"] for row in asked_in_room.json["answers"]] == ["Free", "chair"]


@pytest.mark.parametrize("corners", ["0,0 1e30,0 1e30,1e30", "1e30,2e30 1e30,1e30 0,0 2e30,-2e30"])
def test_areas_may_reach_very_far(hypermap, room_map, corners):
    asked = hypermap("query", room_map, "--in", corners, "--layer", "semantic", "--json")
    assert [row["value"] for row in asked.json["answers"]] == [0, 1, 2]


def test_all_objects_at_a_point_are_listed_the_smallest_first(hypermap, tmp_path):
    things = [("table", shapely.box(0, 0, 2, 1)), ("cup", shapely.box(1, 0, 1.1, 0.1))]
    layer = SemanticLayer("semantic", "map", [SemanticObject(*thing) for thing in things])
    save_map(Hypermap([layer]), tmp_path / "desk.hmap")
    asked = hypermap("query", tmp_path / "desk.hmap", "--at", "1.05,0.05", "--json")
    assert [(row["label"], row["value"]) for row in asked.json["answers"]] == [
        ("cup", 1),
        ("table", 0),
    ]


def test_zero_has_no_sign(hypermap, tmp_path):
    layer = SemanticLayer("semantic", "map", [square("cup", -1e-9, -0.0)])
    save_map(Hypermap([layer]), tmp_path / "a.hmap")
    answer = hypermap("query", tmp_path / "a.hmap", "--name", "cup").out
    assert answer.split()[-5:] == ["semantic", "cup", "0", "0.000", "0.000"]


def test_layers_without_a_place_do_not_keep_others_from_answering(hypermap, tmp_path):
    cups = [SemanticObject("cup", shapely.box(0, 0, 1, 1))]
    layers = [SemanticLayer("here", "map", cups), SemanticLayer("away", "moon", cups)]
    save_map(Hypermap(layers), tmp_path / "two.hmap")
    for question in (["--name", "cup"], ["--at", "0.5,0.5"], ["--in", "0,0,1,1"]):
        asked = hypermap("query", tmp_path / "two.hmap", *question, "--json")
        assert [row["layer"] for row in asked.json["answers"]] == ["here"]
        assert "layer 'away' is left out: no transform has the frame" in asked.err
    refused = hypermap("query", tmp_path / "two.hmap", "--name", "cup", "--layer", "away")
    assert_one_error(refused, "no transform has the frame")


def test_an_object_is_described_in_full(hypermap, room_map):
    [row] = hypermap("query", room_map, "--id", "1", "--json").json["answers"]
    assert row["object"] == {
        "id": 1,
        "name": "chair",
        "footprint": "POLYGON ((10 5, 9 5, 9 4, 10 4, 10 5))",
        "tags": [],
        "confidence": [],
        "existence": 3.5,
        "first_seen": None,
        "last_seen": None,
        "attributes": {"z_max": 0.9},
    }


def test_the_distance_is_that_to_the_shape(hypermap, room_map):
    [row] = hypermap("query", room_map, "--name", "chair", "--nearest", "--json").json["answers"]
    assert row["distance"] == pytest.approx(9.0)


def test_an_area_lists_objects_and_counts_cells(hypermap, room_map):
    result = hypermap("query", room_map, "--in", "2.5,2.5,8,3.5")
    assert result.code == 0
    assert "potted plant" in result.out
    assert "occupancy: 11 Occupied" in result.out
    assert "occupancy: 11 Free" in result.out
    rows = hypermap("query", room_map, "--in", "2.5,2.5,8,3.5", "--json").json["answers"]
    assert [row["layer"] for row in rows].count("occupancy") == 22


def test_of_very_many_cells_json_has_their_number(hypermap, room_map, monkeypatch):
    monkeypatch.setattr(cells, "MOST_LISTED", 21)
    area = room_map, "--in", "2.5,2.5,8,3.5"
    assert "occupancy: 11 Occupied" in hypermap("query", *area).out
    rows = hypermap("query", *area, "--json").json["answers"]
    (plant,) = (row for row in rows if row["layer"] == "semantic")
    assert plant["label"] == "potted plant"
    found = {row["label"]: row["cells"] for row in rows if row["layer"] == "occupancy"}
    assert found == {"Free": 11, "Occupied": 11}
    for row in rows:
        at = hypermap("query", room_map, "--at", f"{row['x']},{row['y']}").out
        assert row["label"] in at
    free = room_map, "--name", "Free"
    number = len(hypermap("query", *free, "--nearest", "-k", "1000", "--json").json["answers"])
    (row,) = hypermap("query", *free, "--json").json["answers"]
    assert (row["label"], row["cells"]) == ("Free", number)
    assert hypermap("query", *free).out == f"occupancy: {number} Free\n"


@pytest.mark.parametrize(
    ("shell", "words", "offered"),
    [
        ("bash", ["--name", "pot"], ["potted\\ plant"]),
        ("bash", ["--nearest", "--name", "cha"], ["chair"]),
        ("bash", ["--layer", "s"], ["semantic"]),
        ("bash", ["--by", ""], ["air", "path"]),
        ("bash", ["--at", ""], [""]),
        ("fish", ["--name", "pot"], ["potted plant"]),
    ],
)
def test_the_tab_key_of_the_users_shell_offers_what_the_map_has(
    hypermap, room_map, monkeypatch, shell, words, offered
):
    line = ["hypermap", "query", str(room_map), *words]
    monkeypatch.setenv("_HYPERMAP_COMPLETE", f"complete_{shell}")
    monkeypatch.setenv("COMP_WORDS", "\n".join(line))
    monkeypatch.setenv("COMP_CWORD", str(len(line) - 1))
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", " ".join(line))
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
    assert hypermap().out.rstrip("\n").split("\n") == offered


def test_the_tab_key_offers_nothing_of_a_map_that_cannot_be_read(hypermap, tmp_path, monkeypatch):
    (tmp_path / "bad.hmap").write_bytes(b"no zip")
    monkeypatch.setenv("_HYPERMAP_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_CWORD", "4")
    for name in ("bad.hmap", "none.hmap"):
        words = ["hypermap", "query", str(tmp_path / name), "--name", "c"]
        monkeypatch.setenv("COMP_WORDS", "\n".join(words))
        done = hypermap()
        assert (done.out.strip(), done.err) == ("", "")


def test_from_where_the_nearest_is_measured_is_said(hypermap, room_map):
    result = hypermap("query", room_map, "--name", "chair", "--nearest")
    assert "9.000" in result.out
    assert result.err == "measured from (0, 0); give --from X,Y to measure from elsewhere\n"
    assert hypermap("query", room_map, "--name", "chair", "--nearest", "--from", "0,0").err == ""


def test_an_empty_answer_is_no_error_and_hints_at_the_nearest_name(hypermap, room_map):
    result = hypermap("query", room_map, "--name", "chiar")
    assert (result.code, result.out) == (0, "")
    assert result.err == "nothing found; no object is called 'chiar'; did you mean 'chair'?\n"
    result = hypermap("query", room_map, "--name", "chair", "--in", "0,0,1,1")
    assert result.err == "nothing found\n"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([], "there is no query; give --at X,Y, --in AREA or --name NAME"),
        (["--at", "1"], "--at '1': a point is X,Y"),
        (["--at", "1,2", "--name", "chair"], "--at queries a point"),
        (["--in", "1,2,3"], "--in '1,2,3': an area is a rectangle"),
        (["--name", "chair", "--id", "1"], "give either --name or --value, not both"),
        (["--nearest", "--in", "0,0,1,1"], "the nearest what? give --name NAME"),
        (["--name", "chair", "--nearest", "--near", "sink"], "give either --nearest"),
        (["--name", "chair", "--within", "1"], "--within needs --near"),
        (["--name", "chair", "--layer", "rooms"], "the map has no rooms"),
        (["--name", "chair", "--layer", "semantics"], "did you mean 'semantic'?"),
        (["--near", "chair", "--layer", "occupancy"], "'occupancy' has none"),
        (["--at", "1,2", "--frame", "rom"], "did you mean 'room'?"),
        (["--in", "0,0,1,1", "--frame", "moon"], "frame 'moon' is unknown to the map"),
        (["--inside", "POLYGON((1 2"], "this is not WKT"),
    ],
)
def test_a_question_without_meaning_is_said_so(hypermap, room_map, arguments, reason):
    assert_one_error(hypermap("query", room_map, *arguments), reason)


# The facts that the maps' README gives, worked out independently.


@pytest.fixture
def lab(shared_data):
    return shared_data / "maps" / "lab.hmap"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--name", "sink"], [("sink", 3.259, 2.378)]),
        (["--name", "chair", "--in", "1,2,2,3"], [("chair", 1.429, 2.887)]),
        (["--at", "3,-2", "--layer", "semantic"], [("table", 3.0, -2.0)]),
    ],
)
def test_the_lab_answers_as_worked_out(hypermap, lab, arguments, expected):
    assert places(hypermap("query", lab, *arguments, "--json")) == expected


def test_the_labs_square_holds_three_things(hypermap, lab):
    found = hypermap("query", lab, "--in", "2,-2,3,-1", "--layer", "semantic", "--json")
    assert sorted(label for label, _, _ in places(found)) == ["chair", "table", "tvmonitor"]


def test_the_labs_occupied_cells_are_all_found(hypermap, lab):
    found = hypermap("query", lab, "--name", "Occupied", "--json")
    assert len(found.json["answers"]) == 954
    assert "and 904 more; --json lists all" in hypermap("query", lab, "--name", "Occupied").err


def test_nested_objects_are_distinguished_by_their_middles(hypermap, tmp_path):
    content = "- {name: table, shape: 'POLYGON((0 0, 9 0, 9 4, 0 4))'}\n"
    content += "- {name: table, shape: 'POLYGON((1 1, 3 1, 3 3, 1 3))'}\n"
    content += "- {name: '2', shape: 'POLYGON((20 0, 21 0, 21 1, 20 1))'}\n"
    (tmp_path / "objects.yaml").write_text(content)
    made = tmp_path / "x.hmap"
    assert hypermap("convert", tmp_path / "objects.yaml", made).code == 0
    nearest = hypermap("query", made, "--name", "table", "--nearest", "--from", "2,2", "--json")
    assert [row["value"] for row in nearest.json["answers"]] == [1]
    near = hypermap("query", made, "--name", "table", "--near", "2", "--within", "12", "--json")
    assert [row["value"] for row in near.json["answers"]] == [0]


def test_a_layer_in_a_lost_frame_does_not_keep_others_from_answering(hypermap, tmp_path):
    (tmp_path / "near").write_text("- {name: cup, shape: 'POLYGON((0 0, 1 0, 1 1))'}")
    (tmp_path / "far").write_text("- {name: cup, shape: 'POLYGON((0 0, 1 0, 1 1))'}")
    (tmp_path / "hmap_config.yaml").write_text(
        "layers:\n"
        "- {class: SemanticLayer, name: near, frame_id: map, load_file: true, file: near}\n"
        "- {class: SemanticLayer, name: far, frame_id: lab, load_file: true, file: far}\n"
    )
    asked = hypermap("query", tmp_path, "--name", "cup")
    assert asked.code == 0
    assert "layer 'far' is left out: no transform has the frame 'lab'" in asked.err
    assert_one_error(hypermap("query", tmp_path, "--name", "cup", "--layer", "far"), "'lab'")
    answer = hypermap("query", tmp_path, "--name", "cup", "--layer", "near", "--json")
    assert len(answer.json["answers"]) == 1
    both = hypermap("query", tmp_path, "--name", "cup", "--layer", "near", "--layer", "near")
    assert both.out.count("cup") == 1


def test_several_layers_may_be_asked(hypermap, tmp_path):
    cup = SemanticObject("cup", shapely.box(0, 0, 1, 1))
    layers = [SemanticLayer(name, "map", [cup]) for name in ("a", "b", "c")]
    save_map(Hypermap(layers), tmp_path / "three.hmap")
    asked = ("query", tmp_path / "three.hmap", "--name", "cup", "--layer", "c", "--layer", "a")
    for more in ((), ("--near", "3,0"), ("--nearest",)):
        answer = hypermap(*asked, *more, "--json").json["answers"]
        assert {row["layer"] for row in answer} == ({"a", "c"} if more != ("--nearest",) else {"a"})
