"""Long runs: memory and speed stay level, however long a robot drives.

- A mapper of each profile takes frames of a drive over and over, as many as there is time for.
- A live node maps a day of simulated clock: restarts, jumps of the clock, topics that fall silent,
  hours without anything, frames without a pose, a simulator that begins again at zero.
"""

from __future__ import annotations

import dataclasses
import time
import weakref
from collections import Counter
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path
from typing import Any, cast

import numpy as np

from campaign.part import Budget, Finding, Result, merged
from campaign.robot import DEPTH, DETECTIONS, Robot
from hypermap.core.arrays import FloatArray
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate
from hypermap.simulation import SimulatedRecording, demo_world, errors_of_level
from hypermap.simulation.render import DEFAULT_CAMERA

FRAMES = 100_000  # the most that a mapper gets
GROWTH = 1.0  # MB that 10,000 frames may add, once warm
SLOWER = 1.5  # times: the last quarter of the frames beside the second
DAY = 86_400  # s
_ENOUGH = 20_000  # frames, after which evidence of seldom seen objects has reached its bounds, too
_FILLING = 40.0  # MB that 10,000 frames may add before, besides
_LOG = 25.0  # MB of the log of the newest frames, which fills with the first 3,000
_SETTLES = 5.0  # MB, within which memory may settle at any time
_FEWEST = 1000  # frames, from which on growth is distinguishable from noise
_EVENTS = (
    *("restart", "jump", "without detections", "without depth", "other clock"),
    *("silence", "no pose", "simulator"),
)
_EVERY = 7  # frames, of which the last meets an event
_YEARS = 4 * 10**17  # ns
_NOW = 1_600_000_000 * 10**9  # ns since 1970, when the day begins
_HOUR = 3600 * 10**9  # ns
_PATIENCE = 120.0  # s for one frame of the live node
_ASIDE = 0.15  # m between two that may be one at the end
_LOOKED_AT = {Fate.MAPPED, Fate.STILL}


def run(budget: Budget) -> Result:
    """Run each for its share of the time."""
    frames = drive(budget.seed, rate=0.5 if budget.short else 2.0)
    runs = [_map(name, frames, budget.share(3 - i)) for i, name in enumerate(("default", "thesis"))]
    return merged("long_runs", [*runs, _live(frames, budget)])


def drive(seed: int, rate: float) -> list[RgbdFrame]:
    """Return small frames of a drive through a room, without their color."""
    errors = errors_of_level("robot")
    recording = SimulatedRecording(
        demo_world(),
        camera=DEFAULT_CAMERA.every(4),
        rate=rate,
        depth_noise=errors.depth,
        pose_noise=errors.poses,
        detector_noise=errors.detector,
        seed=seed,
    )
    return [dataclasses.replace(frame, color=None) for frame in recording.frames()]


class _Gauge:
    """Frames for as long as there is time, and what time and memory each took.

    Attributes:
        count: how many frames there were.
        gone: the share of the frames, or of the time, that is over, 0..1.
    """

    def __init__(self, frames: list[RgbdFrame], budget: Budget) -> None:
        self.count, self.gone = 0, 0.0
        self._frames = frames
        self._most = 2 * len(frames) if budget.short else FRAMES
        self._is_short = budget.short
        self._seconds = max(budget.left, 1.0)
        # Whole from the beginning, so that what is written down does not grow.
        self._ends, self._memory = np.full((2, self._most), np.nan)

    def frames(self) -> Iterator[RgbdFrame]:
        """Yield the frames over and over, and read time and memory after each."""
        start = time.monotonic()
        for i, frame in zip(range(self._most), cycle(self._frames), strict=False):
            spent = (time.monotonic() - start) / self._seconds
            if spent > 1:
                break
            self.gone = max((i + 1) / self._most, spent)
            yield frame
            # The processor's time, as others may keep it busy.
            self._ends[i], self._memory[i], self.count = time.process_time(), _memory(), i + 1

    def result(self, name: str, findings: list[str], seed: int, **figures: float | str) -> Result:
        """Return what a run has found, and how level time and memory were."""
        figures = {"frames": self.count, **figures}
        left_out = []
        if self.count >= _FEWEST:
            ends, memory = self._ends[: self.count], self._memory[: self.count]
            findings += uneven(ends, memory)
            early, late = _pace(ends)
            figures["ms of the processor a frame, early and late"] = f"{early:.1f}, {late:.1f}"
            figures["MB per 10,000 frames"] = round(1e4 * _growth(memory), 2)
        elif not self._is_short:
            left_out = [f"{name}: memory and speed, which {_FEWEST} frames show"]
        found = [Finding(f"{name}: {what}", seed) for what in findings]
        reported = {f"{name}: {what}": figure for what, figure in figures.items()}
        return Result(name, self.count, found, reported, left_out)


