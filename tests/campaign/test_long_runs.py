"""The short form of the long runs: all of them, for seconds."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.part import Budget

from campaign import long_runs


def test_the_short_form_of_the_campaign_finds_nothing(tmp_path: Path) -> None:
    result = long_runs.run(Budget(seconds=10, seed=1, short=True, folder=tmp_path))
    assert result.findings == []
    assert result.figures["live: restarts"] >= 1
    assert result.figures["live: hours of its clock"] == 24
    assert result.figures["layer: moves"] >= 40
    assert result.figures["server: moves"] >= 40
    assert list(tmp_path.iterdir()) == []


def test_an_object_that_is_seen_twice_or_never_is_found(tmp_path: Path) -> None:
    places = {"here"}
    moved = threading.Event()

    def move(_where: Any) -> None:
        places.add("there")  # not as one change
        moved.set()

    def is_seen() -> Iterator[int]:
        moved.wait(120)
        yield len(places)

    findings: list[str] = []
    budget = Budget(seconds=10, seed=1, short=True, folder=tmp_path)
    long_runs._readers("test", lambda: is_seen, move, budget, 1.0, findings, {})
    assert len(findings) == 1
    assert "seen 2 times" in findings[0]
