"""Rigid motions in space: 4 x 4 poses and the interpolation of a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.errors import FrameError

_ROUNDED = 1e-6  # seconds by which a stamp may be off, as files round it


def pose_matrix(position: ArrayLike, quat_xyzw: ArrayLike) -> NDArray[np.float64]:
    """Return rigid transforms from positions (..., 3) [m] and quaternions (..., 4).

    Quaternions need not have unit length.

    Returns:
        Shape (..., 4, 4).

    Raises:
        ValueError: If a quaternion is zero or a number is not finite.
    """
    p = np.asarray(position, dtype=np.float64)
    q = np.asarray(quat_xyzw, dtype=np.float64)
    x, y, z, w = np.moveaxis(_unit(q), -1, 0)
    if not np.isfinite(p).all():
        raise ValueError("a position must be finite")
    matrix = np.zeros((*np.broadcast_shapes(p.shape[:-1], q.shape[:-1]), 4, 4))
    matrix[..., 0, 0] = 1 - 2 * (y * y + z * z)
    matrix[..., 0, 1] = 2 * (x * y - z * w)
    matrix[..., 0, 2] = 2 * (x * z + y * w)
    matrix[..., 1, 0] = 2 * (x * y + z * w)
    matrix[..., 1, 1] = 1 - 2 * (x * x + z * z)
    matrix[..., 1, 2] = 2 * (y * z - x * w)
    matrix[..., 2, 0] = 2 * (x * z - y * w)
    matrix[..., 2, 1] = 2 * (y * z + x * w)
    matrix[..., 2, 2] = 1 - 2 * (x * x + y * y)
    matrix[..., :3, 3] = p
    matrix[..., 3, 3] = 1
    return matrix


def pose_from_rpy(
    x: float, y: float, z: float, roll: float, pitch: float, yaw: float
) -> NDArray[np.float64]:
    """Return a rigid transform from a position [m] and rotations about fixed x, y and z axes [rad].

    Returns:
        Shape (4, 4).

    Source: REP 103, fixed axis rotation, order x, y, z.

    >>> pose_from_rpy(1, 2, 3, 0, 0, np.pi / 2)[:3].round(3)
    array([[ 0., -1.,  0.,  1.],
           [ 1.,  0.,  0.,  2.],
           [ 0.,  0.,  1.,  3.]])
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3] = about_z @ about_y @ about_x
    pose[:3, 3] = x, y, z
    return pose


def rpy_from_pose(pose: NDArray[np.float64]) -> tuple[float, float, float, float, float, float]:
    """Return x, y, z [m], roll, pitch and yaw [rad] of a rigid transform, shape (4, 4).

    At a pitch of 90 degrees, where roll and yaw rotate about the same axis, yaw is 0.

    >>> [round(number, 3) for number in rpy_from_pose(pose_from_rpy(1, 2, 3, 0.1, -0.2, 3))]
    [1.0, 2.0, 3.0, 0.1, -0.2, 3.0]
    """
    x, y, z = (float(number) for number in pose[:3, 3])
    level = float(np.hypot(pose[0, 0], pose[1, 0]))
    pitch = float(np.arctan2(-pose[2, 0], level))
    if level < 1e-9:
        return x, y, z, float(np.arctan2(-pose[1, 2], pose[1, 1])), pitch, 0.0
    roll, yaw = np.arctan2(pose[2, 1], pose[2, 2]), np.arctan2(pose[1, 0], pose[0, 0])
    return x, y, z, float(roll), pitch, float(yaw)


