"""The short form of the long runs: all of them, for seconds."""

from __future__ import annotations

import gc
import sys
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.semantic import SemanticLayer
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate
from hypermap.testing import square

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # as `python -m campaign` has it

from campaign.part import Budget
from campaign.robot import Robot

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
    [found] = long_runs.uneven(0.004 * frames, level + 0.05 * frames)
    assert "MB more after 1000 frames" in found
    many = np.arange(40_000.0)
    [found] = long_runs.uneven(0.004 * many, 300 + 0.0006 * many)
    assert "12.0 MB more after 20000 frames" in found
    fewer = np.arange(21_000.0)  # of which the second half begins before all evidence is there
    assert long_runs.uneven(0.004 * fewer, 300 + 0.0006 * fewer) == []
    [found] = long_runs.uneven(np.cumsum(0.004 + 4e-6 * frames), level)
    assert "times slower" in found


class _Least:
    """Luck that always draws the least."""

    def uniform(self, low: float, _: float) -> float:
        return low


def test_the_clock_jumps_back_beyond_the_last_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame that is a little older than the last one is not lost, but too old."""
    monkeypatch.setattr(long_runs, "_PATIENCE", 20.0)
    frame = _frame()
    day = long_runs._Day(tmp_path / "live.hmap", seed=1)
    monkeypatch.setattr(day, "_rng", _Least())
    day.meet(frame, "")
    day.clock += 1_900_000_000
    day.meet(frame, "jump")
    day.end()
    assert day.lost == []


def _frame() -> RgbdFrame:
    """Return what a camera sees that looks down at the floor."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])  # looks down from 2 m
    pose[2, 3] = 2.0
    camera = Camera.from_intrinsics(60.0, 60.0, 31.5, 23.5, 64, 48)
    seen = Detections.of([[20, 12, 44, 36]], ["box"])
    return RgbdFrame(0.0, np.full((48, 64), 2.0, np.float32), camera, pose, detections=seen)


def _wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


class _WithTemperature(Robot):
    """A robot that also measures the temperature."""

    def topic_type(self, _: str) -> str:
        return "sensor_msgs/Temperature"


@pytest.mark.parametrize("corrections", [{"path_topic": "/path"}, {"odom_frame": "odom"}])
def test_a_node_that_ended_holds_no_memory(tmp_path: Path, corrections: dict[str, str]) -> None:
    """Python's collector counts objects: a map of few that are large could wait for hours."""
    robot = _WithTemperature(
        save_to=str(tmp_path / "live.hmap"),
        save_every=30.0 if "odom_frame" in corrections else 0.0,
        frontiers=True,
        values=["/temperature"],
        **corrections,
    )
    node: Any = SemanticMapper(robot)  # type: ignore[arg-type]
    node.configure()
    gc.disable()
    try:
        node.activate()
        held = [weakref.ref(node._map), weakref.ref(node._life), weakref.ref(node._life._worker)]
        _wait_for(lambda: "/temperature" in robot.topics)
        robot.show(_frame(), robot.clock)
        _wait_for(lambda: node.report().totals.get(Fate.MAPPED) == 1)
        node.deactivate()
        node.cleanup()
        assert [each() for each in held] == [None] * 3
    finally:
        gc.enable()


def test_an_object_that_is_lost_at_the_end_is_found_and_one_that_joins_another_is_not() -> None:
    table, part = square("table", 0, 0, 2, id=1), square("table", 1, 0, id=2)
    cup = square("cup", 5, 5, id=3)
    beside = square("table", 1.6, 0, id=4)  # as the pose errors of its frame put it
    known = SemanticLayer("s", "map", [table, part, cup, beside])
    assert long_runs.strayed(known, SemanticLayer("s", "map", [table, cup])) == []
    lost = long_runs.strayed(known, SemanticLayer("s", "map", [table]))
    assert lost == ["objects [3] are not in the saved map"]
    [new] = long_runs.strayed(SemanticLayer("s", "map", [table]), SemanticLayer("s", "map", [part]))
    assert new == "objects [2] are in the saved map alone"
