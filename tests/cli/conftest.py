"""The command line, run in this process as the user's shell would run it in another."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from hypermap.cli.main import main


@dataclass(frozen=True)
class Result:
    """What a command left behind."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def hypermap(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Result]:
    """Run `hypermap ARGUMENTS` and return its exit code and what it printed."""

    def run(*arguments: object, stdin: str = "") -> Result:
        monkeypatch.setattr("sys.stdin", io.StringIO(stdin))
        capsys.readouterr()
        with pytest.raises(SystemExit) as exit_:
            main([str(argument) for argument in arguments])
        code = exit_.value.code
        assert isinstance(code, int | None)
        captured = capsys.readouterr()
        return Result(code or 0, captured.out, captured.err)

    return run


def assert_one_error(result: Result, *words: str) -> None:
    """Assert that a command ended as bad input should: exit code 2 and one line that says why."""
    assert result.code == 2
    assert result.out == ""
    (line,) = result.err.splitlines()
    assert line.startswith("hypermap: error: ")
    for word in words:
        assert word in line
