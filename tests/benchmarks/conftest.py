"""The suite as `benchmarks/bench.py` sees it: its folder on the path."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(autouse=True, scope="session")
def _on_the_path() -> Iterator[None]:
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture(autouse=True)
def _little_garbage_to_look_through() -> None:
    """Leave out what earlier tests have made when the stopwatch has garbage collected.

    For good: otherwise, each collection in later tests would look through all tests and modules.
    """
    gc.freeze()
