"""Every example in the documents is run: Python blocks as they stand, console blocks line by line.

A page's blocks run from top to bottom, in one namespace and one folder, next to the
`hypermap-demo/` that `hypermap demo` makes. Python blocks with prompts are compared with the
output that they show. Of a console block, the lines after `$` are run and must succeed. What
cannot run in a test (a robot, a download) stands in a plain `text` block.
"""

from __future__ import annotations

import doctest
import io
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hypermap.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    page
    for page in [ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md"))]
    if page.name != "ros1.md"  # tests/ros/test_ros1_doc.py runs it, with a roscore
    and re.search(r"^```(python|console)$", page.read_text(encoding="utf-8"), re.MULTILINE)
]
BLOCK = re.compile(r"^```(python|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
QUOTED = re.compile(r"""'[^']*'|"[^"$`\\!]*\"""")  # text in which the shell replaces nothing
TYPED = re.compile(r"echo '([^']*)' \| ")  # what is piped into a command
DOCTEST_FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS

pytestmark = pytest.mark.xdist_group("demo")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_examples_of_a_page_run(
    page: Path, demo_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if page.name == "logs.md":
        pytest.importorskip("rerun", reason="Rerun needs Python 3.11")
    (tmp_path / "hypermap-demo").symlink_to(demo_folder)
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {"__name__": "__main__"}
    text = page.read_text(encoding="utf-8")
    for block in BLOCK.finditer(text):
        line = text.count("\n", 0, block.start()) + 2
        language, source = block.groups()
        if language == "console":
            _run_console(source, f"{page.name}:{line}")
        elif ">>> " in source:
            _run_doctest(source, namespace, page, line)
        else:
            exec(compile("\n" * (line - 1) + source, str(page), "exec"), namespace)


def _run_console(source: str, where: str) -> None:
    commands = re.findall(r"^\$ ((?:.*\\\n)*.*)$", source, re.MULTILINE)
    assert commands, f"{where}: a console block shows its commands after '$ '"
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command in commands:
        typed = TYPED.match(command)
        if words := _plain_command(command[typed.end() :] if typed else command):
            _run_hypermap(words, typed[1] + "\n" if typed else "", f"{where}: {command}")
            continue
        done = subprocess.run(
            ["bash", "-c", command],
            env={**os.environ, "PATH": path},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{where}: {command}\n{done.stdout}{done.stderr}"


def _plain_command(command: str) -> list[str]:
    """Return the words of a call of `hypermap` alone; none if it needs a shell."""
    line = command.replace("\\\n", " ")
    unquoted = re.sub(r"\s#.*", "", QUOTED.sub("", line))
    is_plain = line.startswith("hypermap ") and not set(unquoted) & set("|&;<>()$`\\*?[]#~!{}\"'")
    return shlex.split(line, comments=True) if is_plain else []


def _run_hypermap(words: list[str], typed: str, where: str) -> None:
    """Run a command in this process, as starting another takes longer than most commands."""
    said = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        for name, stream in (("stdin", io.StringIO(typed)), ("stdout", said), ("stderr", said)):
            patch.setattr(sys, name, stream)
        with pytest.raises(SystemExit) as ended:
            main(words[1:])
    assert not ended.value.code, f"{where}\n{said.getvalue()}"


def _run_doctest(source: str, namespace: dict[str, Any], page: Path, line: int) -> None:
    example = doctest.DocTestParser().get_doctest(source, namespace, page.name, str(page), line)
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=DOCTEST_FLAGS, verbose=False)
    runner.run(example, out=report.append, clear_globs=False)
    namespace.update(example.globs)
    assert not runner.failures, "".join(report)
