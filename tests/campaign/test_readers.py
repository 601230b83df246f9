"""Readers beside a writer, for seconds; and that an object seen twice would be told."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.part import Budget, Result

from campaign import readers


@pytest.fixture
def budget(tmp_path: Path) -> Budget:
    return Budget(seconds=10, seed=1, short=True, folder=tmp_path)


@pytest.mark.parametrize("ask", [readers.ask_layer, readers.ask_server])
def test_readers_see_an_object_that_moves_once(
    ask: Callable[[Budget], Result], budget: Budget
) -> None:
    result = ask(budget)
    assert result.findings == []
    assert result.figures[f"{result.name}: moves"] >= 40
    assert list(budget.folder.iterdir()) == []


def test_an_object_that_is_seen_twice_or_never_is_found(budget: Budget) -> None:
    places = {"here"}
    moved = threading.Event()

    def move(_where: Any) -> None:
        places.add("there")  # not as one change
        moved.set()

    def is_seen() -> Iterator[int]:
        moved.wait(120)
        yield len(places)

    result = readers.watch("test", [is_seen] * readers.READERS, move, budget)
    assert len(result.findings) == 1
    assert "seen 2 times" in result.findings[0].what
