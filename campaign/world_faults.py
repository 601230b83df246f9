"""Faults of the world: broken sensors give a map and a note, or one error; few cost no quality.

Each of `bad_sensors.SENSORS` must come out as its table says; several at once, drawn at random,
must give a map or one of our errors. Then drives are mapped as they are and with some bad frames:
the maps must be as good, to within `TOLERANCE`.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from campaign.bad_sensors import SENSORS, endless_objects, fault_of, map_of, write_good_recording
from campaign.part import Budget, Finding, Result
from hypermap.evaluation import evaluate
from hypermap.mapping.config import profile
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.simulation import SimulatedRecording, demo_world, errors_of_level, ground_truth
from hypermap.simulation.render import DEFAULT_CAMERA

BAD_FRAMES = 0.05
TOLERANCE = 0.02
_MEASURES = ("IoU", "precision", "recall")  # the latter at an IoU of 0.25
_GOOD = 0.3  # the least of each measure without bad frames
_FEWEST = 5  # drives whose mean says something
_SHORT = 6  # faults, and mixtures of faults


def run(budget: Budget) -> Result:
    """Try all faults, mixtures of them, and drives with bad frames."""
    rng = np.random.default_rng(budget.seed)
    good = budget.folder / "good"
    shutil.rmtree(good, ignore_errors=True)
    write_good_recording(good)
    found, of_faults = _Tried(good, budget), budget.share(2)
    order = rng.permutation(len(SENSORS)).tolist()
    for number in order[:_SHORT] if budget.short else order:
        if of_faults.is_over:
            break
        found.try_faults([number])
    faults = found.runs
    while found.runs < faults + _SHORT if budget.short else not of_faults.is_over:
        found.try_faults(rng.choice(len(SENSORS), int(rng.integers(2, 5)), replace=False).tolist())
    shutil.rmtree(good)
    figures: dict[str, float | str] = {"faults": faults, "mixtures": found.runs - faults}
    left_out = []
    if not budget.short:
        if missed := len(SENSORS) - faults:
            left_out.append(f"{missed} of {len(SENSORS)} faults")
        lost = _quality_lost_in_drives(budget)
        figures["drives"] = len(lost)
        if len(lost) < _FEWEST:
            left_out.append(f"the quality under bad frames, which {_FEWEST} drives show")
        else:
            found.findings += _too_much(lost, budget, figures)
    return Result("world_faults", found.runs, found.findings, figures, left_out)


def _quality_lost_in_drives(budget: Budget) -> list[tuple[float, ...]]:
    """Return what bad frames cost each of as many drives as there is time for."""
    lost: list[tuple[float, ...]] = []
    while not budget.is_over:
        lost.append(quality_lost(budget.seed + len(lost)))
    return lost


def _too_much(
    lost: list[tuple[float, ...]], budget: Budget, figures: dict[str, float | str]
) -> Iterator[Finding]:
    """Put down the mean of what was lost; yield what is more than the tolerance."""
    for measure, number in zip(_MEASURES, np.mean(lost, axis=0).tolist(), strict=True):
        figures[f"{measure} lost"] = round(number, 4)
        if number > TOLERANCE:
            text = f"{BAD_FRAMES:.0%} bad frames cost {number:.3f} of {measure}"
            yield Finding(text, budget.seed)


@dataclass
class _Tried:
    """What was tried on copies of the good recording."""

    good: Path
    budget: Budget

    def __post_init__(self) -> None:
        self.runs = 0
        self.findings: list[Finding] = []

    def try_faults(self, numbers: list[int]) -> None:
        """Spoil the recording by one or several faults, and map it; a finding keeps its files."""
        folder = self.budget.folder / "-".join(map(str, numbers))
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.good, folder)
        sensors = [SENSORS[i] for i in numbers]
        names = " and ".join(sensor.name for sensor in sensors)
        options = {key: value for sensor in sensors for key, value in sensor.options.items()}
        try:
            for sensor in sensors:
                sensor.spoil(folder)
        except (OSError, ValueError, LookupError):  # what it would spoil is gone
            shutil.rmtree(folder)
            return
        self.runs += 1
        try:
            outcome = map_of(folder, **options)
        except Exception as error:  # which none may be
            what: str | None = f"{type(error).__name__}: {error}"
        else:
            is_alone = len(sensors) == 1
            what = fault_of(sensors[0], outcome) if is_alone else endless_objects(outcome)
        if what is None:
            shutil.rmtree(folder)
        else:
            self.findings.append(Finding(f"{names}: {what}", self.budget.seed, folder))


def quality_lost(seed: int, bad_frames: float = BAD_FRAMES) -> tuple[float, ...]:
    """Return by how much bad frames lower IoU, precision and recall of the map of a drive."""
    good, bad = (np.array(_quality(seed, share)) for share in (0.0, bad_frames))
    if min(good) < _GOOD:  # else nothing could be lost
        raise RuntimeError(f"the drive without bad frames gives a bad map: {good}")
    return tuple((good - bad).tolist())


def _quality(seed: int, bad_frames: float) -> tuple[float, ...]:
    world, errors = demo_world(), errors_of_level("robot")
    recording = SimulatedRecording(
        world,
        camera=DEFAULT_CAMERA.every(2),
        depth_noise=errors.depth,
        pose_noise=errors.poses,
        detector_noise=errors.detector,
        has_occupancy=False,
        bad_frames=bad_frames,
        seed=seed,
    )
    made = map_recording(recording, detections_from_recording(), profile("default"))
    truth = ground_truth(world).semantic().objects()
    score = evaluate(made.semantic().objects(), truth).overall
    found = score.detection[0]
    return score.iou or 0.0, found.precision or 0.0, found.recall or 0.0
