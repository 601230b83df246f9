"""docs/ros1.md as a user follows it: each command is run, and its output is what the page shows.

Commands that do not end by themselves run until a `^C`, or the end of the page; the page goes on
when they have written what it shows. Others may be a moment early, as a user's would be, so they
are tried again until they succeed. "..." stands for what differs from run to run.
"""

from __future__ import annotations

import doctest
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from .. import prepared
from .conftest import HYPERMAP, PACKAGES, Process, program_of_python, wait_for

pytestmark = [pytest.mark.xdist_group("ros_launch"), pytest.mark.slow, pytest.mark.timeout(1200)]

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "ros1.md"
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
STAYS = (
    "hypermap serve ",
    "roslaunch hypermap record_map.launch",
    "rosbag play --quiet --keep-alive",
)
FAILS = ("{layer: rooms}", "store_map")


def steps(text: str) -> Iterator[tuple[str, str]]:
    """Yield each command of the page, or "^C", and the output that it shows."""
    for block in BLOCK.findall(text):
        for step in re.split(r"^(?=\$ |\^C$)", block, flags=re.MULTILINE):
            if step.startswith("^C"):
                yield "^C", ""
            elif step:
                lines = re.split(r"(?<!\\)\n", step.removeprefix("$ "), maxsplit=1)
                yield lines[0], lines[1]


def shows(wanted: str, got: str) -> bool:
    """Whether an output is the one of the page; trailing blanks do not matter."""
    plain = "\n".join(line.rstrip() for line in got.strip().splitlines()) + "\n"
    lines = "\n".join(line.rstrip() for line in wanted.strip().splitlines()) + "\n"
    return doctest.OutputChecker().check_output(lines, plain, doctest.ELLIPSIS)


def test_the_page_leads_to_a_map(
    roscore: str,
    start: Callable[..., Process],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "HYPERMAP": str(ROOT),
        "COLUMNS": "100",
    }
    running: list[Process] = []
    for command, wanted in steps(PAGE.read_text(encoding="utf-8")):
        if command == "^C":
            assert running.pop().stop() == 0
        elif command == "roscore":
            continue  # there is one
        elif command.startswith(("eval ", "export ")):
            environment = environment_after(command, environment)
        elif command.startswith(STAYS):
            running.append(start(*words_of(command), env=environment))
            for line in wanted.strip().splitlines():
                wait_for_line(running[-1], line)
        else:
            run(command, wanted, environment)
    while running:
        running.pop().stop()


def environment_after(command: str, environment: dict[str, str]) -> dict[str, str]:
    """Return the environment that a command of the shell leaves."""
    done = subprocess.run(
        ["bash", "-c", f"{command}\nenv -0"], env=environment, capture_output=True, check=True
    )
    return dict(line.split("=", 1) for line in done.stdout.decode().split("\0") if line)


def words_of(command: str) -> list[str]:
    """Return the words that a shell makes of a command."""
    return shlex.split(command.replace("\\\n", " ").replace("$PWD", str(Path.cwd())))


def wait_for_line(process: Process, line: str) -> None:
    wait_for(
        lambda: any(shows(line, written) for written in process.output.splitlines()), repr(line)
    )


def run(command: str, wanted: str, environment: dict[str, str]) -> None:
    """Run a command until it ends as the page shows."""
    fails = any(sign in command for sign in FAILS)
    words = words_of(command)
    program = program_of_python([*HYPERMAP, *words[1:]] if words[0] == "hypermap" else words)
    assert program is not None, command
    for _ in range(5):
        done = prepared.run(
            *program[1], program=program[0], packages=PACKAGES, env=environment, timeout=240
        )
        got = done.stdout + (done.stderr if fails else "")
        if (done.returncode != 0) == fails and shows(wanted, got):
            return
    pytest.fail(f"{command}\nexpected:\n{wanted}\ngot {done.returncode}:\n{got}\n{done.stderr}")
