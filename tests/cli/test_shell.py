from __future__ import annotations

import subprocess

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document
from prompt_toolkit.history import InMemoryHistory
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

from hypermap.cli.shell import command
from hypermap.console.commands import Console
from hypermap.console.completion import ConsoleCompleter
from hypermap.console.prompt import history
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.testing import square

from ..prepared import Command
from .conftest import INTRINSICS, assert_one_error


def test_lines_from_standard_input_are_answered_until_its_end(hypermap, room_map):
    result = hypermap("shell", room_map, stdin='getLayerCount\n\ngetCoords semantic "potted plant"')
    assert (result.code, result.out, result.err) == (0, "2\n7.500 2.500\n", "")


def test_lines_come_through_a_pipe(room_map):
    with Command("shell", room_map, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as shell:
        shell.stdin.write("getLayerCount\nfly\ngetLayerCount")
        assert shell.communicate(240)[0] == "2\n2\n"
    assert shell.returncode == 2


@pytest.mark.parametrize("word", ["exit", "quit"])
def test_exit_and_quit_end_before_the_end_of_input(hypermap, room_map, word):
    result = hypermap("shell", room_map, stdin=f"getLayerCount\n{word}\nfly\n")
    assert (result.code, result.out, result.err) == (0, "2\n", "")


def test_a_line_that_fails_does_not_stop_the_others(hypermap, room_map, tmp_path):
    lines = ["fly", f"load {tmp_path / 'nowhere.hmap'}", f"load {tmp_path}", "getLayerCount"]
    result = hypermap("shell", room_map, stdin="\n".join(lines))
    assert (result.code, result.out) == (2, "2\n")
    errors = result.err.splitlines()
    assert len(errors) == 3
    assert all(line.startswith("hypermap: error: ") for line in errors)


def test_the_shell_starts_without_a_map(hypermap, room_map):
    result = hypermap("shell", stdin=f"getLayerCount\nload {room_map}\ngetLayerCount\n")
    assert result.out == f"0\nloaded 2 layers from {room_map}\n2\n"


def test_a_map_that_cannot_be_opened_ends_the_shell(hypermap, tmp_path):
    assert_one_error(hypermap("shell", tmp_path / "nowhere.hmap"), "nowhere.hmap")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("getC", ["getCoords", "getCoordsArea"]),
        ("getCoords s", ["semantic"]),
        ("getString ", ["occupancy", "semantic"]),
        ("getCoords semantic ", ["chair", '"potted plant"']),
        ("getCoords semantic p", ['"potted plant"']),
        ("getCoords occupancy F", ["Free"]),
        ("getCoords nowhere ", []),
        ("getString semantic ", []),
        ("fly ", []),
        ("exit ", []),
        ("que", ["query"]),
        ("help getC", ["getCoords", "getCoordsArea"]),
        ("query --nea", ["--nearest", "--near"]),
        ("query --name chair --na", ["--name"]),
        ("query --name chair --ev", ["--evidence"]),
        ("query --name chair --json --j", []),
        ("query --near chair --nea", ["--nearest"]),
        ("query --name c", ["chair"]),
        ('query --near "po', ['"potted plant"']),
        ('query --near "potted plant" --wi', ["--within", "--with"]),
        ("query --name Occ", ["Occupied"]),
        ("query --near Occ", []),
        ("query --inside ", ["chair", '"potted plant"']),
        ("query --layer s", ["semantic"]),
        ("query --frame r", ["room"]),
        ("query --within ", []),
        ('getCoords semantic "pot', ['"potted plant"']),
        ("query \\", []),
    ],
)
def test_the_tab_key_offers_what_belongs_there(room_map, text, expected):
    completer = ConsoleCompleter(Console(open_map(room_map)))
    found = completer.get_completions(Document(text), CompleteEvent())
    assert [completion.text for completion in found] == expected


def test_the_tab_key_offers_files(room_map):
    completer = ConsoleCompleter(Console())
    document = Document(f"load {room_map.parent}/ro")
    assert [c.text for c in completer.get_completions(document, CompleteEvent())] == ["om.hmap"]


