"""Frames as broken sensors send them: each kind of fault turns a good frame into a bad one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from hypermap.core.arrays import FloatArray
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame

_SATURATED = 65.535  # meters: the largest number of 16 bits, in millimeters


def _lost(_frame: RgbdFrame, _before: RgbdFrame, _rng: np.random.Generator) -> None:
    """No frame at all."""


def _covered(frame: RgbdFrame, _before: RgbdFrame, _rng: np.random.Generator) -> RgbdFrame:
    """Nothing is seen: no depth, black color, no detections."""
    return replace(
        frame,
        depth=np.full_like(frame.depth, np.nan),
        color=np.zeros_like(frame.color),
        detections=Detections.of([], []),
    )


def _saturated(frame: RgbdFrame, _before: RgbdFrame, _rng: np.random.Generator) -> RgbdFrame:
    """Every pixel has the largest number that there is."""
    return replace(frame, depth=np.full_like(frame.depth, _SATURATED))


def _infinite(frame: RgbdFrame, _before: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """Half of the pixels are infinitely far or have no distance."""
    depth = frame.depth.copy()
    depth[rng.random(depth.shape) < 0.5] = np.inf
    depth[rng.random(depth.shape) < 0.1] = 0
    return replace(frame, depth=depth)


def _scaled(frame: RgbdFrame, _before: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """Depth in another unit."""
    scale = np.float32(rng.choice([0.001, 0.2, 5.0, 1000.0]))
    return replace(frame, depth=frame.depth * scale)


def _torn(frame: RgbdFrame, _before: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """The lower part of the images has not arrived."""
    row = int(rng.integers(1, len(frame.depth)))
    depth, color = frame.depth.copy(), np.array(frame.color)
    depth[row:] = np.nan
    color[row:] = 0
    return replace(frame, depth=depth, color=color)


def _noise(frame: RgbdFrame, _before: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """Depth is any number between 0 and 8 m."""
    return replace(frame, depth=rng.uniform(0, 8, frame.depth.shape).astype(np.float32))


def _frozen(frame: RgbdFrame, before: RgbdFrame, _rng: np.random.Generator) -> RgbdFrame:
    """The images and detections of the frame before, although the robot has moved."""
    return replace(frame, depth=before.depth, color=before.color, detections=before.detections)


def _turned(frame: RgbdFrame, _before: RgbdFrame, _rng: np.random.Generator) -> RgbdFrame:
    """The camera is mounted upside down, without a setting for it."""
    seen, width, height = frame.detections, frame.camera.width, frame.camera.height
    if seen is not None:
        xmin, ymin, xmax, ymax = seen.xyxy.T
        boxes = np.stack([width - xmax, height - ymax, width - xmin, height - ymin], axis=1)
        masks = None if seen.masks is None else seen.masks[:, ::-1, ::-1]
        seen = Detections.of(boxes, seen.names.tolist(), seen.scores, masks)
    return replace(
        frame,
        depth=np.ascontiguousarray(frame.depth[::-1, ::-1]),
        color=np.array(frame.color)[::-1, ::-1],
        detections=seen,
    )


def _no_pose(frame: RgbdFrame, _before: RgbdFrame, _rng: np.random.Generator) -> RgbdFrame:
    """Localization has no idea where the robot is."""
    return frame.moved_to(np.full((4, 4), np.nan))


def _astray(frame: RgbdFrame, _before: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """Localization takes the robot to be somewhere else, up to some meters away."""
    return frame.moved_to(_somewhere(rng) @ frame.map_T_camera)


def _late_pose(frame: RgbdFrame, before: RgbdFrame, _rng: np.random.Generator) -> RgbdFrame:
    """The pose of the frame before."""
    return frame.moved_to(before.map_T_camera)


def _late_detections(frame: RgbdFrame, before: RgbdFrame, _rng: np.random.Generator) -> RgbdFrame:
    """The detections of the frame before."""
    return replace(frame, detections=before.detections)


def _mad_detector(frame: RgbdFrame, _before: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """The detector is sure of boxes anywhere, of the classes that it sees here and of others."""
    count, size = 30, np.array([frame.camera.width, frame.camera.height] * 2)
    corners = rng.uniform(size=(count, 2, 2))
    boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)]) * size
    seen = [] if frame.detections is None else frame.detections.names.tolist()
    names = rng.choice([*seen, "giraffe", "zebra"], count).tolist()
    return replace(frame, detections=Detections.of(boxes, names, rng.uniform(0.5, 1, count)))


Fault = Callable[[RgbdFrame, RgbdFrame, np.random.Generator], RgbdFrame | None]

FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "lost": _lost,
        "covered": _covered,
        "saturated": _saturated,
        "infinite": _infinite,
        "in another unit": _scaled,
        "torn": _torn,
        "noise": _noise,
        "frozen": _frozen,
        "upside down": _turned,
        "without pose": _no_pose,
        "astray": _astray,
        "with a late pose": _late_pose,
        "with late detections": _late_detections,
        "with a mad detector": _mad_detector,
    }
)
"""The faults by name. Each takes a frame, the good one before it and a random number generator,
and returns the bad frame, or None if no frame arrives."""


def draw_fault(share: float, rng: np.random.Generator) -> str | None:
    """Return the kind of fault of a frame, with a probability of `share`; else None."""
    is_bad, which = rng.random() < share, rng.integers(len(FAULTS))
    return list(FAULTS)[which] if is_bad else None


def _somewhere(rng: np.random.Generator) -> FloatArray:
    yaw, moved = rng.uniform(-np.pi, np.pi), np.eye(4)
    moved[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    moved[:2, 3] = rng.uniform(-3, 3, 2)
    return moved
