"""How far odometry is off before and after its poses are corrected without a map, and the objects.

Drives through simulated worlds, level `drift`, each mapped with the exact poses, with those of
odometry, and with these as corrected by a pose graph, all without an occupancy map. Prints a row
for each drive: the absolute trajectory error (ATE), after the best alignment, in and out; its error
without alignment; and precision and recall at an IoU of 0.25 of the three maps, which are compared
with the true one as they are.

    python benchmarks/drifting_poses.py [--worlds lab,floor,office,building] [--seeds 2] [--rate 2]
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.metrics import evaluate
from hypermap.experiments.sets import first_seed_of
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.pose_graph import correct_poses
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import OnBadFrame
from hypermap.simulation import SimulatedRecording, built_in_world, errors_of_level, varied
from hypermap.simulation.pose_noise import PoseNoise
from hypermap.simulation.trajectory import camera_poses, planar_poses
from hypermap.simulation.truth import true_objects

SOURCE = detections_from_recording()


@dataclass(frozen=True)
class Frames:
    """A recording of frames that are kept."""

    all: Sequence[RgbdFrame]

    def frames(self, _on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield them."""
        yield from self.all


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default="lab,floor,office,building")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--rate", type=float, default=2.0)
    parser.add_argument("--errors", default="drift", choices=["drift", "robot", "fair"])
    arguments = parser.parse_args()
    print("| world | seed | ATE in | out | share | not aligned, in | out | exact P, R | drift P, R "
          "| corrected P, R | loops | s |")  # fmt: skip
    print("|" + " --- |" * 12)
    for world in arguments.worlds.split(","):
        first = first_seed_of([world])
        for seed in range(first, first + arguments.seeds):
            frames = exact_frames(world, seed, arguments.rate)
            noise = errors_of_level(arguments.errors).poses
            print(row_of(world, seed, frames, noise, arguments.rate), flush=True)


def exact_frames(world: str, seed: int, rate: float) -> list[RgbdFrame]:
    """Return the frames of a drive with exact poses and all other errors of the level."""
    recording = SimulatedRecording.with_errors(
        varied(built_in_world(world), seed),
        replace(errors_of_level("drift"), poses=PoseNoise()),
        rate=rate,
        seed=seed,
        has_occupancy=False,
    )
    return list(recording.frames())


def row_of(world: str, seed: int, exact: list[RgbdFrame], noise: PoseNoise, rate: float) -> str:
    """Return a row of the table."""
    described = varied(built_in_world(world), seed)
    assert described.drive is not None
    stamps, planar = planar_poses(described.drive, rate)
    counted = noise.estimate(stamps, planar, np.random.default_rng([seed, 1]))
    poses = camera_poses(counted, described.drive)
    given = [frame.moved_to(pose) for frame, pose in zip(exact, poses, strict=True)]
    began = time.process_time()
    corrected = correct_poses(Frames(given))  # type: ignore[arg-type]
    took = time.process_time() - began
    moved = [
        frame.moved_to(corrected.poses.get(frame.stamp, frame.map_T_camera)) for frame in given
    ]
    truth = true_objects(described).objects()
    scores = [scored(frames, truth) for frames in (exact, given, moved)]
    true, before, after = (places(frames) for frames in (exact, given, moved))
    ate = [error_of(aligned(one, true), true) for one in (before, after)]
    off = [error_of(one, true) for one in (before, after)]
    share = ate[1] / ate[0] if ate[0] else math.nan
    return (
        f"| {world} | {seed} | {ate[0]:.3f} | {ate[1]:.3f} | {share:.2f} | {off[0]:.3f} "
        f"| {off[1]:.3f} | {' | '.join(scores)} | {corrected.loops} | {took:.1f} |"
    )


def places(frames: Sequence[RgbdFrame]) -> NDArray[np.float64]:
    """Return where the camera was [m], shape (N, 2)."""
    return np.array([frame.map_T_camera[:2, 3] for frame in frames])


def aligned(places: NDArray[np.float64], true: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places moved and turned so that they lie best on others (Horn 1987)."""
    one, other = places - places.mean(axis=0), true - true.mean(axis=0)
    cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    yaw = math.atan2(float(cross.sum()), float((one * other).sum()))
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.asarray(one @ np.array([[cos, sin], [-sin, cos]]) + true.mean(axis=0))


def error_of(places: NDArray[np.float64], true: NDArray[np.float64]) -> float:
    """Return the root mean square of the distances [m]."""
    return float(np.sqrt(np.sum((places - true) ** 2, axis=1).mean()))


def scored(frames: Sequence[RgbdFrame], truth: Sequence[SemanticObject]) -> str:
    """Return precision and recall of the map of some frames."""
    config = profile("default")
    config = replace(config, pictures=replace(config.pictures, enabled=False))
    mapper = Mapper(config, SOURCE)
    for frame in frames:
        mapper.add(frame)
    found = evaluate(mapper.hypermap().semantic("semantic").objects(), truth)
    quarter = found.overall.detection[0]
    return f"{quarter.precision:.2f}, {quarter.recall:.2f}"


if __name__ == "__main__":
    main()
