from __future__ import annotations

import json
from pathlib import Path

import pytest
import shapely

from hypermap.console.commands import COMMANDS, Console, Leave, split
from hypermap.console.options import OPTIONS
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map


@pytest.fixture
def lab(shared_data: Path) -> Console:
    return Console(open_map(shared_data / "maps" / "lab.hmap"))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", []),
        ("   ", []),
        ("getLayerCount\n", ["getLayerCount"]),
        ("load  a.hmap ", ["load", "a.hmap"]),
        ('getCoords semantic "potted plant"', ["getCoords", "semantic", "potted plant"]),
        (r"load my\ map.hmap", ["load", "my map.hmap"]),
        (r'load "a \"big\" map"', ["load", 'a "big" map']),
        (r"load C:\\maps", ["load", r"C:\maps"]),
        ("getCoords semantic it's", ["getCoords", "semantic", "it's"]),
        ("getCoords semantic #1", ["getCoords", "semantic", "#1"]),
    ],
)
def test_a_line_is_split_at_blanks_outside_of_double_quotes(line, words):
    assert split(line) == words


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("", ""),
        ("getLayerCount", "2"),
        ("getString semantic 3 -2", "table"),
        ("getString semantic 100 100", "Empty"),
        ("getString occupancy 1000 0", "Unknown"),
        ("getCoords semantic sink", "3.259 2.378"),
        ("getCoords semantic unicorn", ""),
        ("getCoordsArea semantic chair 1 2 2 2 2 3 1 3", "1.429 2.887"),
        ("republish", "nothing is published here"),
    ],
)
def test_the_map_answers_line_by_line(lab, line, answer):
    assert lab.run(line) == answer


def test_all_that_an_area_holds_is_listed_with_its_place(lab):
    lines = lab.run("getStrings semantic 2 -2 3 -2 3 -1 2 -1").splitlines()
    assert sorted(line.split()[2] for line in lines) == ["chair", "table", "tvmonitor"]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("fly", "unknown command 'fly'; known: help, load, loadConfig, save, getString,"),
        ("getCoord semantic chair", "unknown command 'getCoord'; did you mean 'getCoords'?"),
        ("getString semantic 1", "usage: getString LAYER X Y"),
        ("getStrings semantic 1 2 3", "usage: getStrings LAYER X Y X Y X Y ..."),
        ("getStrings semantic 1 2 3 4 5 6 7", "usage: getStrings LAYER X Y X Y X Y ..."),
        ("getString semantics 1 2", "there is no layer 'semantics'; did you mean 'semantic'?"),
        ("getString semantic 1 two", "'two' is not a number"),
        ("getString semantic nan 2", "'nan' is not a finite number"),
        ("getStrings semantic 0 0 2 2 2 0 0 2", "the corners do not enclose an area, or"),
        ('load "a b', "no closing quotation in: load"),
        ("load nowhere.hmap", "nowhere.hmap"),
        ("exit now", "usage: exit"),
    ],
)
def test_a_bad_line_says_what_is_wrong_and_leaves_the_map(lab, line, reason):
    before = lab.hypermap
    with pytest.raises(HypermapError) as error:
        lab.run(line)
    assert reason in str(error.value)
    assert lab.hypermap is before


def test_a_map_is_saved_cleared_and_loaded_again(lab, tmp_path):
    file = tmp_path / "my lab.hmap"
    lab.run(f'save "{file}"')
    lab.run("clear")
    assert lab.run("getLayerCount") == "0"
    lab.run(f'load "{file}"')
    assert lab.run("getCoords semantic sink") == "3.259 2.378"


def test_help_names_every_command(lab):
    text = lab.run("help")
    for name in COMMANDS:
        assert f"\n{name}" in f"\n{text}"


@pytest.mark.parametrize("word", ["exit", "quit"])
def test_exit_and_quit_leave(lab, word):
    assert f"\n{word}  " in lab.run("help")
    with pytest.raises(Leave):
        lab.run(word)


def test_evidence_is_refused_where_no_one_tells_it(lab):
    with pytest.raises(HypermapError, match="--evidence is for `hypermap query`"):
        lab.run("query --name sink --evidence")


