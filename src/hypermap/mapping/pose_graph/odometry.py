"""The uncertainty of relative poses in a recording: twice the usual errors of odometry."""

from __future__ import annotations

import math

import numpy as np

from hypermap.mapping.pose_graph.planar import Array

_WAY, _TURN = 10.0, math.tau  # [m, rad] over which errors are as large as the shares say
_POSITION = 0.02  # standard deviation as a share of the way
_YAW_BY_WAY = math.radians(0.2)  # of the heading [rad/m]
_YAW_BY_TURN = 0.02  # of the heading as a share of the turn
_LEAST = np.array([0.002, 0.002, 0.0005])  # standard deviations without any motion [m, m, rad]


def information_of(a_T_b: Array) -> Array:
    """Return the inverse of the covariance of a relative pose, shape (3, 3).

    The errors are those of a random walk: variances grow with the way and the turn.
    """
    way, turn = float(np.hypot(*a_T_b[:2])), abs(float(a_T_b[2]))
    position = _POSITION**2 * _WAY * way
    yaw = _YAW_BY_WAY**2 * _WAY * way + _YAW_BY_TURN**2 * _TURN * turn
    return np.diag(1 / (np.array([position, position, yaw]) + _LEAST**2))
