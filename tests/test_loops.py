"""The cache of compiled loops: shared by an administrator, and after an update."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

MODULE = """
from hypermap._loops import loop

@loop()
def total(n):
    sum_ = 0
    for i in range(n):
        sum_ += i
    return sum_
"""
# Each user's process is a copy of one that has imported Numba, which takes most of a second.
COPIES = """
import json, os, sys
import numba
from hypermap._loops import loop
from numba.core.registry import cpu_target

cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
for line in sys.stdin:
    place, home, call = json.loads(line)
    child = os.fork()
    if child:
        if os.waitpid(child, 0)[1]:
            print(flush=True)  # it has failed; others go on
        continue
    os.environ["HOME"] = home
    os.chdir(place)
    sys.path.insert(0, f"{place}/code")
    import loops_of_a_test as m
    exec(call)
    print(*map(len, m.total.stats[1:]), flush=True)
    os._exit(0)
"""
HITS, MISSES = "1 0", "0 1"
# Root can write everywhere, unless it gives that up.
AS_OWNER = ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []

pytestmark = [
    pytest.mark.skipif(
        bool(AS_OWNER) and shutil.which("setpriv") is None, reason="setpriv is missing"
    ),
    pytest.mark.xdist_group("loops"),
]


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    """A folder with code and, next to it, a home."""
    (tmp_path / "home").mkdir()
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "loops_of_a_test.py").write_text(MODULE)
    yield tmp_path
    protect(tmp_path / "code", is_writable=True)


def protect(code: Path, is_writable: bool = False) -> None:
    for folder in (code, code / "__pycache__"):
        if folder.exists():
            folder.chmod(0o755 if is_writable else 0o555)


Ask = Callable[..., str]


@pytest.fixture(scope="module")
def copies() -> Iterator[subprocess.Popen[str]]:
    """A process that makes copies of itself, which run a loop."""
    env = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    with subprocess.Popen(
        [*AS_OWNER, sys.executable, "-c", COPIES],
        env=env | {"PYTHONDONTWRITEBYTECODE": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process


@pytest.fixture
def ask(copies: subprocess.Popen[str], place: Path) -> Ask:
    """Return what tells how many loops a process found kept, and how many it compiled."""

    def ask(home: str = "home", call: str = "m.total(3)") -> str:
        assert copies.stdin is not None
        assert copies.stdout is not None
        copies.stdin.write(json.dumps([str(place), str(place / home), call]) + "\n")
        copies.stdin.flush()
        return copies.stdout.readline().strip()

    return ask


def test_a_user_who_cannot_write_beside_the_code_takes_what_lies_there(
    place: Path, ask: Ask
) -> None:
    assert ask() == MISSES
    protect(place / "code")
    assert ask() == HITS
    assert ask() == HITS
    assert len(list((place / "home").rglob("*.nbi"))) == 1


def test_what_is_newer_beside_the_code_replaces_what_the_user_has(place: Path, ask: Ask) -> None:
    protect(place / "code")
    assert ask() == MISSES  # nobody has compiled it yet
    protect(place / "code", is_writable=True)
    source = place / "code" / "loops_of_a_test.py"
    source.write_text(MODULE.replace("sum_ += i", "sum_ += 2 * i"))
    assert ask("home of the administrator") == MISSES
    protect(place / "code")
    assert ask() == HITS


def test_a_loop_is_compiled_again_after_the_class_of_its_argument_is_renamed(
    place: Path, ask: Ask
) -> None:
    source = place / "code" / "loops_of_a_test.py"
    class_ = "from typing import NamedTuple\nclass Old(NamedTuple): k: int\n@loop"
    code = MODULE.replace("\n@loop", class_)
    code = code.replace("range(n)", "range(n.k)")
    for name in ("Old", "New"):
        source.write_text(code.replace("Old", name))
        assert ask(call=f"m.total(m.{name}(3))") == MISSES
    assert ask(call="m.total(m.New(3))") == HITS


def test_a_loop_that_cannot_be_kept_is_compiled_and_runs(ask: Ask) -> None:
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64)); m.total(3)"
    assert ask(call=full) == MISSES
    assert ask() == MISSES
    assert ask() == HITS
