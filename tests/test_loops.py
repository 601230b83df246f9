"""The cache of compiled loops: shared by an administrator, and after an update."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
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
ASK = "import loops_of_a_test as m; {}; print(*map(len, m.total.stats[1:]))"
HITS, MISSES = "1 0", "0 1"
# Root can write everywhere, unless it gives that up.
AS_OWNER = ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []

pytestmark = pytest.mark.skipif(
    bool(AS_OWNER) and shutil.which("setpriv") is None, reason="setpriv is missing"
)


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


def ask(place: Path, home: str = "home", call: str = "m.total(3)") -> str:
    """Return how many loops a process found kept, and how many it compiled."""
    env = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    env |= {"HOME": str(place / home), "PYTHONPATH": str(place / "code")}
    env |= {"PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [*AS_OWNER, sys.executable, "-c", ASK.format(call)],
        env=env,
        cwd=place,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()


def test_a_user_who_cannot_write_beside_the_code_takes_what_lies_there(place: Path) -> None:
    assert ask(place) == MISSES
    protect(place / "code")
    assert ask(place) == HITS
    assert ask(place) == HITS
    assert len(list((place / "home").rglob("*.nbi"))) == 1


def test_what_is_newer_beside_the_code_replaces_what_the_user_has(place: Path) -> None:
    protect(place / "code")
    assert ask(place) == MISSES  # nobody has compiled it yet
    protect(place / "code", is_writable=True)
    source = place / "code" / "loops_of_a_test.py"
    source.write_text(MODULE.replace("sum_ += i", "sum_ += 2 * i"))
    assert ask(place, "home of the administrator") == MISSES
    protect(place / "code")
    assert ask(place) == HITS


def test_a_loop_is_compiled_again_after_the_class_of_its_argument_is_renamed(place: Path) -> None:
    source = place / "code" / "loops_of_a_test.py"
    class_ = "from typing import NamedTuple\nclass Old(NamedTuple): k: int\n@loop"
    code = MODULE.replace("\n@loop", class_)
    code = code.replace("range(n)", "range(n.k)")
    for name in ("Old", "New"):
        source.write_text(code.replace("Old", name))
        assert ask(place, call=f"m.total(m.{name}(3))") == MISSES
    assert ask(place, call="m.total(m.New(3))") == HITS


def test_a_loop_that_cannot_be_kept_is_compiled_and_runs(place: Path) -> None:
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64)); m.total(3)"
    assert ask(place, call=full) == MISSES
    assert ask(place) == MISSES
    assert ask(place) == HITS
