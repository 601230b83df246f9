"""Consistency of depth images and poses: images must show the same surface in the same place.

Points of one depth image are projected into another by the poses of both. If the poses are right,
the other image has the same depth there. If it agrees only with the poses of a moment later, the
clocks of poses and images differ; if only with all depth multiplied, the unit of depth is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import trajectory_of
from hypermap.mapping.depth_views import (
    Comparison,
    DepthView,
    displacements,
    overlapping_pairs,
    poses_of,
    relative_moves,
    view_of,
)
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.pose_convention import CONVENTIONS, OPTICAL, optical_poses

_MOST_VIEWS = 48  # kept; then every other view is dropped, and only every other one added
_MOST_POSES = 20_000  # after which frames are ignored
_FEWEST_VIEWS, _FEWEST_PAIRS = 8, 6
_MAX_GAP = 0.5  # seconds; poses are not interpolated across a larger gap
_WORST = 0.8  # mean difference over its cap, above which images do not agree
_CLEARLY = 0.7  # another reading of the poses must reduce the mean difference to this share
_TELLING_MOVE, _TELLING_ANGLE = 0.3, 0.15  # meters and rad between images whose poses are read
_SURE = 3.0  # standard errors by which the mean difference must be smaller
_LEAST_GAIN = 0.02  # of the difference over its cap; less is rounding, as of a camera at rest
_OFFSETS = np.linspace(-0.78, 0.78, 27)  # seconds
_REACH = 0.9  # seconds before and after an image for which poses must be known
_FINE_OFFSETS = np.linspace(-0.04, 0.04, 5)
_TRIED = 0.1  # seconds by which poses are shifted to find the pairs that depend on time
_SCALES = 11.0 ** np.linspace(-1.0, 1.0, 25)
_FINE_SCALES = np.linspace(0.85, 1.15, 7)


@dataclass(frozen=True)
class Fit:
    """The time offset or depth scale with which depth images and poses agree best.

    Attributes:
        value: an offset [s] or a factor.
        is_sure: whether they agree clearly better than as recorded.
        moves: how far objects in the map are displaced without it [m].
    """

    value: float
    is_sure: bool
    moves: float = 0.0


@dataclass(frozen=True)
class PoseReading:
    """How poses must be read for depth images to agree.

    Attributes:
        convention: one of `CONVENTIONS`.
        turn_deg: rotation of the images about the optical axis that the poses lack [degrees]: 0,
            90, 180 or 270.
    """

    convention: str = OPTICAL
    turn_deg: int = 0


class Consistency:
    """Collects the poses of all frames and samples of their depth, and compares them."""

    def __init__(self) -> None:
        self._views: list[DepthView] = []
        self._stamps: list[float] = []
        self._poses: list[NDArray[np.float64]] = []
        self._every, self._seen = 1, 0
        self._rng = np.random.default_rng(0)

    def add(self, frame: RgbdFrame) -> None:
        """Add a frame with a valid pose, in order of time."""
        is_late = bool(self._stamps) and frame.stamp <= self._stamps[-1]
        if is_late or len(self._stamps) == _MOST_POSES:
            return
        self._stamps.append(frame.stamp)
        self._poses.append(frame.map_T_camera)
        self._seen += 1
        if (self._seen - 1) % self._every:
            return
        view = view_of(frame, self._rng)
        if view is None or (self._views and view.depth.shape != self._views[0].depth.shape):
            return
        self._views.append(view)
        if len(self._views) > _MOST_VIEWS:
            self._views, self._every = self._views[::2], 2 * self._every

    def time_offset(self) -> Fit | None:
        """Return the delay from an image's stamp to the stamp of its pose [s].

        None if unknown: frames are too far apart, or the camera moved too uniformly.
        """
        if len(self._stamps) < _FEWEST_VIEWS:
            return None
        stamps, poses = np.array(self._stamps), np.array(self._poses)
        trajectory = trajectory_of(stamps, poses, _MAX_GAP)
        kept = np.array([view.stamp for view in self._views])
        ends = (-_REACH, -_REACH / 2, 0.0, _REACH / 2, _REACH)
        known = np.all([trajectory.covers(kept + end) for end in ends], axis=0)
        views = [view for view, is_known in zip(self._views, known, strict=True) if is_known]
        if len(views) < _FEWEST_VIEWS:
            return None
        earlier, later = (trajectory.at(kept[known] + tried) for tried in (-_TRIED, _TRIED))
        pairs = overlapping_pairs(
            poses_of(views), lambda i, j: relative_moves(earlier, later, i, j)
        )
        compare = Comparison(views, *pairs)
        fit = _best(
            lambda offset: compare.in_disparity(trajectory.at(kept[known] + offset)),
            _OFFSETS,
            lambda best: best + _FINE_OFFSETS,
            as_recorded=0.0,
        )
        if fit is None or not fit.is_sure:
            return fit
        moves = displacements(*(trajectory.at(kept[known] + at) for at in (0.0, fit.value)))
        return replace(fit, moves=float(np.median(moves)))

    def depth_scale(self) -> Fit | None:
        """Return the factor by which all depth must be multiplied.

        None if unknown: the camera has hardly moved.
        """
        if len(self._views) < _FEWEST_VIEWS:
            return None
        poses = poses_of(self._views)
        apart = np.linalg.norm(poses[:, np.newaxis, :3, 3] - poses[:, :3, 3], axis=2)
        pairs = overlapping_pairs(poses, lambda i, j: np.minimum(apart[i, j], 1.0))
        compare = Comparison(self._views, *pairs)
        return _best(
            lambda scale: compare.in_depth(poses, scale),
            _SCALES,
            lambda best: best * _FINE_SCALES,
            as_recorded=1.0,
            # With much larger depth, motion between images hardly matters. If poses drift, that
            # alone makes images agree better, and says nothing about the unit of depth.
            others=(float(_SCALES[-1]),),
        )

    def usual_step(self) -> tuple[float, float]:
        """Return how far the camera moves from one frame to the next [m], and how fast [m/s].

        The medians; 0 for less than two frames.
        """
        if len(self._stamps) < 2:
            return 0.0, 0.0
        steps = np.linalg.norm(np.diff(np.array(self._poses)[:, :3, 3], axis=0), axis=1)
        return float(np.median(steps)), float(np.median(steps / np.diff(self._stamps)))

    def gain_of(self, others: Mapping[float, NDArray[np.float64]]) -> float | None:
        """Return how much better the images agree by other poses than by their own.

        Args:
            others: `map_T_camera` of frames by their stamps, shape (4, 4).

        Returns:
            The mean gain over its standard error; None if too few images overlap.
        """
        views = [view for view in self._views if view.stamp in others]
        if len(views) < _FEWEST_VIEWS:
            return None
        own = poses_of(views)
        other = np.array([others[view.stamp] for view in views])
        compare = Comparison(
            views, *overlapping_pairs(own, lambda i, j: relative_moves(own, other, i, j))
        )
        costs = np.array([compare.in_disparity(poses) for poses in (own, other)])
        before, after = costs[:, costs.min(axis=0) < _WORST]
        if len(before) < _FEWEST_PAIRS:
            return None
        gain = before - after
        error = float(gain.std(ddof=1)) / math.sqrt(len(gain))
        return float(gain.mean()) / max(error, 1e-9)

    @property
    def stamps(self) -> set[float]:
        """The stamps of the frames whose depth is kept [s]."""
        return {view.stamp for view in self._views}

    def reading(self) -> PoseReading:
        """Return how the poses must be read for images to agree; as they are if that is unknown."""
        if len(self._views) < _FEWEST_VIEWS:
            return PoseReading()
        poses = poses_of(self._views)
        quarter = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        others = {
            PoseReading(turn_deg=90 * k): poses @ np.linalg.matrix_power(quarter, k)
            for k in (1, 2, 3)
        } | {
            PoseReading(convention): optical_poses(poses, convention)
            for convention in CONVENTIONS
            if convention != OPTICAL
        }
        best, least = PoseReading(), self._difference(poses, poses)
        least = math.inf if least is None else _CLEARLY * least - _LEAST_GAIN
        for reading, other in others.items():
            mean, as_recorded = self._difference(other, other), self._difference(poses, other)
            if mean is not None and as_recorded is not None:
                is_better = mean < _CLEARLY * as_recorded and mean < least
                best, least = (reading, mean) if is_better else (best, least)
        return best

    def _difference(self, poses: NDArray[np.float64], overlap: NDArray[np.float64]) -> float | None:
        """Return how much images differ by some poses, 0..1; None if too few overlap by others.

        The pairs are those between which the camera moved and turned enough to tell, but not so
        much that they show different things.

        Args:
            poses: `map_T_camera` of all views, shape (V, 4, 4).
            overlap: poses by which pairs are chosen, shape (V, 4, 4).
        """
        apart = np.linalg.norm(overlap[:, np.newaxis, :3, 3] - overlap[:, :3, 3], axis=2)
        angle = np.arccos(np.clip(overlap[:, :3, 2] @ overlap[:, :3, 2].T, -1, 1))
        odd = np.abs(apart / _TELLING_MOVE - 1) + np.abs(angle / _TELLING_ANGLE - 1)
        pairs = overlapping_pairs(overlap, lambda i, j: -odd[i, j])
        if len(pairs[0]) < _FEWEST_PAIRS:
            return None
        return float(Comparison(self._views, *pairs).in_disparity(poses).mean())


def _best(
    costs_at: Callable[[float], NDArray[np.float64]],
    values: NDArray[np.float64],
    finer: Callable[[float], NDArray[np.float64]],
    as_recorded: float,
    others: tuple[float, ...] = (),
) -> Fit | None:
    """Return the value at which the pairs differ least.

    None if too few pairs agree at any value, or the best is at an end, as a better may lie beyond.

    Args:
        costs_at: how much each pair differs at a value, shape (P,).
        values: to try.
        finer: returns more values to try around the best one.
        as_recorded: the value of the unchanged recording.
        others: further values that the best must clearly beat.
    """
    costs = np.array([costs_at(value) for value in values])
    agree = costs.min(axis=0) < _WORST
    if np.count_nonzero(agree) < _FEWEST_PAIRS:
        return None
    best = int(np.argmin(costs[:, agree].mean(axis=1)))
    if best in (0, len(values) - 1):
        return None
    near = finer(float(values[best]))
    fine = np.array([costs_at(value) for value in near])[:, agree]
    means = fine.mean(axis=1)
    best = int(np.argmin(means))
    if means[best] > _WORST:
        return None
    gains = [costs_at(value)[agree] - fine[best] for value in (as_recorded, *others)]
    errors = [float(gain.std(ddof=1)) / math.sqrt(len(gain)) for gain in gains]
    is_sure = all(
        gain.mean() > max(_SURE * error, _LEAST_GAIN)
        for gain, error in zip(gains, errors, strict=True)
    )
    return Fit(float(near[best]), is_sure)
