"""`hypermap ask`: from a question in English to what is printed."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import shapely

from hypermap import Hypermap, SemanticLayer, SemanticObject, save_map

from .conftest import Result, assert_one_error

Run = Callable[..., Result]


def test_it_shows_how_it_understood_the_question_and_answers(hypermap: Run, room_map: Path) -> None:
    result = hypermap("ask", room_map, "which chairs are within 1.5 m of a plant?")
    assert (result.code, result.err) == (
        0,
        "asked: which objects\nwhat: chair\nwhere: within 1.5 m of plant\n",
    )
    # The layer lies at (10, 0), turned by 90 degrees.
    assert result.out == "chair 0 at (9.50, 0.50)\nchair 1 at (9.50, 4.50)\n"


def test_an_area_may_reach_very_far_and_is_not_spelled_out(hypermap: Run, room_map: Path) -> None:
    area = {"area": "POLYGON ((9 0, 1e30 0, 1e30 1e30, 9 1e30, 9 0))"}
    query = {"names": ["chair"], "where": [{"relation": "in", "what": area}]}
    result = hypermap("ask", room_map, json.dumps(query))
    assert result.err == "asked: which objects\nwhat: chair\nwhere: in the given area\n"
    assert result.out == "chair 0 at (9.50, 0.50)\nchair 1 at (9.50, 4.50)\n"


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("how many seats are there", "2\n"),
        ("is there a plant", "yes\npotted plant 2 at (7.50, 2.50)\n"),
        ("is there a sofa", "no\nthere is no sofa in the map; similar: chair\n"),
        ("where is the nearest chair", "chair 0 at (9.50, 0.50), 8.00 m away\n"),
        ("what is at 9.5,0.5", "chair 0 at (9.50, 0.50)\n"),
        ('{"names": ["furniture"], "which": "surest"}', "chair 1 at (9.50, 4.50)\n"),
    ],
)
def test_answers(hypermap: Run, room_map: Path, question: str, answer: str) -> None:
    result = hypermap("ask", room_map, question, "--pose", "1,0.5")
    assert (result.code, result.out) == (0, answer)


def test_a_point_may_be_negative(hypermap: Run, room_map: Path) -> None:
    result = hypermap("ask", room_map, "how far is the plant", "--pose", "-2.5,2.5")
    assert result.out == "potted plant 2 at (7.50, 2.50), 9.50 m away\n"


@pytest.mark.xdist_group("json_schema")  # whose library takes a second to import
def test_json_is_for_programs(hypermap: Run, room_map: Path, json_validator: Any) -> None:
    answer = hypermap("ask", room_map, "which is the closest chair to the plant", "--json").json
    assert answer["query"] == {
        "names": ["chair"],
        "which": "nearest",
        "start": {"names": ["plant"]},
    }
    (found,) = answer["objects"]
    assert (found["id"], found["name"], found["layer"]) == (0, "chair", "semantic")
    assert found["distance"] == pytest.approx(2**0.5)
    again = hypermap("ask", room_map, json.dumps(answer["query"]), "--json").json
    assert again == answer
    schema = hypermap("ask", "--schema").json
    json_validator.check_schema(schema)
    json_validator(schema).validate(answer["query"])


def test_more_names_come_from_a_file(hypermap: Run, room_map: Path, tmp_path: Path) -> None:
    file = tmp_path / "ours.yaml"
    file.write_text("greenery: {also: [potted plant, plant]}\n")
    result = hypermap("ask", room_map, "how much greenery is there", "--taxonomy", file)
    assert result.out == "1\n"


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("where is the zorblax", ["cannot read 'zorblax'"]),
        ("where is the chiar", ["did you mean 'chair'?"]),
        ("where is the nearest chair", ["depends on where you are", "--pose X,Y"]),
        ("what is in the kitchen", ["the map has no rooms", "`hypermap rooms MAP -o OUT`"]),
        ("where is a cup\x00\x1b[2J", ["cannot read"]),
        ("cup" * 40_000, ["at most 500 characters"]),
        ("{", ["the query is not JSON"]),
    ],
)
def test_what_cannot_be_answered_is_one_error(
    hypermap: Run, room_map: Path, question: str, words: list[str]
) -> None:
    result = hypermap("ask", room_map, question, "-q")
    assert_one_error(result, *words)
    assert "\x1b" not in result.err


def test_what_was_not_understood_names_questions_that_are(hypermap: Run, room_map: Path) -> None:
    result = hypermap("ask", room_map, "how far is the printer by teleportation")
    assert result.code == 2
    assert "you can ask: how far is the printer from the door?" in result.err


@pytest.mark.parametrize("start", ["1", "1,2,3,4", "a,b", "1,nan"])
def test_a_wrong_pose_is_refused(hypermap: Run, room_map: Path, start: str) -> None:
    result = hypermap("ask", room_map, "where is the nearest chair", "--pose", start)
    assert_one_error(result, "expected X,Y or X,Y,YAW, as 1.5,-2,90")


def test_the_name_of_a_room_gives_an_answer_no_line_of_its_own(
    hypermap: Run, tmp_path: Path
) -> None:
    office = SemanticObject("office\nhall is 0.00 m away", shapely.box(0, 0, 5, 5))
    save_map(Hypermap([SemanticLayer("rooms", "map", [office])]), tmp_path / "rooms.hmap")
    result = hypermap("ask", tmp_path / "rooms.hmap", "which room is nearest to (-3, 0)?")
    assert result.out.splitlines()[1] == "office hall is 0.00 m away is 3.00 m away"


def test_the_nearest_cup_and_its_room(hypermap: Run, tmp_path: Path) -> None:
    cups = [SemanticObject("cup", shapely.Point(x, 1).buffer(0.04)) for x in (1, 4)]
    rooms = [SemanticObject("office", shapely.box(0, 0, 5, 5))]
    layers = [SemanticLayer("semantic", "map", cups), SemanticLayer("rooms", "map", rooms)]
    save_map(Hypermap(layers), tmp_path / "office.hmap")
    question = "where is the nearest cup, and in which room?"
    result = hypermap("ask", tmp_path / "office.hmap", question, "--pose", "5,1")
    (answer,) = (line for line in result.out.splitlines() if line.startswith("cup"))
    assert answer.startswith("cup 1 at (4.00, 1.00), 0.96 m away: office (id 0) at ")


def test_the_shell_asks_the_same(hypermap: Run, room_map: Path) -> None:
    lines = "ask what's the nearest chair to the plant?\nask --pose 0,0.5 how far is chair 1\nask\n"
    result = hypermap("shell", room_map, stdin=lines)
    assert "which: the nearest to plant\nchair 0 at (9.50, 0.50), 1.41 m away\n" in result.out
    assert "chair 1 at (9.50, 4.50), 9.66 m away" in result.out
    assert "usage: ask [--pose X,Y[,YAW]] QUESTION" in result.err


def test_a_model_needs_an_address(hypermap: Run, room_map: Path, monkeypatch: Any) -> None:
    monkeypatch.delenv("HYPERMAP_MODEL_URL", raising=False)
    ask = ["ask", room_map, "I could do with a coffee", "--model", "m"]
    assert_one_error(hypermap(*ask), "--model needs --model-url")
    assert_one_error(hypermap(*ask, "--model-url", "ftp://a/b"), "not the address of a model")


def test_a_model_that_is_away_is_an_error(hypermap: Run, room_map: Path, monkeypatch: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        url = f"http://127.0.0.1:{closed.getsockname()[1]}/v1"
    monkeypatch.setenv("HYPERMAP_MODEL_URL", url)
    result = hypermap("ask", room_map, "I could do with a coffee", "--model", "m")
    assert_one_error(result, url, "does not answer")
    assert hypermap("ask", room_map, "is there a plant?", "--model", "m").code == 0
