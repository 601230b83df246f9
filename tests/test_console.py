from __future__ import annotations

from pathlib import Path

import pytest

from hypermap.console import COMMANDS, Console, Leave, split
from hypermap.core.errors import HypermapError
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
        ("getStrings semantic 0 0 2 2 2 0 0 2", "the corners do not bound an area, or"),
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


def test_exit_leaves(lab):
    with pytest.raises(Leave):
        lab.run("exit")


def test_republish_is_what_the_owner_of_the_console_makes_of_it():
    assert Console(republish=lambda: "sent").run("republish") == "sent"
