"""Simulated drives, each mapped by several methods at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from hypermap.core.semantic import SemanticObject
from hypermap.experiments.parallel import in_processes
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.keyframes import KeyframeSelector
from hypermap.mapping.stages import AlignmentConfig
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe
from hypermap.simulation import Errors, SimulatedRecording, World, network_detector
from hypermap.simulation.sightings import Sightings


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive through a world, with errors of its own.

    Attributes:
        world: what there is to see.
        seed: of all chance.
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
    """

    drive: SimulatedDrive
    frames: int
    objects: Mapping[str, tuple[SemanticObject, ...]]
    sightings: Sightings


def map_drive(drive: SimulatedDrive, methods: Mapping[str, MappingConfig]) -> Mapped:
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
    maps = {
        name: EvidenceMap(config.evidence, partial(free_share, occupancy))
        for name, config in methods.items()
    }
    keyframes = {name: KeyframeSelector(config.keyframes) for name, config in methods.items()}
    aligners = {
        config.alignment: Aligner(occupancy, config.alignment) for config in methods.values()
    }
    for frame in recording.frames():
        detections = frame.detections if frame.detections is not None else Detections.of([], [], [])
        frames: dict[AlignmentConfig, RgbdFrame] = {}
        seen: dict[tuple[AlignmentConfig, PerceptionConfig], Observation] = {}
        for name, config in methods.items():
            if not keyframes[name].accept(frame.map_T_camera):
                continue
            way = config.alignment, config.perception
            if config.alignment not in frames:
                frames[config.alignment] = aligners[config.alignment].align(frame)
            if way not in seen:
                seen[way] = observe(frames[config.alignment], detections, config.perception)
            maps[name].update(seen[way])
    objects = {name: tuple(evidence.objects()) for name, evidence in maps.items()}
    return Mapped(drive, len(recording), objects, recording.sightings)


def map_drives(
    drives: Sequence[SimulatedDrive], methods: Mapping[str, MappingConfig], jobs: int
) -> Iterator[Mapped]:
    """Yield what becomes of each drive, in the order in which they are done.

    Args:
        drives: what to map.
        methods: by name.
        jobs: how many drives are mapped at the same time, each in a process of its own.
    """
    yield from in_processes(partial(map_drive, methods=methods), drives, jobs)
