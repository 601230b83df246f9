from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from hypermap import _compiled


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine on which only the temporary folder can be written to."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", "to be restored after the test")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("os.access", lambda path, mode: False)
    return tmp_path


def test_without_a_writable_home_the_cache_is_private_and_temporary(temporary: Path) -> None:
    _compiled.find_a_cache()
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.parent == temporary
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_folder_in_which_others_may_write_is_not_trusted(temporary: Path) -> None:
    folder = temporary / f"hypermap-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    _compiled.find_a_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ


def test_a_writable_installation_keeps_its_own_cache(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.access", lambda path, mode: True)
    _compiled.find_a_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ


PROGRAM = """
import logging, sys
logging.basicConfig(format="%(message)s", stream=sys.stdout)
from hypermap._loops import cache_folder, loop

@loop()
def double(number):
    return number * 2

@loop()
def triple(number):
    return number * 3

assert (double(2), triple(2)) == (4, 6)
assert cache_folder() is None
"""


def test_where_nothing_can_be_written_loops_are_compiled_and_one_warning_says_so(
    tmp_path: Path,
) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    (tmp_path / "__pycache__").touch()  # no folder, so that root cannot write there, either
    nowhere = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"), os.devnull)
    ended = subprocess.run(
        [sys.executable, program],
        env=os.environ | nowhere,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    (line,) = ended.stdout.splitlines()
    assert line.startswith("no folder for compiled code can be written to")


def test_where_there_is_no_temporary_folder_numba_looks_for_its_own(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere() -> str:
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr("tempfile.gettempdir", nowhere)
    _compiled.find_a_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ
