"""Objects as landmarks: corrections of frames that make them agree on where objects are.

Poses are off by some centimeters, even after correction by a map that is itself distorted. Then two
frames see one object in two places, and an object that few frames show is where their errors put
it. But a frame that shows a cup also shows the table and the screen next to it, which many frames
have shown: their places reveal the error of the cup's place.

Source: joint least squares over poses and landmarks, as in Dellaert and Kaess, "Square root SAM",
IJRR 25(12), 2006, here over centroids on the floor, by alternating optimization. Outliers get the
weights of Huber, "Robust estimation of a location parameter", 1964. The pose errors are unknown;
their variance is estimated by expectation maximization (Dempster, Laird, Rubin, 1977), so exact
poses stay unchanged.

Poses that were corrected by a bent map agree with each other, but not with the world. The recorded
poses are a second witness, whose larger errors average out over many frames. So the more the map
is bent (`map_bend`), the nearer to its recorded pose a frame is expected, up to half way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.mapping.evidence_buffer import EvidenceBuffer
from hypermap.mapping.footprint_alignment import shows_whole
from hypermap.mapping.map_bend import bend_of_map

_NOISE = 0.02  # standard deviation of the centroid of a footprint [m], plus ...
_NOISE_SHARE = 0.05  # ... as a share of the object's size
_POSITION, _TURN = 0.05, 0.017  # initial standard deviations of a pose [m, rad]
_LEAST_POSITION, _LEAST_TURN = 0.005, 0.0005  # lower bounds, against division by zero
_MOST_POSITION, _MOST_TURN = 0.15, 0.035
_EXACT = 0.01  # meters; poses with smaller errors stay, because centroids are no better
_SURE = 2.0  # standard deviations up to which an observation has its full weight
_OUTLIER = 6.0  # standard deviations from which it has none
_ROUNDS = 20
_RECORDED = 0.5  # share of the recorded pose in the expected one, if the map is bent
_STRAIGHT, _BENT = 0.005, 0.01  # meters; from where on a map is bent, and surely
_AHEAD = np.array([0.0, 0.0, 1.5, 1.0])  # what a camera looks at, in its optical frame [m]

Array = NDArray[np.float64]


def landmark_moves(buffers: Sequence[EvidenceBuffer]) -> list[Array]:
    """Return the shifts of all footprints that make frames agree on the objects' places.

    A frame moves as a whole: by x, y and a rotation about its camera. Footprints that show a part
    of their object move with their frame, but do not constrain it. Frames whose poses were
    corrected by a map are expected between their recorded and their corrected poses.

    Args:
        buffers: the evidence for each object.

    Returns:
        Shifts of the footprints of each object [m], shape (N, 2) for N pieces of evidence.
    """
    frames, numbers = _frames_of(buffers)
    sights = _Sights.of(buffers, numbers)
    if len(sights.frames) == 0:
        return [np.zeros((len(buffer), 2)) for buffer in buffers]
    corrections = _corrections(sights, _expected(buffers, numbers, frames))
    cameras_xy = np.array([(x, y) for _, x, y in frames])
    moves = []
    for buffer, shown_in in zip(buffers, numbers, strict=True):
        by = corrections[shown_in]
        moves.append(_moved(buffer.centroids - cameras_xy[shown_in], by))
    return moves


def _frames_of(
    buffers: Sequence[EvidenceBuffer],
) -> tuple[list[tuple[float, float, float]], list[IntArray]]:
    """Return all frames, as stamp, x and y, and the frame numbers of each buffer, shape (N,)."""
    keys = [
        [(item.stamp, *item.map_T_camera[:2, 3].tolist()) for item in buffer.items]
        for buffer in buffers
    ]
    frames = sorted({key for of_one in keys for key in of_one})
    number = {key: i for i, key in enumerate(frames)}
    return frames, [np.array([number[key] for key in of_one], np.int64) for of_one in keys]


def _expected(
    buffers: Sequence[EvidenceBuffer],
    numbers: Sequence[IntArray],
    frames: Sequence[tuple[float, float, float]],
) -> Array:
    """Return how each frame is expected to move [m, m, rad], shape (F, 3).

    If the map that has corrected its pose is bent, that is back toward the recorded pose.
    """
    recorded, seen_xy = np.zeros((len(frames), 3)), np.zeros((len(frames), 2))
    for buffer, shown_in in zip(buffers, numbers, strict=True):
        for item, frame in zip(buffer.items, shown_in.tolist(), strict=True):
            recorded[frame] = item.correction
            seen_xy[frame] = item.map_T_camera[:2] @ _AHEAD
    if not recorded.any():
        return recorded
    recorded *= -1
    stamps, cameras_xy = np.array(frames)[:, 0], np.array(frames)[:, 1:]
    bend = bend_of_map(stamps, seen_xy, _moved(seen_xy - cameras_xy, recorded))
    share = min(max((bend - _STRAIGHT) / (_BENT - _STRAIGHT), 0.0), 1.0)
    return share * _RECORDED * recorded


@dataclass(frozen=True, eq=False)
class _Sights:
    """Observations of whole objects that several frames show.

    Attributes:
        frames: the frame of each, shape (N,).
        objects: the object of each, shape (N,).
        counts: the number of observations of its object, shape (N,).
        xy: the centroid of each [m], shape (N, 2).
        rays: from the camera to there [m], shape (N, 2).
        sigmas: standard deviation of the centroid in x and in y [m], shape (N,).
    """

    frames: IntArray
    objects: IntArray
    counts: IntArray
    xy: Array
    rays: Array
    sigmas: Array

    @classmethod
    def of(cls, buffers: Sequence[EvidenceBuffer], numbers: Sequence[IntArray]) -> _Sights:
        """Select them from the evidence, given the frame numbers of each buffer."""
        frames, objects, xy, cameras, sizes = [], [], [], [], []
        for n, (buffer, shown_in) in enumerate(zip(buffers, numbers, strict=True)):
            if len(buffer) < 2:
                continue
            areas = np.array([item.prepared.area for item in buffer.items])
            whole = np.flatnonzero(shows_whole(areas))
            if len(whole) < 2:
                continue
            frames.append(shown_in[whole])
            objects.append(np.full(len(whole), n))
            xy.append(buffer.centroids[whole])
            cameras.append([buffer.items[i].map_T_camera[:2, 3] for i in whole])
            sizes.append(np.full(len(whole), np.sqrt(np.median(areas[whole]))))
        if not frames:
            nothing, nowhere = np.empty(0, np.int64), np.empty((0, 2))
            return cls(nothing, nothing, nothing, nowhere, nowhere, np.empty(0))
        of_object = np.concatenate(objects)
        places = np.concatenate(xy)
        return cls(
            np.concatenate(frames),
            of_object,
            np.bincount(of_object)[of_object],
            places,
            places - np.concatenate(cameras),
            np.hypot(_NOISE, _NOISE_SHARE * np.concatenate(sizes)),
        )


def _corrections(sights: _Sights, expected: Array) -> Array:
    """Return x, y [m] and rotation [rad] of each frame, shape (F, 3), given the expected ones.

    Alternates between the places of objects given the frames, the errors of frames given these,
    and the variance of these errors.
    """
    corrections, count = expected, len(expected)
    weights = sights.sigmas**-2.0
    prior = np.array([_POSITION, _POSITION, _TURN])
    seen = np.unique(sights.frames)
    least = [_LEAST_POSITION, _LEAST_POSITION, _LEAST_TURN]
    most = [_MOST_POSITION, _MOST_POSITION, _MOST_TURN]
    for _ in range(_ROUNDS):
        moved = sights.xy + _moved(sights.rays, corrections[sights.frames])
        places = _places_by_others(sights, moved, weights)
        away = np.hypot(*(moved - places).T) / sights.sigmas
        weights = np.where(away < _OUTLIER, np.minimum(1, _SURE / np.maximum(away, _SURE)), 0.0)
        weights *= sights.sigmas**-2.0
        information, pull = _normal_equations(sights, places - sights.xy, weights, count)
        covariances = np.linalg.inv(information + np.diag(prior**-2.0))
        pull += expected * prior**-2.0
        corrections = np.einsum("fij,fj->fi", covariances, pull)
        squares = (corrections - expected) ** 2 + np.einsum("fii->fi", covariances)
        variances = squares[seen].mean(axis=0)
        variances[:2] = variances[:2].mean()
        prior = np.clip(np.sqrt(variances), least, most)
    return corrections if prior[0] > _EXACT else expected


def _moved(rays: Array, corrections: Array) -> Array:
    """Return how far points move with their frames.

    Args:
        rays: from the frame's camera to each point [m], shape (N, 2).
        corrections: x, y [m] and rotation [rad] of each point's frame, shape (N, 3).
    """
    across = np.column_stack([-rays[:, 1], rays[:, 0]])  # for small angles
    return np.asarray(corrections[:, :2] + corrections[:, 2:] * across)


def _places_by_others(sights: _Sights, moved: Array, weights: Array) -> Array:
    """Return the place of each observation's object by its other observations [m], (N, 2)."""
    totals = np.bincount(sights.objects, weights)[sights.objects] - weights
    places = moved.copy()  # where there is no other
    is_seen = totals > 1e-9
    for axis in range(2):
        weighted = weights * moved[:, axis]
        others = np.bincount(sights.objects, weighted)[sights.objects] - weighted
        places[is_seen, axis] = others[is_seen] / totals[is_seen]
    return places


def _normal_equations(
    sights: _Sights, offsets: Array, weights: Array, count: int
) -> tuple[Array, Array]:
    """Return the normal equations of each frame's correction.

    Args:
        sights: the observations.
        offsets: error of each [m], shape (N, 2).
        weights: inverse variances [1/m²], shape (N,).
        count: number of frames.

    Returns:
        Information matrices, shape (count, 3, 3), and information times correction, shape
        (count, 3).
    """
    # An object's place is known only as well as its other observations determine it.
    weights = weights * (sights.counts - 1) / sights.counts
    x, y = sights.rays.T
    dx, dy = offsets.T

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(sights.frames, weights * values, count), dtype=float)

    information = np.zeros((count, 3, 3))
    information[:, 0, 0] = information[:, 1, 1] = total(np.ones(len(x)))
    information[:, 0, 2] = information[:, 2, 0] = total(-y)
    information[:, 1, 2] = information[:, 2, 1] = total(x)
    information[:, 2, 2] = total(x * x + y * y)
    pull = np.stack([total(dx), total(dy), total(x * dy - y * dx)], axis=1)
    return information, pull
