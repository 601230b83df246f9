"""Which errors of poses limit the profile `default`: an error budget by oracles.

Maps the same simulated images by poses from which one part of the errors is removed:

- the map to which poses are corrected is exact; or made by a laser, but not bent;
- the camera is mounted where it is assumed; the clocks agree; both;
- localization is exact, but for clocks and mounting;
- height, roll and pitch are true, or x, y and heading;
- what is common to all frames that look at one place is taken out, or the rest is;
- poses as recorded, and the true ones.

Prints means over the drives: by how much the things that the detector finds, up to 3 m away, are
displaced, as the mean of all looks at one (`common`), and around that (`rest`), root mean squares;
the Jaccard index; precision, recall and F1 at an IoU of 0.25; and F1 at 0.5.

    python benchmarks/pose_budget.py [--worlds lab] [--seeds 4] [--first-seed 1000]
                                     [--errors rough] [--rate 2]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.metrics import Evaluation, evaluate
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.keyframes import KeyframeSelector
from hypermap.mapping.perceived import Perceived
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observe import observe
from hypermap.simulation import SimulatedRecording, built_in_world, errors_of_level, varied
from hypermap.simulation.levels import Errors
from hypermap.simulation.map_noise import MapNoise
from hypermap.simulation.truth import true_objects

Poses = NDArray[np.float64]  # map_T_camera of all keyframes, shape (N, 4, 4)

CONFIG = profile("default")
AHEAD = np.array([0.0, 0.0, 1.5, 1.0])  # what a camera looks at
NEAR = 1.0  # meters; standard deviation of the places that count as one
SEEN = 3.0  # meters up to which displaced things count


@dataclass(frozen=True, eq=False)
class Drive:
    """The keyframes of a drive, and what is known of it.

    Attributes:
        name: of the world.
        seed: of the drive.
        errors: of the level.
        rate: frames per second.
        frames: as recorded.
        numbers: of the frames among all, shape (N,).
        true: their true poses.
        things: the true objects.
        occupancy: the map that comes with the recording.
    """

    name: str
    seed: int
    errors: Errors
    rate: float
    frames: Sequence[RgbdFrame]
    numbers: NDArray[np.int64]
    true: Poses
    things: Sequence[SemanticObject]
    occupancy: OccupancyLayer

    @classmethod
    def of(cls, name: str, seed: int, level: str, rate: float) -> Drive:
        """Render a drive."""
        errors = replace(errors_of_level(level), people=0)
        recording = _recording(name, seed, errors, rate)
        keyframes, kept = KeyframeSelector(CONFIG.keyframes), []
        for number, frame in enumerate(recording.frames()):
            if keyframes.accept(frame.map_T_camera, frame.stamp):
                kept.append((number, frame))
        numbers = np.array([number for number, _ in kept])
        things = tuple(true_objects(recording.world).objects())
        occupancy = recording.occupancy()
        assert occupancy is not None
        frames = [frame for _, frame in kept]
        true = recording.true_poses[numbers]
        return cls(name, seed, errors, rate, frames, numbers, true, things, occupancy)

    def recorded(self, **poses: float) -> Poses:
        """Return the recorded poses, some of whose errors are others."""
        errors = replace(self.errors, poses=replace(self.errors.poses, **poses))
        recording = _recording(self.name, self.seed, errors, self.rate)
        return recording.recorded_poses[self.numbers]

    def map_with(self, noise: MapNoise) -> OccupancyLayer:
        """Return the map that would come with the recording if it had other errors."""
        errors = replace(self.errors, map=noise)
        occupancy = _recording(self.name, self.seed, errors, self.rate).occupancy()
        assert occupancy is not None
        return occupancy


def _recording(name: str, seed: int, errors: Errors, rate: float) -> SimulatedRecording:
    world = varied(built_in_world(name), seed)
    return SimulatedRecording.with_errors(world, errors, rate=rate, seed=seed)


def variants(drive: Drive) -> Iterator[tuple[str, Poses, Poses]]:
    """Yield what is taken out, and the poses as recorded and as corrected without it."""
    given, true, own = drive.recorded(), drive.true, drive.errors.map
    mounted = {"mounting": 0.0, "mounting_deg": 0.0}
    localized = {"position": 0.0, "yaw_deg": 0.0, "drift": 0.0, "drift_yaw_deg": 0.0}
    corrected = aligned(drive, given, drive.occupancy)

    def without(**poses: float) -> tuple[Poses, Poses]:
        recorded = drive.recorded(**poses)
        return recorded, aligned(drive, recorded, drive.occupancy)

    yield "nothing", given, corrected
    exact = drive.map_with(MapNoise())
    yield "the map: exact", given, aligned(drive, given, exact)
    straight = drive.map_with(replace(own, bend=0.0))
    yield "the bend of the map", given, aligned(drive, given, straight)
    yield "mounting", *without(**mounted)
    yield "clock offset", *without(time_offset=0.0)
    yield "mounting and clock offset", *without(time_offset=0.0, **mounted)
    recorded = drive.recorded(time_offset=0.0, **mounted)
    yield "these and the map", recorded, aligned(drive, recorded, exact)
    yield "localization", *without(**localized)
    level = with_tilt_of(corrected, true)
    yield "height, roll and pitch", level, level
    flat = with_tilt_of(true, corrected)
    yield "x, y and heading", flat, flat
    shared = common(true, corrected)
    rest = shifted(corrected, -shared)
    yield "what looks at one place share", rest, rest
    yield "what they do not share", shifted(true, shared), shifted(true, shared)
    yield "the correction by the map", given, given
    yield "all", true, true


def aligned(drive: Drive, recorded: Poses, occupancy: OccupancyLayer) -> Poses:
    """Return poses corrected by a map."""
    aligner = Aligner(occupancy, CONFIG.alignment)
    moved = zip(drive.frames, recorded, strict=True)
    return np.array([aligner.align(frame.moved_to(pose)).map_T_camera for frame, pose in moved])


def common(true: Poses, poses: Poses) -> NDArray[np.float64]:
    """Return the mean displacement of what frames near each other look at [m], shape (N, 2)."""
    places = (true @ AHEAD)[:, :2]
    away = (poses @ AHEAD)[:, :2] - places
    apart = ((places[:, np.newaxis] - places) ** 2).sum(axis=2)
    weights = np.exp(-apart / (2 * NEAR**2))
    return np.asarray(weights @ away / weights.sum(axis=1, keepdims=True))


def shifted(poses: Poses, by: NDArray[np.float64]) -> Poses:
    """Return poses moved over the floor [m], shape (N, 2)."""
    moved = poses.copy()
    moved[:, :2, 3] += by
    return moved


def with_tilt_of(poses: Poses, level: Poses) -> Poses:
    """Return poses with the height, roll and pitch of others."""
    turn = poses[:, :3, :3] @ np.swapaxes(level[:, :3, :3], 1, 2)
    yaw = np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1])
    upright = np.zeros((len(poses), 3, 3))
    upright[:, 0, 0] = upright[:, 1, 1] = np.cos(yaw)
    upright[:, 1, 0], upright[:, 0, 1], upright[:, 2, 2] = np.sin(yaw), -np.sin(yaw), 1
    mixed = level.copy()
    mixed[:, :3, :3] = upright @ level[:, :3, :3]
    mixed[:, :2, 3] = poses[:, :2, 3]
    return mixed


def displaced(drive: Drive, poses: Poses) -> tuple[float, float]:
    """Return how far things are off in the mean of their looks, and each look around that [cm]."""
    places = np.array([[*thing.footprint.centroid.coords[0], 0.5, 1.0] for thing in drive.things])
    near = np.hypot(*(places[:, np.newaxis, :2] - drive.true[:, :2, 3]).transpose(2, 0, 1)) < SEEN
    motions = poses @ np.linalg.inv(drive.true)
    means, rests = [], []
    for thing, place in enumerate(places):
        name = drive.things[thing].name
        looks = [n for n in np.flatnonzero(near[thing]).tolist() if _shows(drive.frames[n], name)]
        if len(looks) > 2:
            moves = (motions[looks] @ place - place)[:, :2]
            means.append(moves.mean(axis=0))
            rests.append(((moves - means[-1]) ** 2).sum(axis=1).mean())
    common_part = np.sqrt((np.array(means) ** 2).sum(axis=1).mean())
    return 100 * float(common_part), 100 * float(np.sqrt(np.mean(rests)))


def _shows(frame: RgbdFrame, name: str) -> bool:
    return frame.detections is not None and name in frame.detections.names


def mapped(drive: Drive, recorded: Poses, poses: Poses) -> Evaluation:
    """Return how good the map is."""
    evidence = EvidenceMap(CONFIG.evidence, partial(free_share, drive.occupancy))
    for frame, given, pose in zip(drive.frames, recorded, poses, strict=True):
        found = frame.detections or Detections.of([], [], [])
        seen = observe(frame.moved_to(pose), found, CONFIG.perception)
        evidence.update(Perceived(found, 0, seen, None).corrected_from(given).observation)
    return evaluate(evidence.objects(), drive.things)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default="lab")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--errors", default="rough")
    parser.add_argument("--rate", type=float, default=2.0, help="frames per second")
    arguments = parser.parse_args()
    for name in arguments.worlds.split(","):
        rows: dict[str, list[tuple[float, ...]]] = {}
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
            drive = Drive.of(name, seed, arguments.errors, arguments.rate)
            for removed, recorded, poses in variants(drive):
                evaluation = mapped(drive, recorded, poses)
                found = evaluation.overall.detection
                iou = float(np.mean([one.iou for one in evaluation.closest]))
                scores = [found[0].precision, found[0].recall, found[0].f1, found[1].f1]
                figures = *displaced(drive, poses), iou, *(score or 0.0 for score in scores)
                rows.setdefault(removed, []).append(figures)
        print(f"{name}, {arguments.errors}, {arguments.seeds} drives")
        print(f"{'removed':34}common   rest    IoU      P      R     F1  F1 at 0.5")
        for removed, every in rows.items():
            means = np.mean(every, axis=0)
            print(f"{removed:34}" + " ".join(f"{mean:6.2f}" for mean in means), flush=True)


if __name__ == "__main__":
    main()
