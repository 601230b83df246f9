"""How often things are seen and detected on a drive: what bounds recall."""

from __future__ import annotations

import itertools

import numpy as np

from hypermap.perception.detections import Detections
from hypermap.simulation import EXACT_DEPTH, EXACT_DETECTOR, DetectorNoise, SimulatedRecording
from hypermap.simulation.sightings import Sightings
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, World, WorldObject


def test_a_thing_is_detected_by_a_box_around_it_with_its_class() -> None:
    instances = np.full((40, 60), -1, np.int32)
    instances[5:15, 5:25] = 0
    instances[20:35, 30:50] = 1
    instances[0:5, 50:55] = 2  # too small to count
    instances[20:35, 5:25] = 3  # somebody who walks by
    names = ["table", "chair", "cup"]
    sightings = Sightings.none(3)
    near, far = (np.full(instances.shape, depth, np.float32) for depth in (1.5, 2.5))
    far[instances == 1] = 1.0
    boxes = [[4, 4, 26, 16], [30, 20, 50, 35], [0, 0, 60, 40]]
    sightings.add(instances, near, Detections.of(boxes, ["table", "bench", "chair"]), names)
    sightings.add(instances, far, Detections.of([], []), names)
    assert sightings.visible.tolist() == [2, 2, 0]
    assert sightings.detected.tolist() == [1, 0, 0]
    assert sightings.mistaken.tolist() == [0, 1, 0]
    assert sightings.nearest.tolist() == [1.5, 1.0, np.inf]
    assert sightings.share() == 1 / 3
    assert sightings.share(at_least=2) == 0


def test_a_recording_counts_what_its_detector_never_finds() -> None:
    world = World(
        "room",
        FloorPlan((0, 0, 6, 4)),
        objects=(WorldObject("table", (3.5, 2)), WorldObject("chair", (3.2, 3.2))),
        drive=DrivePlan(((0.5, 2), (1.5, 2)), speed=0.5),
    )
    for miss, found in ((0.0, 3), (1.0, 0)):
        noise = EXACT_DETECTOR if miss == 0 else DetectorNoise(miss=miss, false_positives=0)
        recording = SimulatedRecording(
            world, rate=1, depth_noise=EXACT_DEPTH, detector_noise=noise, seed=1
        )
        assert len(list(itertools.islice(recording.frames(), 3))) == 3
        assert recording.sightings.visible.tolist() == [3, 3]
        assert recording.sightings.detected.tolist() == [found, found]
