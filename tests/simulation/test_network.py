"""The network that comes with the package, on worlds that it was not trained on."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pytest

from hypermap.simulation import (
    SimulatedRecording,
    World,
    built_in_world,
    built_in_worlds,
    network_detector,
)
from hypermap.simulation.detector import visible_boxes
from hypermap.simulation.network import CLASSES, class_of
from hypermap.simulation.render import Renderer
from hypermap.simulation.scene import Scene
from hypermap.simulation.trajectory import camera_poses, planar_poses
from hypermap.simulation.world import WorldObject


def test_it_is_small_and_read_like_any_network() -> None:
    detector = network_detector()
    assert detector.layout.name == "YOLOv8, YOLO11"
    assert detector.names == CLASSES
    assert detector.model.input_size == (320, 256)
    file = resources.files("hypermap.simulation") / "detector.onnx"
    assert 0.5e6 < len(file.read_bytes()) < 3e6


def test_every_model_of_the_built_in_worlds_has_a_class() -> None:
    assert class_of(WorldObject("screen", (0, 0), name="tvmonitor")) == "monitor"
    assert class_of(WorldObject("sitter", (0, 0), name="person")) == "person"
    for world in built_in_worlds():
        assert {class_of(thing) for thing in built_in_world(world).objects} <= set(CLASSES)


@pytest.mark.parametrize("name", built_in_worlds())
def test_it_finds_most_of_the_objects_in_an_image_and_invents_few(name: str) -> None:
    world = built_in_world(name)
    right, found, true = counts(world, images=24)
    assert true > 30
    assert right / true > 0.72
    assert right / found > 0.82


def counts(world: World, images: int) -> tuple[int, int, int]:
    """Return right detections, all detections and objects, in images along the drive.

    Objects of which fewer than 150 pixels are visible may be found or not.
    """
    detector = network_detector()
    renderer = Renderer(Scene.of(world))
    names = np.array([class_of(thing) for thing in world.objects])
    poses = camera_poses(planar_poses(world.drive, 10)[1], world.drive)
    right = found = true = 0
    for pose in poses[np.linspace(0, len(poses) - 1, images).astype(int)]:
        view = renderer.render(pose)
        boxes = visible_boxes(view.instances, len(names))
        pixels = np.bincount(view.instances[view.instances >= 0], minlength=len(names))
        is_free = pixels > 0
        detections = detector.detect(view.color)
        true += int((pixels >= 150).sum())
        for box, label in zip(detections.xyxy, detections.names, strict=True):
            fit = np.where(is_free & (names == label), ious(box, boxes), 0)
            best = int(fit.argmax())
            if fit[best] >= 0.5:
                is_free[best] = False
                if pixels[best] < 150:
                    continue
                right += 1
            found += 1
    return right, found, true


def ious(box: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    shared = np.minimum(box[2:], boxes[:, 2:]) - np.maximum(box[:2], boxes[:, :2])
    shared = np.clip(shared, 0, None).prod(axis=1)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) + (box[2:] - box[:2]).prod()
    return shared / (areas - shared)


def test_an_empty_room_shows_nothing() -> None:
    color = np.full((240, 320, 3), 200, np.uint8)
    color[150:] = (190, 160, 120)
    assert len(network_detector().detect(color)) == 0


def test_a_recording_carries_what_the_network_finds() -> None:
    detector = network_detector()
    recording = SimulatedRecording(built_in_world("demo"), rate=0.1, detector=detector)
    for frame in recording.frames():
        expected = detector.detect(frame.color)
        assert frame.detections.xyxy.tolist() == expected.xyxy.tolist()
        assert frame.detections.names.tolist() == expected.names.tolist()
