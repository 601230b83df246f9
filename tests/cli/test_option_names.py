"""An option means the same in every command that has it."""

from __future__ import annotations

import collections
import importlib
import inspect
from collections.abc import Iterator
from types import NoneType
from typing import Annotated, Any, get_args, get_origin

import pytest
from typer.models import OptionInfo

from hypermap.cli.main import _MODULES
from hypermap.cli.renamed import RENAMED
from hypermap.formats import open_map

from .conftest import INTRINSICS

# Commands of which an option is about other things: "in" is a folder, "value" one to look for, and
# "method" one of mapping, of your own.
OF_THEIR_OWN = [("find", "--in"), ("query", "--value"), ("experiment", "--method")]


def options(module: str) -> Iterator[tuple[list[str], Any, OptionInfo]]:
    """Yield of each option of a command its names, its type, and what else is declared of it."""
    command = importlib.import_module(f"hypermap.cli.{module}").command
    unknown = {"RecordingOptions": Any, "Context": Any}
    signature = inspect.signature(command, locals=unknown, eval_str=True)
    for parameter in signature.parameters.values():
        if get_origin(parameter.annotation) is Annotated:
            kind, declared = get_args(parameter.annotation)
            if isinstance(declared, OptionInfo) and not declared.hidden:
                own = f"--{parameter.name.replace('_', '-')}"
                # Typer takes the first of the names for a default until it builds the command.
                names = [declared.default, *(declared.param_decls or ())]
                spelled = [name for name in names if isinstance(name, str)] or [own]
                yield "/".join(spelled).split("/"), kind, declared


def meaning(kind: Any, option: OptionInfo) -> tuple[Any, ...]:
    """Return what an option takes, and its help up to a colon, after which commands may differ."""
    taken = tuple(sorted(map(str, {kind, *get_args(kind)} - {NoneType, kind | None})))
    return taken, option.metavar, option.count, option.help.rstrip(".").partition(":")[0]


def test_an_option_has_one_meaning_in_all_commands():
    meanings: Any = collections.defaultdict(lambda: collections.defaultdict(list))
    for command, module in _MODULES.items():
        for names, kind, option in options(module):
            for name in names:
                meanings[name][meaning(kind, option)].append(command)
    assert sum(len(commands) for commands in meanings["--json"].values()) >= 5
    for command, name in OF_THEIR_OWN:
        for reported in [*meanings[name]]:
            if meanings[name][reported] == [command]:
                del meanings[name][reported]
    assert {name: dict(reported) for name, reported in meanings.items() if len(reported) > 1} == {}


def test_an_old_name_is_no_name_of_the_same_command_now():
    for command, renamed in RENAMED.items():
        now = {name for names, _, _ in options(_MODULES[command]) for name in names}
        assert renamed
        for option in renamed:
            assert not now & {name for each in option.old for name in each.split("/")}


@pytest.mark.parametrize(
    ("command", "new", "old"),
    [
        ("bench", "--times", "--json"),
        ("demo", "--folder", "--output"),
        ("demo", "--noisy", "--detector"),
        ("map", "--drop-evidence", "--no-evidence"),
        ("render", "--hide-labels", "--no-labels"),
        ("rviz", "--output", "--config"),
        ("simulate", "--image-size", "--size"),
    ],
)
def test_help_shows_the_new_name_alone(hypermap, command, new, old):
    shown = hypermap(command, "--help").out.split()
    assert new in shown
    assert old not in shown


def assert_warns(result: Any, old: str, new: str) -> None:
    assert result.code == 0, result.err
    reported = [line for line in result.err.splitlines() if "deprecated" in line]
    assert reported == [f"hypermap: warning: {old}: a deprecated name; use {new}"]


def test_old_names_work_for_one_more_release_with_a_warning(hypermap, room_map, tmp_path, drive):
    out = tmp_path / "room.svg"
    drawn = hypermap("render", room_map, "-o", out, "--no-labels")
    assert_warns(drawn, "--labels, --no-labels", "--show-labels, --hide-labels")
    without = out.read_bytes()
    assert hypermap("render", room_map, "-o", out, "--hide-labels").code == 0
    assert without == out.read_bytes()
    assert hypermap("render", room_map, "-o", out).code == 0
    assert without != out.read_bytes()

    assert_warns(hypermap("rviz", room_map, f"--config={tmp_path / 'a.rviz'}"), "--config", "-o")
    assert hypermap("rviz", room_map, "-o", tmp_path / "b.rviz").code == 0
    assert (tmp_path / "a.rviz").read_text() == (tmp_path / "b.rviz").read_text()

    made = hypermap(
        "map", drive, "--intrinsics", INTRINSICS, "-o", tmp_path / "m.hmap", "--no-evidence"
    )
    assert_warns(made, "--evidence, --no-evidence", "--keep-evidence, --drop-evidence")
    layer: Any = open_map(tmp_path / "m.hmap")["semantic"]
    assert layer.kept_evidence is None


def test_quiet_leaves_out_the_warning_of_an_old_name(hypermap, room_map, tmp_path):
    result = hypermap("rviz", room_map, "-q", "--config", tmp_path / "a.rviz")
    assert (result.code, result.err) == (0, "")


def test_the_demo_takes_its_old_names(hypermap, tmp_path):
    (tmp_path / "demo").write_text("precious")
    result = hypermap("demo", f"-o{tmp_path / 'demo'}", "--detector", "noisy")
    assert result.code == 2
    assert "-o, --output: a deprecated name; use --folder" in result.err
    assert "--detector: a deprecated name; use --noisy" in result.err
    assert "this is a file; name a folder" in result.err
    wrong = hypermap("demo", "--folder", tmp_path / "new", "--detector", "netwrok")
    assert (wrong.code, "did you mean 'network'?" in wrong.err) == (2, True)
    assert not (tmp_path / "new").exists()
