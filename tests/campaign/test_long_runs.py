"""The short form of the long runs: all of them, for seconds."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.part import Budget

from campaign import long_runs


def test_the_short_form_of_the_campaign_finds_nothing(tmp_path: Path) -> None:
    result = long_runs.run(Budget(seconds=10, seed=1, short=True, folder=tmp_path))
    assert result.findings == []
    assert result.figures["live: restarts"] >= 1
    assert result.figures["live: hours of its clock"] == 24
    assert list(tmp_path.iterdir()) == []


def test_what_grows_is_found() -> None:
    frames = np.arange(2000.0)
    level = 300 + 3 * np.exp(-frames / 100)  # MB, which settle
    assert long_runs.uneven(0.004 * frames, level) == []
    [found] = long_runs.uneven(0.004 * frames, level + 0.025 * frames)
    assert "MB more after 1500 frames" in found
    many = np.arange(20_000.0)
    [found] = long_runs.uneven(0.004 * many, 300 + 0.001 * many)
    assert "15.0 MB more after 15000 frames" in found
    [found] = long_runs.uneven(np.cumsum(0.004 + 4e-6 * frames), level)
    assert "times slower" in found
