from __future__ import annotations

import os
import stat
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
