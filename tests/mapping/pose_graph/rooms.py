"""Depth images of a room with boxes in it, and drives through it."""

from __future__ import annotations

import math

import numpy as np

from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.simulation.trajectory import DrivePlan, camera_poses, planar_poses

CAMERA = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)
ROOM = ((0.0, 0.0, 0.0), (7.0, 5.0, 2.6))
BOXES = (
    ((2.6, 2.0, 0.0), (4.2, 3.0, 0.8)),  # tables in the middle
    ((0.0, 3.9, 0.0), (0.9, 5.0, 1.9)),
    ((5.2, 4.5, 0.0), (6.6, 5.0, 1.0)),
    ((6.4, 0.8, 0.0), (7.0, 1.9, 1.6)),
    ((2.0, 0.0, 0.0), (2.6, 0.3, 1.4)),
)
AROUND = DrivePlan(((1.2, 1.0), (5.6, 1.0), (5.6, 4.0), (1.6, 4.0), (1.2, 1.0), (3.0, 1.0)))


def pose(x: float, y: float, yaw_deg: float) -> np.ndarray:
    """Return map_T_camera of a camera that looks a little down, shape (4, 4)."""
    return camera_poses([[x, y, math.radians(yaw_deg)]], AROUND)[0]


def seen_from(map_T_camera: np.ndarray, stamp: float = 0.0, room=ROOM, boxes=BOXES) -> RgbdFrame:
    """Return what a camera in the room sees, with noise."""
    columns, rows = np.meshgrid(np.arange(160), np.arange(120))
    rays = np.stack([(columns - 79.5) / 131.25, (rows - 59.5) / 131.25, np.ones((120, 160))], -1)
    directions = rays @ map_T_camera[:3, :3].T + 1e-12
    _, depth = _crossed(map_T_camera[:3, 3], directions, room)
    for box in boxes:
        enters, leaves = _crossed(map_T_camera[:3, 3], directions, box)
        depth = np.where((enters < leaves) & (enters > 0), np.minimum(depth, enters), depth)
    noise = np.random.default_rng(round(1000 * stamp)).normal(size=depth.shape)
    return RgbdFrame(
        stamp, (depth + 0.002 * depth**2 * noise).astype(np.float32), CAMERA, map_T_camera
    )


def _crossed(origin: np.ndarray, directions: np.ndarray, box) -> tuple[np.ndarray, np.ndarray]:
    """Return at which multiples of the directions rays enter and leave a box."""
    ends = np.sort((np.array(box)[:, np.newaxis, np.newaxis] - origin) / directions, axis=0)
    return ends[0].max(axis=-1), ends[1].min(axis=-1)


def drive(plan: DrivePlan = AROUND, rate: float = 1.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps, planar poses and camera poses of a drive."""
    stamps, poses = planar_poses(plan, rate)
    return stamps, poses, camera_poses(poses, plan)
