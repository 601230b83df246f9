"""Readers next to a writer, for seconds; and an object seen twice would be reported."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.part import Budget

from campaign import readers

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_readers_see_an_object_that_moves_once(tmp_path: Path) -> None:
    # In a process of its own, as rospy is one node per process.
    command = [sys.executable, "-m", "campaign", "readers", "--short", "--seed", "1"]
    done = subprocess.run(
        [*command, "--folder", str(tmp_path)],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for asked in ("layer", "server"):
        assert f"{asked}: moves: " in done.stdout
    assert ("ros1: moves: " in done.stdout) != ("ros1: left out: " in done.stdout)  # without ROS
    assert list((tmp_path / "readers").iterdir()) == []


def test_an_object_that_is_seen_twice_or_never_is_found(tmp_path: Path) -> None:
    places = {"here"}
    moved = threading.Event()

    def move(_where: Any) -> None:
        places.add("there")  # not as one change
        moved.set()

    def is_seen() -> Iterator[int]:
        moved.wait(120)
        yield len(places)

    budget = Budget(seconds=10, seed=1, short=True, folder=tmp_path)
    result = readers.watch("test", [is_seen] * readers.READERS, move, budget)
    assert len(result.findings) == 1
    assert "seen 2 times" in result.findings[0].what
