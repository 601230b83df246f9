"""The errors of localization, clocks and the camera's mounting; each can be set to zero."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hypermap.simulation.odometry import drifted
from hypermap.simulation.ranges import check_not_negative


@dataclass(frozen=True)
class PoseNoise:
    """The errors of the camera's poses. None by default.

    Attributes:
        position: standard deviation in x and in y of the error that changes every frame [m].
        yaw_deg: the same for the heading [degrees].
        drift: standard deviation in x and in y of an error that changes slowly [m].
        drift_yaw_deg: the same for the heading [degrees].
        drift_time: time constant of the slow error [s].
        jump_interval: mean time between jumps to another such error, as when a robot relocalizes
            [s]; 0 for no jumps.
        odometry: standard deviation of the position after 10 m, as a share of that; poses then
            come from odometry, whose errors add up (see `odometry.drifted`).
        odometry_yaw_deg: the same for the heading, by distance alone [degrees per meter].
        odometry_turn: the same for the heading after a full turn, as a share of it.
        time_offset: seconds by which the poses are older than the images, as when clocks differ
            or images arrive late; may be negative.
        mounting_deg: angle between the true and the assumed mounting of the camera during the
            whole drive, about an axis that the seed chooses [degrees].
        mounting: distance between the two, in a direction that the seed chooses [m].

    The slow error is an Ornstein-Uhlenbeck process: it wanders, but stays bounded, as the error of
    localization in a known map does. A calibration would estimate the offsets of time and mounting
    [Furgale, Rehder, Siegwart, "Unified temporal and spatial calibration for multi-sensor systems",
    IROS 2013].
    """

    position: float = 0.0
    yaw_deg: float = 0.0
    drift: float = 0.0
    drift_yaw_deg: float = 0.0
    drift_time: float = 20.0
    jump_interval: float = 0.0
    odometry: float = 0.0
    odometry_yaw_deg: float = 0.0
    odometry_turn: float = 0.0
    time_offset: float = 0.0
    mounting_deg: float = 0.0
    mounting: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative(self, "position", "yaw_deg", "drift", "drift_yaw_deg", "drift_time")
        check_not_negative(self, "jump_interval", "mounting_deg", "mounting")
        check_not_negative(self, "odometry", "odometry_yaw_deg", "odometry_turn")
        if self.drift_time == 0:
            raise ValueError("drift_time must be positive")
        if not math.isfinite(self.time_offset):
            raise ValueError(f"time_offset must be a number of seconds, got {self.time_offset}")

    def estimate(
        self, stamps: NDArray[np.float64], poses: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Return x, y, yaw as localization reports them, shape (N, 3).

        Args:
            stamps: seconds, ascending, shape (N,).
            poses: true x, y, yaw [m, m, rad], shape (N, 3).
            rng: random number generator.
        """
        sigma = [self.position, self.position, math.radians(self.yaw_deg)]
        estimated = poses + rng.normal(size=poses.shape) * sigma
        if self.drift or self.drift_yaw_deg:
            estimated += self._slow_errors(stamps, rng)
        if self.odometry or self.odometry_yaw_deg or self.odometry_turn:
            yaw = math.radians(self.odometry_yaw_deg)
            counted = drifted(poses, self.odometry, yaw, self.odometry_turn, rng)
            estimated += counted - poses
        return estimated

    def mounting_error(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the assumed pose of the optical frame in the true one, shape (4, 4)."""
        axis, direction = rng.normal(size=(2, 3))
        error = np.eye(4)
        turn = math.radians(self.mounting_deg) * axis / np.linalg.norm(axis)
        error[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
        error[:3, 3] = self.mounting * direction / np.linalg.norm(direction)
        return error

    def _slow_errors(
        self, stamps: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        steps = np.diff(stamps)
        kept = np.exp(-steps / self.drift_time)
        if self.jump_interval:
            kept[rng.random(len(steps)) < -np.expm1(-steps / self.jump_interval)] = 0.0
        new = rng.normal(size=(len(stamps), 3))
        errors = new.copy()
        for i, share in enumerate(kept, start=1):
            errors[i] = share * errors[i - 1] + math.sqrt(1 - share**2) * new[i]
        return errors * [self.drift, self.drift, math.radians(self.drift_yaw_deg)]
