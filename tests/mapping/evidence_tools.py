"""Observations of squares and of what is before a camera, and the profiles under test."""

from __future__ import annotations

import dataclasses

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.merging.moving import renumbered
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import TrackTable
from hypermap.perception.depth_view import DepthView
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.observation import Observation, ObservedObject

THESIS = profile("thesis").evidence
DEFAULT = dataclasses.replace(profile("default").evidence, class_sizes="any")  # any chair
ROOM = shapely.box(-10, -10, 10, 10)
NOWHERE = shapely.Polygon()
DAY = 86_400.0  # [s]
CHAIR = shapely.box(1.8, -0.25, 2.3, 0.25)  # before the camera of `level`


def square(x: float, y: float = 0.0, side: float = 1.0) -> shapely.Polygon:
    return shapely.box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)


def seen(
    *shapes: BaseGeometry,
    name: str = "chair",
    area: BaseGeometry = ROOM,
    stamp: float = 0.0,
    score: float = 1.0,
    top: float = 0.9,
    bottom: float = 0.1,
) -> Observation:
    objects = tuple(ObservedObject(name, score, shape, bottom, top) for shape in shapes)
    return Observation(stamp, np.eye(4), objects, area)


def level(depth: float, x: float = 0.0) -> DepthView:
    """What a camera one meter high sees that looks along the map's x axis at a wall."""
    camera = Camera.from_intrinsics(262.5, 262.5, 159.5, 119.5, 320, 240)
    pose = np.array([[0, 0, 1, x], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1.0]])
    image = np.full((240, 320), depth, dtype=np.float32)
    return DepthView.of(RgbdFrame(0.0, image, camera, pose))


def viewed(observation: Observation, view: DepthView) -> Observation:
    return dataclasses.replace(observation, map_T_camera=view.map_T_camera, view=view)


def published_all(config: EvidenceConfig) -> EvidenceConfig:
    """The same configuration, with every object published that is not forgotten."""
    return dataclasses.replace(config, publish_above=config.forget_below, min_probability=0.0)


def only(evidence: EvidenceMap) -> SemanticObject:
    (found,) = evidence.objects()
    return found


def tracks_of(*things: tuple[shapely.Polygon, int]) -> TrackTable:
    """Return a table of chairs, each seen so often, whatever lies at its place."""
    table = TrackTable(DEFAULT.max_existence)
    for shape, views in things:
        evidence = EvidenceMap(DEFAULT)
        for number in range(views):
            evidence.update(seen(shape, stamp=float(number)))
        alone = evidence.settled().snapshot()
        track, heights = renumbered(alone.objects[0], table.next_id), alone.shapes.heights[0]
        polygon, existence = alone.shapes.polygons[0], float(alone.existence[0])
        table.add(track, 0, polygon, tuple(heights.tolist()), existence)
    return table
