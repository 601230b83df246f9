"""How long correcting poses takes, and whether the map becomes that of the corrected poses.

A robot drives through copies of the demo's room, one after the other, and drifts by 0.7 m and 6
degrees on the way. Its map is corrected, and compared with one that was mapped from the true poses.
Prints the processor's time for each frame, and how alike the objects are.

    python benchmarks/correcting.py [--rooms 4] [--rate 1] [--seed 7] [--runs 5]

16 rooms at a rate of 2.31 are 2,000 keyframes and 304 objects: as many as a map keeps.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import time
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticObject
from hypermap.core.trajectory import pose_from_rpy, trajectory_of
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.simulation.levels import errors_of_level

SOURCE = detections_from_recording()
_APART = 20.0  # m between two rooms, and s between two drives


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=int, default=4)
    parser.add_argument("--rate", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    frames = drive_through(arguments.rooms, arguments.rate, arguments.seed)
    drifted = [
        frame.moved_to(drift(i / len(frames)) @ frame.map_T_camera)
        for i, frame in enumerate(frames)
    ]
    exact, before = map_of(frames), map_of(drifted)
    stamps = np.array([frame.stamp for frame in frames])
    truth = trajectory_of(stamps, np.array([frame.map_T_camera for frame in frames]))
    times = []
    for _ in range(arguments.runs):
        mapper = Mapper.onto(before, SOURCE)
        begin = time.process_time()
        correction = mapper.correct(truth)
        assert correction is not None  # it always corrects without a least move
        times.append(1e3 * (time.process_time() - begin) / correction.frames)
    print(f"{correction.frames} frames, {len(objects(exact))} objects")
    print(
        f"{statistics.median(times):.2f} ms of the processor for each frame, "
        f"{min(times):.2f} to {max(times):.2f}; "
        f"{1e-3 * correction.frames * statistics.median(times):.2f} s in all"
    )
    print("before:   ", likeness(objects(exact), objects(before)))
    print("corrected:", likeness(objects(exact), objects(mapper.hypermap())))


def drive_through(rooms: int, rate: float, seed: int) -> list[RgbdFrame]:
    """Return the frames of a drive through copies of the demo's room that lie in a row."""
    recording = SimulatedRecording.with_errors(
        demo_world(), errors_of_level("robot"), rate=rate, seed=seed, has_occupancy=False
    )
    one = list(recording.frames())
    lasts = one[-1].stamp - one[0].stamp + _APART
    return [
        dataclasses.replace(frame, stamp=frame.stamp + room * lasts, color_stamp=None).moved_to(
            pose_from_rpy(room * _APART, 0, 0, 0, 0, 0) @ frame.map_T_camera
        )
        for room in range(rooms)
        for frame in one
    ]


def drift(share: float) -> NDArray[np.float64]:
    """Return by how much odometry is off after a share of the drive, shape (4, 4)."""
    return pose_from_rpy(0.6 * share, -0.4 * share, 0, 0, 0, np.radians(6 * share))


def map_of(frames: Sequence[RgbdFrame]) -> Hypermap:
    """Return the map of some frames."""
    mapper = Mapper(profile("default"), SOURCE, drive="drive")
    for frame in frames:
        mapper.add(frame)
    return mapper.hypermap()


def objects(hypermap: Hypermap) -> list[SemanticObject]:
    """Return the objects of a map."""
    return hypermap.semantic("semantic").objects()


def likeness(wanted: list[SemanticObject], found: list[SemanticObject]) -> str:
    """Return how many objects there are, and how alike each wanted one's most similar one is."""
    ious = [
        max((_iou(one, other) for other in found if other.name == one.name), default=0.0)
        for one in wanted
    ]
    lost = sum(iou < 0.25 for iou in ious)
    return f"{len(found)} objects for {len(wanted)}, {lost} lost, mean IoU {np.mean(ious):.3f}"


def _iou(one: SemanticObject, other: SemanticObject) -> float:
    shared = shapely.area(shapely.intersection(one.footprint, other.footprint))
    return float(shared / (one.footprint.area + other.footprint.area - shared))


if __name__ == "__main__":
    main()
