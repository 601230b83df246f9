"""How far poses are off: the absolute and the relative error of a trajectory.

Source: Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, section V.
Unlike there, trajectories are not aligned first: poses and truth are in the frame of one map, and a
pose that is off in it puts objects in the wrong place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_SOON = 1e-6  # seconds by which a pose may come too early


@dataclass(frozen=True)
class PoseErrors:
    """Errors of a trajectory, as root mean squares; None where there are too few poses.

    Attributes:
        poses: how many there are.
        ate: absolute trajectory error: of the positions [m].
        ate_deg: of the orientations [degrees].
        rpe: relative pose error: of the way between two poses [m].
        rpe_deg: of the turn between them [degrees].
    """

    poses: int
    ate: float | None
    ate_deg: float | None
    rpe: float | None
    rpe_deg: float | None


def pose_errors(
    stamps: Sequence[float], estimated: ArrayLike, true: ArrayLike, over: float = 1.0
) -> PoseErrors:
    """Return the errors of N poses.

    Args:
        stamps: of the poses, rising [s], N of them.
        estimated: the poses, shape (N, 4, 4).
        true: where the camera really was, in the same frame, shape (N, 4, 4).
        over: relative errors are of a pose and the first one that is so much later [s].

    >>> steps = np.array([np.eye(4)] * 3)
    >>> ahead = steps.copy()
    >>> ahead[:, 0, 3] = 0.0, 0.1, 0.2
    >>> errors = pose_errors([0.0, 1.0, 2.0], ahead, steps)
    >>> round(errors.ate, 3), round(errors.rpe, 3), errors.rpe_deg
    (0.129, 0.1, 0.0)
    """
    ours = np.asarray(estimated, dtype=float).reshape(-1, 4, 4)
    exact = np.asarray(true, dtype=float).reshape(-1, 4, 4)
    times = np.asarray(stamps, dtype=float)
    later = np.searchsorted(times, times + over - _SOON)
    first = np.flatnonzero(later < len(times))
    later = later[first]
    ways = _between(_between(exact[first], exact[later]), _between(ours[first], ours[later]))
    turned = np.swapaxes(exact[:, :3, :3], 1, 2) @ ours[:, :3, :3]
    return PoseErrors(
        len(times),
        _rms(np.linalg.norm(ours[:, :3, 3] - exact[:, :3, 3], axis=1)),
        _rms(_angles(turned)),
        _rms(np.linalg.norm(ways[:, :3, 3], axis=1)),
        _rms(_angles(ways[:, :3, :3])),
    )


def _between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the poses b as seen from the poses a, shape (N, 4, 4)."""
    return np.asarray(np.linalg.inv(a) @ b)


def _angles(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angle of each rotation [degrees], also of small ones, shape (N,)."""
    far = np.linalg.norm(rotations - np.eye(3), axis=(1, 2)) / (2 * np.sqrt(2))
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(far, 1.0))))


def _rms(values: NDArray[np.float64]) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
