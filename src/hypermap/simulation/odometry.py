"""Poses by odometry, whose errors accumulate without bound."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_WAY = 10.0  # meters after which systematic and random errors are equally large
_TURN = math.tau  # likewise, radians of turning


def drifted(
    poses: NDArray[np.float64],
    share: float,
    yaw_per_meter: float,
    turn_share: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return poses as odometry integrates them from the first one, shape (N, 3).

    Half of the variance is from systematic errors, such as a wheel's diameter, which grow with the
    distance. The other half is a random walk, as from slipping wheels.

    Args:
        poses: true x, y, yaw [m, m, rad], yaw continuous, shape (N, 3).
        share: standard deviation of the position after 10 m, as a share of that.
        yaw_per_meter: likewise of the heading, by the way alone [rad/m].
        turn_share: likewise of the heading after a full turn, as a share of it.
        rng: random number generator.

    Source: Borenstein and Feng, "Measurement and correction of systematic odometry errors in mobile
    robots", 1996, for the two kinds; Thrun, Burgard, Fox, Probabilistic Robotics, 2005, section
    5.4, for errors by way and turn.
    """
    moves, turns = np.diff(poses[:, :2], axis=0), np.diff(poses[:, 2])
    way, turned = np.hypot(*moves.T), np.abs(turns)
    lasting = rng.normal(size=3) * math.sqrt(0.5)
    random = rng.normal(size=(len(turns), 4)) * math.sqrt(0.5)
    by_way = random[:, :3] * np.sqrt(_WAY * way)[:, np.newaxis]
    by_turn = random[:, 3] * np.sqrt(_TURN * turned)
    cos, sin = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    ahead = cos * moves[:, 0] + sin * moves[:, 1]
    aside = cos * moves[:, 1] - sin * moves[:, 0]
    ahead = ahead * (1 + share * lasting[0]) + share * by_way[:, 0]
    aside = aside + share * by_way[:, 1]
    yaws = np.empty(len(poses))
    yaws[0] = poses[0, 2]
    errors = yaw_per_meter * (lasting[1] * way + by_way[:, 2])
    errors += turn_share * (lasting[2] * turns + by_turn)
    yaws[1:] = poses[0, 2] + np.cumsum(turns + errors)
    cos, sin = np.cos(yaws[:-1]), np.sin(yaws[:-1])
    steps = np.column_stack([cos * ahead - sin * aside, sin * ahead + cos * aside])
    counted = np.column_stack([np.zeros((len(poses), 2)), yaws])
    counted[:, :2] = poses[0, :2]
    counted[1:, :2] += np.cumsum(steps, axis=0)
    return counted