def test_json_says_where_the_map_comes_from(lab, tmp_path):
    asked = "query --name sink --json"
    assert json.loads(lab.run(asked))["map"] is None
    lab.run(f"save {tmp_path / 'lab.hmap'}")
    lab.run(f"load {tmp_path / 'lab.hmap'}")
    answer = json.loads(lab.run(asked))
    assert (answer["map"], answer["frame_id"]) == (str(tmp_path / "lab.hmap"), "map")
    assert [row["value"] for row in answer["answers"]] == [14]
    lab.run("clear")
    assert json.loads(lab.run(asked)) == {"map": None, "frame_id": "map", "answers": []}


def test_automap_is_what_the_owner_of_the_console_makes_of_it():
    assert Console(automap=lambda: "waiting").run("automap") == "waiting"
    assert Console().run("automap") == "automap is for the console of `hypermap serve`"


def test_republish_is_what_the_owner_of_the_console_makes_of_it():
    assert Console(republish=lambda: "sent").run("republish") == "sent"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("query --name sink", "semantic sink 14 3.259 2.378"),
        ("query --name=sink", "semantic sink 14 3.259 2.378"),
        ("query --name chair --in 1,2,2,3", "semantic chair 26 1.429 2.887"),
        ("query --at 3,-2 --layer semantic", "semantic table 9 3.000 -2.000"),
        ("query --name chair --name mouse --near table --within 0", "chair 0 2.350 0.315 0.000"),
        ("query --name chair --nearest", "measured from (0, 0); give --from X,Y"),
        ("query --name chiar", "nothing found; no object is called 'chiar'; did you mean 'chair'?"),
    ],
)
def test_the_questions_of_query_are_answered(lab, line, answer):
    said = [" ".join(text.split()) for text in lab.run(line).splitlines()]
    assert any(answer in text for text in said), said


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("query", "there is no query; give --at X,Y, --in AREA or --name NAME"),
        ("query --nam chair", "a query has no option '--nam'; did you mean '--name'?"),
        ("query chair", "a query has no option 'chair'; known: --at, --in, --name"),
        ("query --name", "--name needs a value: --name NAME"),
        ("query --name chair --nearest=2", "--nearest takes no value"),
        ("query --name chair --json=yes", "--json takes no value"),
        ("query --name chair -k 0", "-k 0: expected at least 1"),
        ("query --name chair -k two", "-k 'two': expected a whole number"),
        ("query --name chair --near sink --within inf", "--within inf: expected a finite number"),
        ("query --name chair --near sink --within -1", "--within -1: expected at least 0"),
        ("query --id seven", "--value 'seven': expected a number"),
        ("query --at 1", "--at '1': a point is X,Y in meters"),
        ("query --name chair --id 1", "give either --name or --value, not both"),
        ("query --name chair --layer rooms", "the map has no rooms"),
        ("help fly", "unknown command 'fly'"),
        ("help query now", "usage: help [COMMAND]"),
    ],
)
def test_a_bad_question_says_what_is_wrong(lab, line, reason):
    with pytest.raises(HypermapError) as error:
        lab.run(line)
    assert str(error.value).startswith(reason)


def test_help_teaches_how_to_ask_and_its_examples_are_answered(lab):
    text = lab.run("help query")
    for option in OPTIONS:
        assert f" {option} " in text
    examples = [line.strip() for line in text.partition("Examples:")[2].splitlines() if line]
    assert len(examples) >= 3
    for example in examples:
        assert lab.run(example)
    assert lab.run("help getString") == "getString LAYER X Y: what is at a point"


def test_many_rows_are_cut_and_cells_of_an_area_are_counted(lab):
    lines = lab.run("query --name Occupied").splitlines()
    assert len(lines) == 52
    assert lines[-1] == "and 904 more; --json lists all"
    assert "occupancy: 51 Occupied" in lab.run("query --in 0,0,3,3").splitlines()


def test_names_of_any_kind_stay_within_their_row():
    cup = SemanticObject("a\ncup\x1b[31m", shapely.box(0, 0, 1, 1))
    console = Console(Hypermap([SemanticLayer("semantic", "map", [cup])]))
    head, row = console.run("query --in 0,0,1,1").splitlines()
    assert row.split() == ["semantic", "a", "cup", "[31m", "0", "0.500", "0.500"]
    assert head.index("value") + len("value") == row.index(" 0 ") + 2
