"""Samples of depth images, and how much they differ where they show the same, by given poses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.core.trajectory import invert
from hypermap.perception.frame import Camera, RgbdFrame

_COLUMNS = 80  # of a kept image, about
_NEAR, _FAR = 0.2, 6.0  # meters between which depth is compared
_SMOOTH = 0.02  # 1/m; a larger difference in disparity between two pixels is a depth edge
_POINTS = 120  # per image
_PAIRS = 40  # of images to compare
_OVERLAP = math.cos(math.radians(30))  # least cosine between two viewing directions
_APART = 1.5  # meters between two cameras, at most
_LEAST_SEEN = 0.4  # share of the points that the other image must show
_CAP = 0.03  # 1/m; a larger difference in disparity is an occlusion or a moving object
_RATIO_CAP = 0.1  # the same as a share of the depth
_LEVER = 2.0  # meters in front of the camera; the point whose motion is reported


@dataclass(frozen=True, eq=False)
class DepthView:
    """Samples of a frame.

    Attributes:
        stamp: of the frame [s].
        map_T_camera: its pose, shape (4, 4).
        camera: of `depth`.
        depth: along the optical axis, downsampled [m], shape (H, W).
        points: some on smooth surfaces, in the camera's frame [m], shape (N, 3).
    """

    stamp: float
    map_T_camera: NDArray[np.float64]
    camera: Camera
    depth: NDArray[np.float32]
    points: NDArray[np.float64]


def view_of(frame: RgbdFrame, rng: np.random.Generator) -> DepthView | None:
    """Return samples of a frame; None if too little of it is smooth."""
    step = max(1, round(frame.camera.width / _COLUMNS))
    camera, z = frame.camera.every(step), np.ascontiguousarray(frame.z[::step, ::step])
    with np.errstate(divide="ignore", invalid="ignore"):
        disparity = np.where((z > _NEAR) & (z < _FAR), 1 / z, np.nan)
        across = np.abs(np.diff(disparity, axis=1, append=np.nan))
        down = np.abs(np.diff(disparity, axis=0, append=np.nan))
        rows, columns = np.nonzero((across < _SMOOTH) & (down < _SMOOTH))  # False for NaN
    if len(rows) < _POINTS:
        return None
    chosen = rng.choice(len(rows), _POINTS, replace=False)
    v, u = rows[chosen], columns[chosen]
    points = np.asarray(frame.points(step)[v, u], np.float64)
    return DepthView(frame.stamp, frame.map_T_camera, camera, z, points)


def poses_of(views: list[DepthView]) -> NDArray[np.float64]:
    """Return `map_T_camera` of views, shape (V, 4, 4)."""
    return np.array([view.map_T_camera for view in views])


def overlapping_pairs(
    poses: NDArray[np.float64], key: Callable[[IntArray, IntArray], NDArray[np.float64]]
) -> tuple[IntArray, IntArray]:
    """Return the pairs of overlapping views with the largest keys, as two arrays of shape (P,).

    Args:
        poses: `map_T_camera` of all views, shape (V, 4, 4).
        key: returns a number for each pair, shape (P,).
    """
    i, j = np.nonzero(~np.eye(len(poses), dtype=bool))
    same_way = np.sum(poses[i, :3, 2] * poses[j, :3, 2], axis=1) > _OVERLAP
    is_near = np.linalg.norm(poses[i, :3, 3] - poses[j, :3, 3], axis=1) < _APART
    i, j = i[same_way & is_near], j[same_way & is_near]
    best = np.argsort(-key(i, j), kind="stable")[:_PAIRS]
    return i[best], j[best]


def relative_moves(
    earlier: NDArray[np.float64], later: NDArray[np.float64], i: IntArray, j: IntArray
) -> NDArray[np.float64]:
    """Return how much the pose of view j relative to view i changes between two sets of poses.

    Args:
        earlier: `map_T_camera` of all views, shape (V, 4, 4).
        later: likewise.
        i: a view of each pair, shape (P,).
        j: the other.

    Returns:
        The distance, and what the rotation does a lever away, together [m], shape (P,).
    """
    change = invert(earlier[j]) @ earlier[i] - invert(later[j]) @ later[i]
    turn = np.linalg.norm(change[:, :3, :3], axis=(1, 2))
    return np.asarray(np.linalg.norm(change[:, :3, 3], axis=1) + _LEVER * turn)


def displacements(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far a point in front of each camera moves between two sets of poses [m], (N,)."""
    ahead = np.array([0.0, 0.0, _LEVER, 1.0])
    return np.asarray(np.linalg.norm((one @ ahead - other @ ahead)[:, :3], axis=1))


class Comparison:
    """Pairs of views; points of the first are projected into the second.

    Args:
        views: of one camera.
        i: the first of each pair, shape (P,).
        j: the second.
    """

    def __init__(self, views: list[DepthView], i: IntArray, j: IntArray) -> None:
        self._i, self._j = i, j
        self._points = np.array([views[k].points for k in i]).reshape(len(i), _POINTS, 3)
        self._depths = np.array([view.depth for view in views])
        self._K = views[0].camera.K

    def in_disparity(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean capped difference of each pair, as a share of the cap, 0..1, shape (P,).

        Args:
            poses: `map_T_camera` of all views, shape (V, 4, 4).
        """
        z, there = self._both(poses, 1.0)
        return self._mean(np.abs(1 / z - 1 / there) / _CAP)  # noise is the same near and far

    def in_depth(self, poses: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
        """Return the same with all depth multiplied by a factor."""
        z, there = self._both(poses, scale)
        return self._mean(np.abs(z / there - 1) / _RATIO_CAP)  # which the factor leaves alone

    def _both(
        self, poses: NDArray[np.float64], scale: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return each point's depth in the second view, and the depth measured there [m], (P, N).

        NaN where the point is not visible.
        """
        j_T_i = invert(poses[self._j]) @ poses[self._i]
        rotations = np.swapaxes(j_T_i[:, :3, :3], 1, 2)
        moved = scale * self._points @ rotations + j_T_i[:, np.newaxis, :3, 3]
        K, (height, width) = self._K, self._depths.shape[1:]
        with np.errstate(invalid="ignore", divide="ignore"):
            z = np.where(moved[..., 2] > _NEAR * scale, moved[..., 2], np.nan)
            columns = np.rint(K[0, 0] * moved[..., 0] / z + K[0, 2])
            rows = np.rint(K[1, 1] * moved[..., 1] / z + K[1, 2])
            inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
            at = np.where(inside, rows, 0).astype(int), np.where(inside, columns, 0).astype(int)
            there = scale * self._depths[self._j[:, np.newaxis], at[0], at[1]].astype(np.float64)
            return z, np.where(inside & (there > 0) & (there < np.inf), there, np.nan)

    @staticmethod
    def _mean(differences: NDArray[np.float64]) -> NDArray[np.float64]:
        seen = np.isfinite(differences)
        total = np.where(seen, np.minimum(differences, 1.0), 0.0).sum(axis=1)
        counts = seen.sum(axis=1)
        is_enough = counts >= _LEAST_SEEN * differences.shape[1]
        return np.where(is_enough, total / np.maximum(counts, 1), 1.0)
