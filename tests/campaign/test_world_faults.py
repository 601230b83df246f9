"""What broken sensors leave gives a map and a note, or one error."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.bad_sensors import FRAMES, SENSORS, BadSensor, fault_of, map_of, write_good_recording
from campaign.part import Budget

from campaign import world_faults


@pytest.fixture(scope="session")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("world") / "good"
    write_good_recording(folder)
    return folder


def test_the_recording_that_is_spoiled_is_good(good: Path) -> None:
    outcome = map_of(good)
    assert outcome.map is not None
    assert (outcome.unusable, outcome.reported) == (0, "")
    assert outcome.map.metadata["frames"]["used"] == FRAMES
    assert {found.object.name for found in outcome.map.objects()} == {"table", "chair", "plant"}


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)
def test_a_bad_sensor_gives_a_map_and_a_note_or_one_error(
    sensor: BadSensor, good: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "recording"
    shutil.copytree(good, folder)
    sensor.spoil(folder)
    outcome = map_of(folder, **sensor.options)
    assert fault_of(sensor, outcome) is None
    assert "Traceback" not in outcome.reported


def test_what_must_come_of_a_fault_is_looked_at(good: Path) -> None:
    outcome = map_of(good)
    assert fault_of(BadSensor("", lambda _: None), outcome) is None
    assert "error was due" in str(fault_of(BadSensor("", lambda _: None, unusable=None), outcome))
    assert "0 frames left out" in str(fault_of(BadSensor("", lambda _: None, unusable=2), outcome))
    assert "'late' was not reported" in str(
        fault_of(BadSensor("", lambda _: None, "late"), outcome)
    )


def test_the_short_form_of_the_campaign_finds_nothing(tmp_path: Path) -> None:
    result = world_faults.run(Budget(seconds=10, seed=3, short=True, folder=tmp_path))
    assert result.findings == []
    assert result.runs >= 12
    assert list(tmp_path.iterdir()) == []
