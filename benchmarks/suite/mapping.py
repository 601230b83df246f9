"""Mapping a real recording of 640 x 480 pixels with recorded detections, reading included."""

from __future__ import annotations

import pickle
import time
from collections.abc import Iterator
from itertools import chain, islice, pairwise, repeat
from pathlib import Path

import numpy as np

from hypermap.mapping.config import MappingConfig, profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.keyframes import KeyframeSelector
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.occupancy import OccupancyMapper
from hypermap.perception.detectors.sources import detections_from_file
from hypermap.perception.frame import DetectionSource, RgbdFrame
from hypermap.perception.observe import observe
from hypermap.perception.recording import Recording
from hypermap.recordings import RecordingOptions, open_recording
from suite.race import Disagreement, Figure, Growth, Row, Settings, each_of

_SIZES = (10, 32, 100, 316, 1000)  # frames, for the growth
_THESIS_FRAMES = 30
_STEPS = ("reading", "perception", "occupancy", "evidence")


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the speed with both profiles, what the steps take, and how the time grows."""
    return each_of(
        settings,
        {
            "frames/s": _speed,
            "steps": _steps,
            "frames/s, profile thesis": _speed_of_thesis,
            "growth with frames": _growth,
        },
    )


def _desk(settings: Settings, every: int = 1) -> tuple[Recording, DetectionSource]:
    folder: Path = settings.folder("desk")
    options = RecordingOptions(every=every)
    return open_recording(folder, options), detections_from_file(folder / "detections.json")


def _speed(settings: Settings) -> Iterator[Row]:
    recording, source = _desk(settings, every=8 if settings.quick else 1)
    config, frames = profile("default"), len(recording)
    expected = _map(islice(recording.frames(), frames), source, config)[1]
    values = []
    for _ in range(settings.repeat):
        seconds, names = _map(recording.frames(), source, config)
        if names != expected:
            raise Disagreement(f"the same frames gave {expected} and then {names}")
        values.append(frames / seconds[-1])
    note = f"each run gives the same {len(expected)} objects"
    yield Figure(f"mapping the desk, {frames} frames", tuple(values), "frames/s", 40, note=note)


def _speed_of_thesis(settings: Settings) -> Iterator[Row]:
    recording, source = _desk(settings)
    some = recording.frames()
    config = profile("thesis")
    mapper = Mapper(config, source)
    mapper.add(next(some))  # which loads compiled code
    seconds = _add(islice(some, _THESIS_FRAMES), Mapper(config, source))
    values = tuple(1 / np.diff([0, *seconds]))
    yield Figure(f"mapping the desk, profile thesis, {_THESIS_FRAMES} frames", values, "frames/s")


def _map(
    frames: Iterator[RgbdFrame], source: DetectionSource, config: MappingConfig
) -> tuple[list[float], list[str]]:
    """Return after how many seconds each frame was mapped, and the names of the map's objects."""
    mapper = Mapper(config, source)
    ends = _add(frames, mapper)
    return ends, [found.name for found in mapper.evidence.objects()]


def _add(frames: Iterator[RgbdFrame], mapper: Mapper) -> list[float]:
    """Map some frames more, and return after how many seconds each was done."""
    ends = []
    start = time.perf_counter()
    for frame in frames:
        mapper.add(frame)
        ends.append(time.perf_counter() - start)
    return ends


def _steps(settings: Settings) -> Iterator[Row]:
    """Do what `Mapper.add` does, with a look at the clock after each step."""
    recording, source = _desk(settings, every=8 if settings.quick else 1)
    config = profile("default")
    runs = [_seconds_of_steps(recording, source, config) for _ in range(settings.repeat + 1)]
    table = np.array(runs[1:]) / len(recording) * 1e3  # the first one loads compiled code
    shares = table.mean(axis=0) / table.mean(axis=0).sum()
    for step, values, share in zip(_STEPS, table.T, shares, strict=True):
        work = f"mapping the desk: {step}, per frame"
        yield Figure(work, tuple(values.tolist()), "ms", note=f"{share:.0%} of the time")


def _seconds_of_steps(
    recording: Recording, source: DetectionSource, config: MappingConfig
) -> list[float]:
    keyframes, evidence = KeyframeSelector(config.keyframes), EvidenceMap(config.evidence)
    occupancy = OccupancyMapper(config.occupancy)
    seconds = dict.fromkeys(_STEPS, 0.0)
    before = time.perf_counter()

    def end(step: str) -> None:
        nonlocal before
        now = time.perf_counter()
        seconds[step] += now - before
        before = now

    for frame in recording.frames():
        end("reading")
        if keyframes.accept(frame.map_T_camera, frame.stamp):
            observation = observe(frame, source(frame), config.perception)
            end("perception")
            occupancy.add_depth(frame)
            end("occupancy")
            evidence.update(observation)
            end("evidence")
    return list(seconds.values())


def _growth(settings: Settings) -> Iterator[Row]:
    """Map the recording again and again; the memory is that of the evidence, as it is pickled."""
    recording, source = _desk(settings)
    sizes = _SIZES[:3] if settings.quick else _SIZES
    config = profile("default")
    _map(islice(recording.frames(), 2), source, config)  # which loads compiled code
    again_and_again = chain.from_iterable(r.frames() for r in repeat(recording))
    mapper, passed = Mapper(config, source), 0.0
    ends: list[float] = []
    seconds: list[float] = []
    held = []
    for before, size in pairwise((0, *sizes)):
        ends = _add(islice(again_and_again, size - before), mapper)
        passed += ends[-1]
        seconds.append(passed)
        held.append(len(pickle.dumps(mapper.evidence)))
    work = "mapping the desk again and again"
    yield Growth(work, "frames", sizes, tuple(seconds), tuple(held), note="memory: the evidence")
    last = tuple(1e3 * np.diff(ends[-100:]))
    yield Figure(f"one frame more after {sizes[-1]} frames", last, "ms")
