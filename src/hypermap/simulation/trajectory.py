"""Where the simulated camera is: a drive along waypoints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ConfigDict, Field

_Number = Annotated[float, Field(strict=True, ge=-1000, le=1000)]
_Positive = Annotated[float, Field(strict=True, gt=0, le=1000)]
_Waypoint = Annotated[tuple[_Number, ...], Field(min_length=2, max_length=3)]
_STILL = 1e-6  # meters or radians; a smaller motion takes no time


@dataclass(frozen=True)
class DrivePlan:
    """A robot's drive: it turns in place toward the next waypoint, then drives straight there.

    Attributes:
        waypoints: (x, y), or (x, y, look_deg) where the robot then turns on the spot to look that
            way, degrees counter-clockwise from +x. It starts looking at the second waypoint,
            or as the first one says.
        speed: meters per second.
        turn_rate_deg: degrees per second.
        camera_height: of the optical center above the floor [m].
        pitch_deg: how far the camera looks down.
    """

    waypoints: Annotated[tuple[_Waypoint, ...], Field(min_length=1, max_length=10_000)]
    speed: _Positive = 0.5
    turn_rate_deg: _Positive = 45.0
    camera_height: _Positive = 1.2
    pitch_deg: Annotated[float, Field(strict=True, gt=-90, lt=90)] = 15.0

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


def planar_poses(drive: DrivePlan, rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the robot is at regular times.

    Args:
        drive: the drive.
        rate: poses per second.

    Returns:
        Stamps from 0 [s], shape (N,), and x, y, yaw [m, m, rad], shape (N, 3). The yaw is
        continuous: it does not jump at +-pi.

    Raises:
        ValueError: If the rate is not a positive number.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f"the rate must be a positive number, got {rate}")
    times, _ = _knots(drive)
    stamps = np.arange(math.floor(times[-1] * rate + 1e-9) + 1) / rate
    return stamps, poses_at(drive, stamps)


def poses_at(drive: DrivePlan, stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the robot is at some times [s]: x, y, yaw [m, m, rad], shape (N, 3).

    It is at rest before it starts and after it arrives.
    """
    times, knots = _knots(drive)
    return np.column_stack([np.interp(stamps, times, knots[:, i]) for i in range(3)])


def camera_poses(poses: ArrayLike, drive: DrivePlan) -> NDArray[np.float64]:
    """Return `map_T_camera` of the optical frame (x right, y down, z forward).

    Args:
        poses: x, y, yaw of the robot [m, m, rad], shape (N, 3).
        drive: the height and pitch of the camera.

    Returns:
        Shape (N, 4, 4).
    """
    x, y, yaw = np.asarray(poses, dtype=np.float64).reshape(-1, 3).T
    cos, sin = np.cos(yaw), np.sin(yaw)
    down, level = math.sin(math.radians(drive.pitch_deg)), math.cos(math.radians(drive.pitch_deg))
    zero, one = np.zeros_like(x), np.ones_like(x)
    matrix = np.zeros((len(x), 4, 4))
    matrix[:, :3, 0] = np.column_stack([sin, -cos, zero])
    matrix[:, :3, 1] = np.column_stack([-down * cos, -down * sin, -level * one])
    matrix[:, :3, 2] = np.column_stack([level * cos, level * sin, -down * one])
    matrix[:, :3, 3] = np.column_stack([x, y, drive.camera_height * one])
    matrix[:, 3, 3] = 1
    return matrix


def _knots(drive: DrivePlan) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times and poses between which the robot turns or drives evenly."""
    turn_rate = math.radians(drive.turn_rate_deg)
    x, y, *look = drive.waypoints[0]
    heading = _heading_of_first_leg(drive) if not look else math.radians(look[0])
    times, knots = [0.0], [(x, y, heading)]

    def turn_to(yaw: float) -> None:
        x, y, now = knots[-1]
        angle = math.remainder(yaw - now, math.tau)  # the shorter way round
        if abs(angle) > _STILL:
            times.append(times[-1] + abs(angle) / turn_rate)
            knots.append((x, y, now + angle))

    for x, y, *look in drive.waypoints[1:]:
        x0, y0, _ = knots[-1]
        distance = math.hypot(x - x0, y - y0)
        if distance > _STILL:
            turn_to(math.atan2(y - y0, x - x0))
            times.append(times[-1] + distance / drive.speed)
            knots.append((x, y, knots[-1][2]))
        if look:
            turn_to(math.radians(look[0]))
    return np.array(times), np.array(knots)


def _heading_of_first_leg(drive: DrivePlan) -> float:
    (x0, y0, *_), *others = drive.waypoints
    for x, y, *_ in others:
        if math.hypot(x - x0, y - y0) > _STILL:
            return math.atan2(y - y0, x - x0)
    return 0.0
