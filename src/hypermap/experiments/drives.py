"""Simulated drives, each mapped by several methods at once."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import methodcaller
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.pose_errors import PoseErrors, pose_errors
from hypermap.experiments.installed_methods import MappingRun, MethodFailed
from hypermap.experiments.methods import Method
from hypermap.experiments.parallel import in_processes
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.keyframes import KeyframeSelector
from hypermap.mapping.perceived import Perceived
from hypermap.mapping.stages import AlignmentConfig, KeyframeConfig
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe
from hypermap.simulation import Errors, SimulatedRecording, World, network_detector
from hypermap.simulation.sightings import Sightings

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive through a world, with errors of its own.

    Attributes:
        world: what there is to see.
        seed: of the random number generator.
        errors: of camera, localization and detector.
        rate: frames per second.
        has_network: whether the network that comes with the package detects the objects in the
            images, whose errors are not those of `errors`; the world's names are then its own
            (`named_for_network`).
    """

    world: World
    seed: int
    errors: Errors
    rate: float
    has_network: bool = False


@dataclass(frozen=True, eq=False)
class Mapped:
    """What the methods made of a drive.

    Attributes:
        drive: the drive.
        frames: how many it had.
        objects: the objects of each method's map, by its name.
        sightings: how often the drive showed each true object, and its detections did.
        poses: errors of the poses that each configuration was given, and of those that it mapped
            from, by the method's name.
        failed: why methods of packages failed, by their names; they have no objects.
    """

    drive: SimulatedDrive
    frames: int
    objects: Mapping[str, tuple[SemanticObject, ...]]
    sightings: Sightings
    poses: Mapping[str, tuple[PoseErrors, PoseErrors]] = field(default_factory=dict)
    failed: Mapping[str, str] = field(default_factory=dict)


def map_drive(drive: SimulatedDrive, methods: Mapping[str, Method]) -> Mapped:
    """Return the objects that each method maps on a drive.

    Each frame is rendered once, and looked at once by each way of perception. The occupancy map is
    known, as well as the errors allow, and poses are corrected by it where a method does so.
    """
    recording = SimulatedRecording.with_errors(
        drive.world,
        drive.errors,
        rate=drive.rate,
        seed=drive.seed,
        detector=network_detector(threads=1) if drive.has_network else None,
    )
    occupancy = recording.occupancy()
    assert occupancy is not None  # it has one by default
    looks = _Looks(occupancy, recording.true_poses)

    def start(method: Method) -> MappingRun:
        if isinstance(method, MappingConfig):
            return _ConfiguredRun(method, occupancy, looks)
        return method.start(occupancy, f"world {drive.world.name}, seed {drive.seed}")

    failed: dict[str, str] = {}
    runs = _attempted(methods, start, failed)
    for frame in recording.frames():
        looks.turn_to(frame)
        _attempted(runs, methodcaller("add", frame), failed)
    objects = _attempted(runs, lambda run: tuple(run.objects()), failed)
    poses = {
        name: looks.pose_errors(method)
        for name, method in methods.items()
        if isinstance(method, MappingConfig)
    }
    return Mapped(drive, len(recording), objects, recording.sightings, poses, failed)


def _attempted(
    items: Mapping[str, Item], do: Callable[[Item], Result], failed: dict[str, str]
) -> dict[str, Result]:
    """Return what becomes of each method that does not fail.

    Args:
        items: what there is of each method, by its name.
        do: done to each.
        failed: why methods have failed, by their names; these are left out, and more are added.
    """
    done: dict[str, Result] = {}
    for name, item in items.items():
        if name not in failed:
            try:
                done[name] = do(item)
            except MethodFailed as error:
                failed[name] = str(error)
    return done


@dataclass(frozen=True)
class _PoseOfFrame:
    """What became of the pose of one frame."""

    stamp: float
    given: NDArray[np.float64]
    used: NDArray[np.float64]
    true: NDArray[np.float64]


_Way: TypeAlias = tuple[KeyframeConfig, AlignmentConfig]
"""How poses are corrected: an `Aligner` learns from the frames before, which keyframes choose."""


class _Looks:
    """What configurations have in common on one frame: its corrected pose and what it shows."""

    def __init__(self, occupancy: OccupancyLayer, true_poses: NDArray[np.float64]) -> None:
        self._occupancy = occupancy
        self._true_poses = true_poses
        self._count = 0
        self._poses: dict[_Way, list[_PoseOfFrame]] = {}
        self._aligners: dict[_Way, Aligner] = {}
        self._frames: dict[_Way, RgbdFrame] = {}
        self._seen: dict[tuple[_Way, PerceptionConfig], Observation] = {}

    def turn_to(self, frame: RgbdFrame) -> None:
        """Forget the frame before."""
        self._frame = frame
        self._count += 1
        self._frames.clear()
        self._seen.clear()

    def observation(self, config: MappingConfig) -> Observation:
        """Return what the frame shows, from the pose that a configuration takes it from."""
        look = _way(config), config.perception
        if look not in self._seen:
            frame = self._aligned(_way(config))
            detections = frame.detections
            nothing = Detections.of([], [], [])
            found = nothing if detections is None else detections
            seen = Perceived(found, 0, observe(frame, found, config.perception), None)
            self._seen[look] = seen.corrected_from(self._frame.map_T_camera).observation
        return self._seen[look]

    def _aligned(self, way: _Way) -> RgbdFrame:
        if way not in self._aligners:
            self._aligners[way] = Aligner(self._occupancy, way[1])
        if way not in self._frames:
            frame = self._frames[way] = self._aligners[way].align(self._frame)
            given, true = self._frame.map_T_camera, self._true_poses[self._count - 1]
            pose = _PoseOfFrame(frame.stamp, given, frame.map_T_camera, true)
            self._poses.setdefault(way, []).append(pose)
        return self._frames[way]

    def pose_errors(self, config: MappingConfig) -> tuple[PoseErrors, PoseErrors]:
        """Return the errors of the poses that were given, and of those that were mapped from."""
        poses = self._poses.get(_way(config), [])
        stamps, true = [pose.stamp for pose in poses], [pose.true for pose in poses]
        return (
            pose_errors(stamps, [pose.given for pose in poses], true),
            pose_errors(stamps, [pose.used for pose in poses], true),
        )


def _way(config: MappingConfig) -> _Way:
    return config.keyframes, config.alignment


class _ConfiguredRun:
    """Our mapping with a configuration, on one drive; a `MappingRun`."""

    def __init__(self, config: MappingConfig, occupancy: OccupancyLayer, looks: _Looks) -> None:
        self._config = config
        self._looks = looks
        self._keyframes = KeyframeSelector(config.keyframes)
        self._map = EvidenceMap(config.evidence, partial(free_share, occupancy))

    def add(self, frame: RgbdFrame) -> None:
        """Map a frame, which is the one that the looks are of."""
        if self._keyframes.accept(frame.map_T_camera, frame.stamp):
            self._map.update(self._looks.observation(self._config))

    def objects(self) -> list[SemanticObject]:
        """Return the objects of the map so far."""
        return self._map.objects()


def map_drives(
    drives: Sequence[SimulatedDrive], methods: Mapping[str, Method], jobs: int
) -> Generator[Mapped, None, None]:
    """Yield what becomes of each drive, in the order in which they are done.

    Args:
        drives: what to map.
        methods: by name.
        jobs: how many drives are mapped at the same time, each in a process of its own.
    """
    yield from in_processes(partial(map_drive, methods=methods), drives, jobs)
