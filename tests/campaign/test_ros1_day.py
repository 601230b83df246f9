"""What a day on ROS 1 is judged by; the day itself takes minutes."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.part import Budget

from campaign import ros1_day


def test_a_log_that_is_flooded_or_has_tracebacks_is_found() -> None:
    log = ["[INFO] mapping"] * 20
    assert ros1_day.odd_lines(log, 20) == []
    assert ros1_day.odd_lines([*log, "Traceback (most recent call last):"], 20) == [
        "logged 21 lines, more than 20",
        "logged 1 tracebacks",
    ]


def test_without_ros_1_the_day_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    result = ros1_day.run(Budget(seconds=1, seed=1, short=True, folder=tmp_path))
    assert (result.runs, result.findings) == (0, [])
    assert "roscore" in str(result.figures["ros1"])
