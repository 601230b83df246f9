"""The short form of the long runs: all of them, for seconds."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.part import Budget

from campaign import long_runs


def test_the_short_form_of_the_campaign_finds_nothing(tmp_path: Path) -> None:
    result = long_runs.run(Budget(seconds=10, seed=1, short=True, folder=tmp_path))
    assert result.findings == []
    assert result.figures["live: restarts"] >= 1
    assert result.figures["live: hours of its clock"] == 24
    assert list(tmp_path.iterdir()) == []
