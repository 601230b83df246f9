from __future__ import annotations

import contextlib
import logging
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hypermap import __version__
from hypermap.cli.signals import ended_by_signals, until_signal
from hypermap.cli.terminal import BAD_INPUT

from .conftest import assert_one_error

COMMANDS = ["demo", "map", "detectors", "info", "query", "render", "rooms", "convert", "shell"]
NEEDED = {"numpy", "shapely", "yaml"}  # by a question to a map
FOREIGN = {"matplotlib", "mcap", "numba", "onnxruntime", "rosbags", "scipy", "starlette", "uvicorn"}


def run_python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


def test_help_names_every_command(hypermap):
    result = hypermap("--help")
    assert result.code == 0
    for command in COMMANDS:
        assert f" {command} " in result.out


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_every_command_shows_how_to_call_it(hypermap, command):
    result = hypermap(command, "--help")
    assert result.code == 0
    assert f"hypermap {command} " in result.out.partition("Examples:")[2]


def modules_after(*arguments: str) -> set[str]:
    """Return the names of all modules that a command loads."""
    code = (
        "import sys, hypermap.cli.main as m\n"
        f"try: m.main({list(arguments)})\n"
        "except SystemExit as end: assert not end.code\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    done = run_python(code)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


def test_help_loads_nothing_heavy():
    assert not modules_after("--help") & (NEEDED | FOREIGN | {"pydantic"})


@pytest.mark.parametrize("command", ["query", "map", "live"])
def test_the_help_of_a_command_loads_nothing_heavy(command):
    assert not modules_after(command, "--help") & (NEEDED | FOREIGN)


def test_a_question_loads_only_what_it_needs(room_map):
    modules = modules_after("query", str(room_map), "--name", "chair")
    assert not modules & FOREIGN
    commands = {name for name in modules if name.startswith("hypermap.cli.")}
    assert "hypermap.cli.query" in commands
    assert not commands & {"hypermap.cli.demo", "hypermap.cli.map_", "hypermap.cli.live"}


def test_ctrl_c_while_the_program_loads_shows_no_traceback():
    done = run_python(
        "import runpy, signal, sys\n"
        "class Interrupter:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer': signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupter())\n"
        "runpy.run_module('hypermap', run_name='__main__')"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_ctrl_c_while_the_program_unloads_does_not_fail_a_command_that_is_done():
    done = run_python(
        "import signal, sys, types\n"
        "from hypermap.cli.start import main\n"
        "class Late:\n"
        "    def __del__(self, interrupt=signal.raise_signal): interrupt(2)\n"
        "sys.modules['hypermap.cli.main'] = types.SimpleNamespace(main=sys.exit, late=Late())\n"
        "main()"
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_page_loads_no_compiled_loops_and_a_mapper_no_solver_that_few_maps_need():
    done = run_python(
        "import sys, hypermap.viewer.live.app\n"
        "print(*sys.modules)\n"
        "import hypermap.mapping.recording_to_map, hypermap.ros.mapper.live_map\n"
        "print(*sys.modules)"
    )
    assert done.returncode == 0, done.stderr
    page, mapper = map(str.split, done.stdout.splitlines())
    solvers = {"scipy.optimize", "scipy.sparse", "scipy.spatial", "hypermap.values.random_field"}
    assert not set(mapper) & solvers
    assert not set(page) & {"numba", "scipy.special"}


def test_the_version_is_the_packages():
    done = subprocess.run(
        [sys.executable, "-m", "hypermap", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"hypermap {__version__}\n"


def test_without_arguments_the_help_is_shown(hypermap):
    assert "Usage: hypermap" in hypermap().out


@pytest.mark.parametrize(
    "arguments",
    [
        ["fly"],
        ["query"],
        ["query", "a.hmap", "--colour", "red"],
        ["render", "a.hmap"],
        ["render", "a.hmap", "-o", "a.png", "--size", "3"],
        ["map", "desk", "-o", "a.hmap", "--profile", "best"],
    ],
)
def test_wrong_usage_ends_with_code_2_and_a_hint(hypermap, arguments):
    result = hypermap(*arguments)
    assert result.code == BAD_INPUT
    assert result.out == ""
    assert "Usage: hypermap" in result.err
    assert "Traceback" not in result.err


@pytest.mark.parametrize("command", ["info", "query", "render", "rooms", "convert", "shell"])
def test_a_bad_map_gives_one_line_and_code_2_for_every_command(
    hypermap, tmp_path, room_map, command
):
    whole = room_map.read_bytes()
    bad = {
        "nowhere.hmap": None,
        "empty.hmap": b"",
        "truncated.hmap": whole[: len(whole) // 2],
        "foreign.hmap": b"\x89PNG\r\n\x1a\n" + bytes(100),
        "broken.yaml": b"layers: [unclosed",
        "list.yaml": b"layers: 3",
    }
    arguments = {
        "info": [],
        "query": ["--at", "0,0"],
        "render": ["-o", tmp_path / "out.png"],
        "rooms": [],
        "convert": [tmp_path / "out.hmap"],
        "shell": [],
    }
    for name, content in bad.items():
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        assert_one_error(hypermap(command, path, *arguments[command]), str(path))
        assert not (tmp_path / "out.png").exists()
        assert not (tmp_path / "out.hmap").exists()


def test_a_folder_where_a_map_is_meant_is_said_so(hypermap, tmp_path):
    assert_one_error(hypermap("query", tmp_path, "--at", "0,0"), str(tmp_path), "folder")


def test_what_the_library_warns_of_is_one_line_on_standard_error(hypermap, shared_data):
    result = hypermap("query", shared_data / "maps" / "office.hmap", "--name", "bottle")
    assert result.code == 0
    (line,) = result.err.splitlines()
    assert line.startswith("hypermap: warning: ")
    assert "object 22 'tvmonitor'" in line


def test_a_reader_that_stops_early_ends_the_command_quietly(room_map):
    python, path = shlex.quote(sys.executable), shlex.quote(str(room_map))
    program = f"{python} -m hypermap query {path} --in 0,0,15,10 --json | head -c 10"
    done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout == '{\n  "map":'
    assert done.stderr == ""


@pytest.mark.parametrize("form", ["", "--json"])
def test_nobody_who_reads_the_output_is_an_exit_code_of_its_own(room_map, form):
    words = [sys.executable, "-m", "hypermap", "query", str(room_map), "--in", "0,0,15,10", form]
    with subprocess.Popen([*filter(None, words)], stdout=subprocess.PIPE) as done:
        done.stdout.close()
    assert done.returncode == 141  # as of any program that SIGPIPE ends


ENDINGS = [(signal.SIGINT, 130), (signal.SIGTERM, 143)]


def test_what_is_made_is_saved_even_if_nobody_reads_what_is_printed(room_map, tmp_path):
    made = tmp_path / "made.hmap"
    words = [sys.executable, "-m", "hypermap", "rooms", str(room_map), "-o", str(made)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as done:
        done.stdout.close()
        done.stderr.read()
    assert (done.returncode, made.exists()) == (141, True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_any_signal_is_the_usual_end_of_a_server(number):
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with ended_by_signals(), until_signal():
            signal.raise_signal(number)
            pytest.fail("the server goes on")
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("number", "code"), ENDINGS)
@pytest.mark.parametrize(
    "becomes",
    [None, SystemError("result with an exception set"), ImportError("multiarray"), EOFError()],
)
def test_signals_end_a_command_in_order(
    hypermap, monkeypatch, room_map, ctrl_c, number, code, becomes
):
    undone = []

    def ended(*_arguments, **_options):
        try:
            signal.raise_signal(number)
        except (KeyboardInterrupt, SystemExit) as end:
            if becomes is None:
                raise
            raise becomes from end  # as compiled loops and libraries do
        finally:
            undone.append("what was half done")

    monkeypatch.setattr("hypermap.formats.open_map", ended)
    before = signal.getsignal(number)
    result = hypermap("info", room_map)
    assert (result.code, len(undone)) == (code, 1)
    assert "Traceback" not in result.err
    assert signal.getsignal(number) == before


@pytest.mark.parametrize(("number", "code"), ENDINGS)
def test_a_signal_that_meets_a_finalizer_is_not_lost(
    hypermap, monkeypatch, room_map, ctrl_c, number, code
):
    class Finalized:
        def __del__(self):
            signal.raise_signal(number)  # what it raises goes no further than this

    def slow(*_arguments, **_options):
        Finalized()
        for _ in range(6000):
            time.sleep(0.01)
        return "still there"

    def leave_slowly(frame, _event, _argument):  # as where a machine has much to do
        def on_return(_frame, event, _argument):
            if event == "return":
                time.sleep(0.1)
            return on_return

        return on_return if frame.f_code.co_name == "send_again" else None

    monkeypatch.setattr("hypermap.formats.open_map", slow)
    before = sys.gettrace()
    sys.settrace(leave_slowly)
    try:
        result = hypermap("info", room_map)
    finally:
        sys.settrace(before)
    assert (result.code, result.err) == (code, "")


def test_a_node_that_a_signal_meets_in_a_finalizer_ends_without_a_traceback(
    hypermap, monkeypatch, room_map, ctrl_c
):
    ended = []

    def end(number, _frame):  # as nodes do while they start
        ended.append(number)
        raise KeyboardInterrupt

    class Finalized:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def start(*_arguments, **_options):
        before = signal.signal(signal.SIGINT, end)
        Finalized()
        signal.signal(signal.SIGINT, before)

    monkeypatch.setattr("hypermap.viewer.live.serving.serve", start)
    result = hypermap("view", room_map, "--no-browser", "--port", 0)
    assert (result.code, ended) == (0, [signal.SIGINT])
    assert "KeyboardInterrupt" not in result.err


def test_a_command_that_ctrl_c_ends_as_usual_has_not_failed(
    hypermap, monkeypatch, room_map, ctrl_c
):
    def look(*_arguments, **_options):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("hypermap.viewer.live.serving.serve", look)
    assert hypermap("view", room_map, "--no-browser", "--port", 0).code == 0


def test_other_errors_of_python_itself_are_not_hidden(hypermap, monkeypatch, room_map):
    def broken(*_arguments, **_options):
        raise SystemError("bad argument to internal function")

    monkeypatch.setattr("hypermap.formats.open_map", broken)
    with pytest.raises(SystemError, match="bad argument"):
        hypermap("info", room_map)


def test_too_little_memory_is_one_line_and_no_bad_input(hypermap, monkeypatch, room_map):
    def too_large(*_arguments, **_options):
        raise MemoryError

    monkeypatch.setattr("hypermap.formats.open_map", too_large)
    result = hypermap("info", room_map)
    assert (result.code, result.out) == (1, "")
    assert result.err.startswith("hypermap: error: there is not enough memory")
    assert result.err.count("\n") == 1


def order(command: list[str], option: str) -> list[list[str]]:
    """Return a command line with an option in each place where it may stand."""
    return [[*command[:i], option, *command[i:]] for i in (0, 1, 2, len(command))]


@pytest.mark.parametrize("place", range(4))
def test_quiet_leaves_the_answer_alone_wherever_it_stands(hypermap, room_map, tmp_path, place):
    command = ["render", str(room_map), "-o", str(tmp_path / "room.png")]
    assert "saved" in hypermap(*command).err
    for option in ("-q", "--quiet"):
        (tmp_path / "room.png").unlink()
        result = hypermap(*order(command, option)[place])
        assert (result.code, result.out, result.err) == (0, "", "")
        assert (tmp_path / "room.png").exists()
    assert "saved" in hypermap(*command).err, "the next command is as usual"
    asked = ["query", str(room_map), "--name", "chair"]
    assert hypermap(*order(asked, "-q")[place]).out == hypermap(*asked).out != ""


@pytest.mark.parametrize("place", range(4))
def test_quiet_tells_errors_but_no_warnings(hypermap, shared_data, place):
    office = str(shared_data / "maps" / "office.hmap")
    command = ["query", office, "--name", "bottle"]
    assert "warning" in hypermap(*command).err
    assert hypermap(*order(command, "-q")[place]).err == ""
    wrong = order(["query", "nowhere.hmap", "--name", "bottle"], "-q")[place]
    assert_one_error(hypermap(*wrong), "nowhere.hmap")


@pytest.mark.parametrize(
    ("before", "behind", "level"),
    [
        ([], [], logging.WARNING),
        (["-v"], [], logging.INFO),
        ([], ["-v"], logging.INFO),
        (["-v"], ["-v"], logging.DEBUG),
        ([], ["-vv"], logging.DEBUG),
        (["-vv"], ["--verbose"], logging.DEBUG),
        (["-q"], ["-v"], logging.WARNING),
        (["-q"], ["-q"], logging.ERROR),
    ],
)
def test_how_much_is_reported_counts_together_before_and_behind_a_command(
    hypermap, room_map, before, behind, level
):
    result = hypermap(*before, "query", room_map, "--name", "chair", *behind)
    assert result.code == 0
    assert logging.getLogger("hypermap").level == level


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes_commands_and_options_once_that_is_installed(tmp_path):
    program = Path(sys.executable).parent / "hypermap"
    script = f"""
        PATH={shlex.quote(str(program.parent))}:$PATH
        hypermap --install-completion >&2
        source ~/.bash_completions/hypermap.sh
        for line in "hypermap que" "hypermap query --nea" "hypermap map --profile the"; do
            COMP_WORDS=($line)
            COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
            _hypermap_completion hypermap
            echo ${{COMPREPLY[@]}}
        done"""
    environment = {**os.environ, "HOME": str(tmp_path)}
    done = subprocess.run(
        ["bash", "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    commands, options, profiles = done.stdout.splitlines()
    assert (commands, set(options.split()), profiles) == (
        "query",
        {"--near", "--nearest"},
        "thesis",
    )
    assert "hypermap" in (tmp_path / ".bashrc").read_text()
