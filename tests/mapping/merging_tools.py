"""Maps of a simulated room on two days, to be merged."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hypermap import (
    Hypermap,
    Pose2D,
    SemanticObject,
    open_map,
    save_map,
)
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.overrides import override
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.simulation import EXACT_DETECTOR, SimulatedRecording
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject

DAY, HOUR = 86_400.0, 3600.0  # [s]
SMALL = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)
SOURCE = detections_from_recording()

THINGS = {
    "table": WorldObject("table", (3.4, 3.0), size={"length": 0.8, "width": 0.8}),
    "plant": WorldObject("plant", (3.4, 0.8)),
    "chair": WorldObject("chair", (2.6, 2.2)),
    "chair elsewhere": WorldObject("chair", (2.3, 0.9)),
    "monitor": WorldObject("monitor", (3.4, 3.0), yaw_deg=-150, z=0.74),
}
ALL = "table", "plant", "chair"
MOVED = "table", "plant", "chair elsewhere"
HERE = Pose2D()

OTHER_FRAME = Pose2D(4.0, -2.5, 2.1)
"""Where the map frame of the second day's robot is in that of the first one's."""


@functools.cache
def frames(*things: str) -> tuple[RgbdFrame, ...]:
    """Return the frames of a drive through a room with these objects."""
    look = [(0.7, 1.9, degrees) for degrees in (-50, 50, -50, 50, 0)]
    room = World(
        "room",
        FloorPlan((0, 0, 5, 4)),
        objects=tuple(THINGS[thing] for thing in things),
        walls=(Wall(rectangle=(-0.05, -0.05, 5.05, 4.05)), Wall(line=((1.6, 4), (1.6, 3.4)))),
        drive=DrivePlan(((0.6, 2.0), *look), speed=0.3, turn_rate_deg=20),
    )
    recording = SimulatedRecording(
        room,
        detector_noise=EXACT_DETECTOR,
        has_masks=True,
        has_occupancy=False,
        camera=SMALL,
        rate=2.0,
    )
    return tuple(recording.frames())


def mapped(
    shots: Sequence[RgbdFrame],
    map_T_world: Pose2D = HERE,
    later: float = 0.0,
    onto: Hypermap | None = None,
    **changes: object,
) -> Hypermap:
    """Return the map of frames, in another frame and some time later."""
    matrix = np.eye(4)
    matrix[np.ix_([0, 1, 3], [0, 1, 3])] = map_T_world.matrix()
    config = override(profile("default"), changes)
    drive = f"day {later / DAY:.0f}"
    if onto is None:
        mapper = Mapper(config, SOURCE, drive=drive)
    else:
        mapper = Mapper.onto(onto, SOURCE, drive=drive)
    for shot in shots:
        pose = matrix @ shot.map_T_camera
        mapper.add(dataclasses.replace(shot, stamp=shot.stamp + later, map_T_camera=pose))
    return mapper.hypermap()


@functools.cache
def first_day() -> Hypermap:
    return mapped(frames(*ALL))


@functools.cache
def second_day(*things: str) -> Hypermap:
    """Return the map of the next day, in a frame of its own."""
    return mapped(frames(*things), OTHER_FRAME.inverse(), DAY)


def objects_of(hypermap: Hypermap) -> dict[str, SemanticObject]:
    """Return the objects by their names, which differ."""
    found = {item.name: item for item in hypermap.semantic("semantic")}
    assert len(found) == len(hypermap.semantic("semantic"))
    return found


def centroid(item: SemanticObject) -> tuple[float, float]:
    return item.footprint.centroid.x, item.footprint.centroid.y


def iou(one: SemanticObject, other: SemanticObject) -> float:
    a, b = one.footprint, other.footprint
    return float(a.intersection(b).area / a.union(b).area)


def changed(hypermap: Hypermap, path: Path) -> Hypermap:
    """Return a map as a user opens it."""
    save_map(hypermap, path)
    return open_map(path)


def written(hypermap: Hypermap, path: Path) -> bytes:
    save_map(hypermap, path)
    return path.read_bytes()