def test_what_is_typed_at_a_terminal_is_answered_and_remembered(
    capsys, monkeypatch, room_map, tmp_path
):
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        # Ctrl-C drops a line, and Ctrl-D ends.
        keys.send_text('fly\x03getLayerCount\rgetCoords semantic "potted plant"\r\x04')
        command(room_map)
    assert capsys.readouterr().out.splitlines()[1:] == ["2", "7.500 2.500"]
    history = (tmp_path / "state" / "hypermap" / "history").read_text()
    assert '+getCoords semantic "potted plant"' in history


def test_the_shell_works_where_no_history_can_be_kept(monkeypatch, tmp_path):
    (tmp_path / "state").write_text("a file in place of the folder")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    assert isinstance(history(), InMemoryHistory)


def test_save_writes_archives_alone(hypermap, room_map, tmp_path):
    (tmp_path / "occupancy.png").write_text("precious")
    result = hypermap(
        "shell", room_map, stdin=f"save {tmp_path}/new.yaml\nload ~nobody-here/x.hmap\n"
    )
    assert result.code == 2
    assert "save writes an archive; give a name that ends in .hmap" in result.err
    assert "there is no such file" in result.err
    assert (tmp_path / "occupancy.png").read_text() == "precious"


QUESTIONS = [
    ["--at", "9.5,4.5"],
    ["--in", "2.5,2.5,8,3.5"],
    ["--name", "chair", "--name", "potted plant"],
    ["--name", "chair", "-k", "2", "--from", "9,6"],
    ["--name", "chair", "--nearest"],
    ["--name", "chair", "--near", "potted plant", "--within", "3"],
    ["--inside", "0,0,9,9"],
    ["--at", "4.5,0.5", "--frame", "room", "--layer", "semantic"],
    ["--id", "1"],
    ["--name", "chiar"],
]


def words(text: str) -> list[str]:
    return [word for word in text.split() if set(word) != {"─"}]


@pytest.mark.parametrize("question", QUESTIONS, ids=" ".join)
def test_the_shell_answers_as_query_does(hypermap, room_map, question):
    asked = hypermap("query", room_map, *question)
    line = " ".join(f'"{word}"' for word in ["query", *question])
    result = hypermap("shell", room_map, stdin=line)
    assert (asked.code, result.code, result.err) == (0, 0, "")
    assert sorted(words(result.out)) == sorted(words(asked.out + asked.err))


@pytest.mark.parametrize("question", QUESTIONS, ids=" ".join)
def test_the_shell_gives_programs_the_same_json(hypermap, room_map, question):
    asked = hypermap("query", room_map, *question, "--json")
    line = " ".join(f'"{word}"' for word in ["query", *question, "--json"])
    assert hypermap("shell", room_map, stdin=line).json == asked.json


def test_the_shell_looks_behind_objects_as_query_does(hypermap, drive, tmp_path):
    made, drawn = tmp_path / "made.hmap", tmp_path / "drawn.hmap"
    assert hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", made).code == 0
    save_map(Hypermap([SemanticLayer("semantic", "map", [square("chair", 0, 0)])]), drawn)
    for path, expected in [
        (made, "votes (made the map)"),
        (drawn, "This map contains no evidence."),
    ]:
        question = ["--name", "chair", "--evidence"]
        asked = hypermap("query", path, *question)
        as_json = hypermap("query", path, *question, "--json")
        line = " ".join(["query", *question])
        result = hypermap("shell", path, stdin=line)
        assert (result.code, result.err) == (0, "")
        assert expected in result.out
        assert words(result.out) == words(asked.out)
        assert hypermap("shell", path, stdin=f"{line} --json").json == as_json.json
    result = hypermap("shell", drawn, stdin="query --at 0,0 --evidence")
    assert (result.code, result.out) == (2, "")
    assert "--evidence shows the observations" in result.err


def test_the_old_commands_and_the_new_one_stand_side_by_side(hypermap, room_map):
    lines = "getLayerCount\nquery --name chair --nearest --from 9,6\ngetCoords semantic chair\n"
    result = hypermap("shell", room_map, stdin=lines + "query --nam chair\n")
    assert result.code == 2
    assert result.out.startswith("2\nlayer")
    assert result.out.endswith("9.500 0.500\n9.500 4.500\n")
    assert "did you mean '--name'?" in result.err