def quats_of(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit quaternions x, y, z, w, shape (N, 4), of rotation matrices, shape (N, 3, 3).

    Source: Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix", 2000:
    the eigenvector of the largest eigenvalue, so that no angle is special.
    """
    R = np.asarray(rotations, dtype=np.float64)
    K = np.zeros((len(R), 4, 4))
    for i in range(3):
        for j in range(3):
            K[:, i, j] = R[:, i, j] + R[:, j, i]
        K[:, i, i] = 2 * R[:, i, i] - np.trace(R, axis1=1, axis2=2)
        after, last = (i + 1) % 3, (i + 2) % 3
        K[:, i, 3] = K[:, 3, i] = R[:, last, after] - R[:, after, last]
    K[:, 3, 3] = np.trace(R, axis1=1, axis2=2)
    return np.asarray(np.linalg.eigh(K)[1][:, :, -1])


def compose(*poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `a_T_c` from `a_T_b` and `b_T_c`, and so on; shapes (..., 4, 4) broadcast."""
    result = np.eye(4)
    for pose in poses:
        result = result @ pose
    return result


def invert(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of rigid transforms, shape (..., 4, 4)."""
    rotation = np.swapaxes(pose[..., :3, :3], -1, -2)
    inverse = np.zeros_like(pose)
    inverse[..., :3, :3] = rotation
    inverse[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, pose[..., :3, 3])
    inverse[..., 3, 3] = 1
    return inverse


def transform_points(
    a_T_b: NDArray[np.float64], points_xyz: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return points given in frame b, float32, shape (..., 3), as points in frame a."""
    # A matrix product would go to BLAS, whose threads cost more than they save on three columns;
    # einsum is slower than contiguous columns.
    rotation, translation = a_T_b[:3, :3].astype(np.float32), a_T_b[:3, 3].astype(np.float32)
    x, y, z = (np.ascontiguousarray(points_xyz[..., axis]) for axis in range(3))
    moved = np.empty(points_xyz.shape, np.float32)
    for axis, (to_x, to_y, to_z) in enumerate(rotation):
        moved[..., axis] = x * to_x + y * to_y + z * to_z + translation[axis]
    return moved


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses over time; between two poses the position is linear and the rotation a slerp.

    Attributes:
        stamps: seconds, strictly increasing, shape (N,).
        positions: meters, shape (N, 3).
        quats_xyzw: rotations, shape (N, 4); need not have unit length.
        max_gap: seconds between two poses above which nothing is interpolated.

    Raises:
        ValueError: If there is no pose, the shapes do not match, a number is not finite, a
            quaternion is zero, or the stamps do not increase.
    """

    stamps: NDArray[np.float64]
    positions: NDArray[np.float64]
    quats_xyzw: NDArray[np.float64]
    max_gap: float = np.inf

    def __post_init__(self) -> None:
        if self.stamps.ndim != 1:
            raise ValueError(f"expected stamps of shape (N,), got {self.stamps.shape}")
        n = len(self.stamps)
        if n == 0:
            raise ValueError("a trajectory needs at least one pose")
        if self.positions.shape != (n, 3) or self.quats_xyzw.shape != (n, 4):
            raise ValueError(
                f"expected positions ({n}, 3) and quaternions ({n}, 4), "
                f"got {self.positions.shape} and {self.quats_xyzw.shape}"
            )
        if not (np.isfinite(self.stamps).all() and np.isfinite(self.positions).all()):
            raise ValueError("stamps and positions of a trajectory must be finite")
        if not (np.diff(self.stamps) > 0).all():
            raise ValueError("the stamps of a trajectory must increase")
        _unit(self.quats_xyzw)

    def covers(self, stamps: ArrayLike) -> NDArray[np.bool_]:
        """Return whether a pose can be interpolated at each stamp, shape (M,), or 1 us beside."""
        t = np.atleast_1d(np.asarray(stamps, dtype=np.float64))
        after = np.clip(np.searchsorted(self.stamps, t), 1, max(len(self.stamps) - 1, 1))
        inside = (t >= self.stamps[0] - _ROUNDED) & (t <= self.stamps[-1] + _ROUNDED)
        if len(self.stamps) == 1:
            return np.asarray(inside)
        gap = self.stamps[after] - self.stamps[after - 1]
        off = np.minimum(np.abs(t - self.stamps[after]), np.abs(t - self.stamps[after - 1]))
        return np.asarray(inside & ((gap <= self.max_gap) | (off <= _ROUNDED)))

    def at(self, stamps: ArrayLike) -> NDArray[np.float64]:
        """Return the poses at stamps of shape (M,), as matrices of shape (M, 4, 4).

        Raises:
            FrameError: If a stamp is outside the trajectory or in a gap longer than `max_gap`.
        """
        t = np.atleast_1d(np.asarray(stamps, dtype=np.float64))
        missing = ~self.covers(t)
        if missing.any():
            raise FrameError(
                f"no pose at {t[missing][0]:.6f} s: poses reach from {self.stamps[0]:.6f} "
                f"to {self.stamps[-1]:.6f} s (gaps up to {self.max_gap:g} s are bridged)"
            )
        if len(self.stamps) == 1:
            return np.repeat(pose_matrix(self.positions, self.quats_xyzw), len(t), axis=0)
        t = np.clip(t, self.stamps[0], self.stamps[-1])
        i = np.clip(np.searchsorted(self.stamps, t), 1, len(self.stamps) - 1)
        t0, t1 = self.stamps[i - 1], self.stamps[i]
        weight = ((t - t0) / (t1 - t0))[:, np.newaxis]
        position = (1 - weight) * self.positions[i - 1] + weight * self.positions[i]
        return pose_matrix(position, _slerp(self.quats_xyzw[i - 1], self.quats_xyzw[i], weight))


def trajectory_of(
    stamps: NDArray[np.float64], poses: NDArray[np.float64], max_gap: float = np.inf
) -> Trajectory:
    """Return the trajectory through rigid transforms, shape (N, 4, 4); raises like its class."""
    return Trajectory(stamps, poses[:, :3, 3], quats_of(poses[:, :3, :3]), max_gap)


def _slerp(
    q0: NDArray[np.float64], q1: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Interpolate unit quaternions along the shorter arc (Shoemake, SIGGRAPH 1985)."""
    q0, q1 = _unit(q0), _unit(q1)
    cosine = np.sum(q0 * q1, axis=1, keepdims=True)
    q1 = np.where(cosine < 0, -q1, q1)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
    sine = np.sin(angle)
    nearly_equal = sine < 1e-6
    safe = np.where(nearly_equal, 1.0, sine)
    w0 = np.where(nearly_equal, 1 - weight, np.sin((1 - weight) * angle) / safe)
    w1 = np.where(nearly_equal, weight, np.sin(weight * angle) / safe)
    return np.asarray(w0 * q0 + w1 * q1)


def _unit(quats: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return quaternions (..., 4) with unit length.

    Raises:
        ValueError: If one is zero or not finite.
    """
    # The largest component first: squares of tiny and huge numbers would vanish or overflow.
    largest = np.abs(quats).max(axis=-1, keepdims=True)
    if not (np.isfinite(largest) & (largest > 0)).all():
        raise ValueError("a quaternion must be finite and other than zero")
    scaled = quats / largest
    return np.asarray(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))