def uneven(ends: FloatArray, memory: FloatArray) -> list[str]:
    """Return in words what grows from frame to frame in their second half.

    Args:
        ends: time of the processor after each frame [s], shape (N,).
        memory: what was held then [MB], shape (N,).
    """
    found = []
    growth, warm = _growth(memory), len(memory) - len(memory) // 2
    allowed = _SETTLES + GROWTH * warm / 1e4
    if len(memory) // 2 < _ENOUGH:
        allowed = _SETTLES + _LOG + _FILLING * warm / 1e4
    if growth * warm > allowed:
        found.append(f"{growth * warm:.1f} MB more after {warm} frames")
    early, late = _pace(ends)
    if late > SLOWER * early:
        found.append(f"{late / early:.1f} times slower at the end")
    return found


def _growth(memory: FloatArray) -> float:
    """Return what each frame adds in the second half [MB]."""
    warm = np.arange(len(memory) // 2, len(memory))
    return float(np.polyfit(warm, memory[warm], 1)[0])


def _pace(ends: FloatArray) -> tuple[float, float]:
    """Return what a frame takes in the second quarter and in the last [ms]."""
    quarter, steps = len(ends) // 4, 1e3 * np.diff(ends)
    early, late = (float(np.median(steps[k * quarter :][: quarter - 1])) for k in (1, 3))
    return early, late


def _memory() -> float:
    """Return what this process holds in memory, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


# A mapper


def _map(name: str, frames: list[RgbdFrame], budget: Budget) -> Result:
    """Map the drive over and over, with new pose errors each time."""
    rng = np.random.default_rng(budget.seed)
    mapper, gauge = Mapper(profile(name), detections_from_recording()), _Gauge(frames, budget)
    findings = []
    for stamp, frame in enumerate(gauge.frames()):
        pose = frame.map_T_camera.copy()
        pose[:2, 3] += rng.normal(0, 0.02, 2)
        mapper.add(dataclasses.replace(frame, stamp=float(stamp), map_T_camera=pose))
    if mapper.counts.frames != gauge.count or mapper.counts.unusable:
        findings.append(f"{gauge.count} frames were given, {mapper.counts}")
    objects = len(mapper.hypermap().semantic())
    if not objects:
        findings.append(f"no objects after {gauge.count} frames")
    return gauge.result(name, findings, budget.seed, objects=objects)


# A live node


def _live(frames: list[RgbdFrame], budget: Budget) -> Result:
    """Let a node live for a day of its clock."""
    saved = budget.folder / "live.hmap"
    saved.unlink(missing_ok=True)
    day, gauge = _Day(saved, budget.seed), _Gauge(frames, budget)
    before = 0.0
    for i, frame in enumerate(gauge.frames()):
        day.clock += round((gauge.gone - before) * DAY * 1e9)
        before = gauge.gone
        event = _EVENTS[i // _EVERY % len(_EVENTS)] if i % _EVERY == _EVERY - 1 else ""
        day.meet(frame, event)
    day.end()
    whole = day.objects[1:-1]  # the first and the last life may be of a few frames
    if sum(not count for count in whole) > len(whole) / 2:
        day.findings.append(f"objects when it ended: {whole}")
    saved.unlink(missing_ok=True)
    Path(f"{saved}.bak").unlink(missing_ok=True)
    if day.lost:
        day.findings.append(
            f"{len(day.lost)} whole frames were not mapped, the first at {day.lost[0]}"
        )
    if day.robot.levels["error"]:
        day.findings.append(f"{day.robot.levels['error']} errors were logged")
    figures = {
        "frames mapped": day.mapped,
        "restarts": day.lives - 1,
        "hours of its clock": round(24 * gauge.gone, 1),
    }
    return gauge.result("live", day.findings, budget.seed, **figures)


def strayed(known: SemanticLayer, kept: SemanticLayer) -> list[str]:
    """Return in words which objects differ between a live layer and the map saved at its end.

    What turns out to be another part of an object of its name, or the same, may join that at the
    end. Only then are frames made to agree on where objects are, so that it need not touch it yet.
    """
    gone = [item for item in known if item.id not in kept.ids]
    new = [item.id for item in kept if item.id not in known.ids]
    lost = [
        item.id
        for item in gone
        if not any(
            item.name == o.name and item.footprint.dwithin(o.footprint, _ASIDE) for o in kept
        )
    ]
    found = [f"objects {lost} are not in the saved map"] if lost else []
    return found + ([f"objects {new} are in the saved map alone"] if new else [])


class _Day:
    """A node, its clock and restarts, and what became of the frames that it was shown whole.

    Attributes:
        clock: what time it is [ns].
        lives: how often the node began.
        mapped: frames that it was shown whole.
        lost: when those came that it did not map [ns], and what became of them instead.
        objects: how many it knew each time that it ended.
        findings: what else went wrong, in words.
    """

    def __init__(self, saved: Path, seed: int) -> None:
        self.clock = _NOW
        self.lives = self.mapped = 0
        self.lost: list[str] = []
        self.objects: list[int] = []
        self.findings: list[str] = []
        self.robot = Robot(save_to=str(saved), save_every=0.0, patience=0.5)
        self.node = SemanticMapper(cast(Any, self.robot))
        self._saved, self._shown = saved, self.clock
        self._rng = np.random.default_rng(seed)
        self._begin()

    def _begin(self) -> None:
        self.node.configure()
        self.node.activate()
        self.lives += 1

    def end(self) -> None:
        """End the node, which saves its map."""
        known = self.node.mapped()[0]
        held = weakref.ref(cast(Any, self.node)._map)
        self.objects.append(len(known))
        self.node.deactivate()
        self.node.cleanup()
        if held() is not None:  # Python's collector may come late: it counts objects, not MB
            self.findings.append(f"life {self.lives} ended, but its map stays in memory")
        self.findings += strayed(known, open_map(self._saved).semantic())

    def meet(self, frame: RgbdFrame, event: str) -> None:
        """Show a frame, or let something else happen."""
        if event == "restart":
            self.end()
            self._begin()
        elif event == "jump":  # by more than messages may be in disorder, but not before zero
            back = self._shown - round(self._rng.uniform(2, 3600) * 1e9)
            self.clock = back if back > 0 else self.clock
        elif event == "other clock":
            self.robot.show(frame, self.clock + _YEARS, DEPTH)
            self.clock += 10**9
        elif event == "silence":
            for _ in range(12):
                self.clock += _HOUR // 12
                self.robot.clock = self.clock
                self.robot.tick()
        elif event == "no pose":
            self.robot.show(frame, self.clock, is_posed=False)
            self.clock += 10**9
        elif event == "simulator":  # its clock begins at zero, or the real one is back
            self.clock = 10**9 if self.clock >= _NOW - _YEARS else _NOW + DAY * 10**9
        if event.startswith("without"):
            topic = DEPTH if event == "without detections" else DETECTIONS
            self.robot.show(frame, self.clock, topic)
        else:
            self._show(frame)
        self.robot.tick()

    def _show(self, frame: RgbdFrame) -> None:
        """Show a frame whole, and wait until the node has mapped it."""
        before = self._fates()
        self._shown = self.clock
        self.robot.show(frame, self.clock)
        limit = time.monotonic() + _PATIENCE
        while not _LOOKED_AT & (self._fates() - before).keys():
            if time.monotonic() > limit:
                new = ", ".join(fate.value for fate in self._fates() - before)
                self.lost.append(f"{self.clock}: {new or 'nothing'}")
                break
            time.sleep(0.001)
        self.mapped += 1

    def _fates(self) -> Counter[Fate]:
        report = self.node.report()
        return Counter({} if report is None else report.totals)
