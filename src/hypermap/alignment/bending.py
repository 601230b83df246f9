"""Finds how one map is bent against another of the same place: a smooth field of small shifts.

The walls around each of many places are matched by themselves, from coarse to fine. What walls say
about a place counts only across them; elsewhere a place moves as its neighbors do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree

from hypermap.alignment.grids import Field, Scan, scan_of, wall_tolerance
from hypermap.alignment.matching import NotAligned
from hypermap.core.arrays import FloatArray
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap

_SPACING = 1.0  # [m] between two places
_PASSES = ((3.0, 0.8, 0.16), (2.0, 0.3, 0.075), (1.5, 0.1, 0.025))  # radius, reach and step [m]
_CAP = 0.4  # [m] up to which the distance to a wall counts
_SIGMA = 0.08  # [m] of the distance of a wall to the same wall
_TOGETHER = 10  # points with one common error, as those of a wall: so many count as one
_SMOOTH = 0.05  # [m] by which the shifts of two neighbors differ
_ROUNDS, _OFF = 4, 0.1  # [m] off the smooth field from which on a match counts little
_SMALL = 1.0  # [m] of the shift of any place, before anything is known
_FEWEST, _MOST_POINTS = 30, 400  # of walls around a place
_LEAST_AGREEMENT = 0.7  # share of walls
_LEAST_GAIN = 0.01  # share of walls
_GAIN = 0.5  # share of the walls that did not agree
_STEEPEST = 0.4  # by which a shift may change per meter


@dataclass(frozen=True, eq=False)
class Bend:
    """A field of shifts over the floor.

    Attributes:
        origin_xy: the first place [m], shape (2,).
        shifts: of each place, `_SPACING` apart [m], shape (H, W, 2).
        before: share of the walls in the area known to both that lie on walls of the other map.
        after: the same with these shifts.
    """

    origin_xy: FloatArray
    shifts: FloatArray
    before: float
    after: float

    @property
    def largest(self) -> float:
        """The largest shift [m]."""
        return float(np.linalg.norm(self.shifts, axis=2).max())

    def moved(self, points_xy: FloatArray) -> FloatArray:
        """Return points where they lie after the shifts [m], shape (N, 2)."""
        return _moved(points_xy, self.origin_xy, self.shifts)


def bend_of(first: Hypermap, second: Hypermap, a_T_b: Pose2D) -> Bend:
    """Return the shifts that put a bent map onto another, in the base frame of the other.

    Args:
        first: the map that is right.
        second: the one that is bent.
        a_T_b: pose of its base frame in that of the first, about.

    Raises:
        NotAligned: If its walls do not agree clearly better with the shifts than without.
        HypermapError: If a map has no occupancy layer, or an empty one.
    """
    a, b = _with_borders(scan_of(first)), _with_borders(scan_of(second))
    walls, known = a_T_b.apply(b.occupied_xy), a_T_b.apply(b.known_xy)
    field = Field.of(a, a.resolution, margin=1.5)
    low = known.min(axis=0) - _SPACING
    width, height = (np.ceil(np.ptp(known, axis=0) / _SPACING).astype(int) + 3).tolist()
    cols, rows = np.meshgrid(np.arange(width), np.arange(height))
    places = low + _SPACING * np.stack([cols, rows], axis=2)
    shifts = np.zeros((height, width, 2))
    for radius, reach, step in _PASSES:
        shifts = _pass(places, shifts, walls, field, radius, reach, step)
    within = wall_tolerance(a, b)
    before = _agreement(walls, field, within)
    after = _agreement(_moved(walls, low, shifts), field, within)
    bend = Bend(low, shifts, before, after)
    _check(bend)
    return bend


def _with_borders(scan: Scan) -> Scan:
    """Return a map with the occupied cells next to free ones alone: thick walls match anywhere."""
    free = KDTree(scan.free_xy)
    far, _ = free.query(scan.occupied_xy, distance_upper_bound=1.6 * scan.resolution)
    return replace(scan, occupied_xy=scan.occupied_xy[np.isfinite(far)])


def _check(bend: Bend) -> None:
    gain = bend.after - bend.before
    if bend.after < _LEAST_AGREEMENT or gain < max(_LEAST_GAIN, _GAIN * (1 - bend.before)):
        remedy = "leave out --local"
        if bend.after < _LEAST_AGREEMENT:
            remedy = "do the maps show the same floor?"
        raise NotAligned(
            f"bending does not help: {bend.before:.0%} of the walls agree without it, and "
            f"{bend.after:.0%} with it; {remedy}"
        )
    steps = [np.abs(np.diff(bend.shifts, axis=axis)).max(initial=0.0) for axis in (0, 1)]
    if max(steps) > _STEEPEST * _SPACING:
        raise NotAligned(
            f"the map would have to be bent by {max(steps):.1f} m within {_SPACING:g} m, which is "
            "more than poses that drift explain; do the maps show the same floor?"
        )


def _pass(
    places: FloatArray,
    shifts: FloatArray,
    walls: FloatArray,
    field: Field,
    radius: float,
    reach: float,
    step: float,
) -> FloatArray:
    """Return better shifts, by matching the walls around each place near where they are by now."""
    count = shifts.shape[0] * shifts.shape[1]
    targets, weights = np.zeros((count, 2)), np.zeros((count, 2, 2))
    ticks = np.arange(-reach, reach + step / 2, step)
    tries = np.stack(np.meshgrid(ticks, ticks), axis=2).reshape(-1, 2)
    moved, tree = _moved(walls, places[0, 0], shifts), KDTree(walls)
    for number, place in enumerate(places.reshape(-1, 2)):
        near = np.sort(tree.query_ball_point(place, radius))
        if len(near) < _FEWEST:
            continue
        points = moved[near[:: -(-len(near) // _MOST_POINTS)]]
        shift, information = _matched(points, tries, field)
        targets[number] = shifts.reshape(-1, 2)[number] + shift
        weights[number] = information
    shape, trusted = (shifts.shape[0], shifts.shape[1]), weights
    for _ in range(_ROUNDS):  # places that contradict their neighbors count less and less
        smooth = _smoothed(targets, trusted, shape)
        off = np.linalg.norm(smooth.reshape(-1, 2) - targets, axis=1)
        trusted = weights / (1 + (off / _OFF) ** 2)[:, np.newaxis, np.newaxis] ** 2
    return smooth


def _matched(
    points: FloatArray, tries: FloatArray, field: Field
) -> tuple[FloatArray, NDArray[np.float64]]:
    """Return by which of some shifts points fit walls best, and how surely, shape (2, 2)."""
    there = points[np.newaxis] + tries[:, np.newaxis]
    far, slope = field.near(there.reshape(-1, 2))
    cost = (np.minimum(far, _CAP) ** 2).reshape(len(tries), -1).mean(axis=1) / _SIGMA**2
    cost = cost * len(points) / _TOGETHER + (tries**2).sum(axis=1) / _SMALL**2
    best = int(cost.argmin())
    rows = slice(best * len(points), (best + 1) * len(points))
    counts = far[rows] < _CAP / 2
    across = slope[rows][counts]
    trust = counts.mean() ** 2 / (_TOGETHER * _SIGMA**2)
    return tries[best], trust * across.T @ across


def _smoothed(
    targets: FloatArray, weights: NDArray[np.float64], shape: tuple[int, int]
) -> FloatArray:
    """Return shifts near the targets that change little from place to place, shape (H, W, 2)."""
    height, width = shape
    count = height * width
    numbers = np.arange(count).reshape(shape)
    pairs = np.concatenate(
        [
            np.stack([numbers[:, :-1].ravel(), numbers[:, 1:].ravel()], axis=1),
            np.stack([numbers[:-1].ravel(), numbers[1:].ravel()], axis=1),
        ]
    )
    ones = np.ones(len(pairs))
    edges = np.arange(len(pairs))
    steps = sparse.coo_array(
        (np.r_[ones, -ones], (np.r_[edges, edges], np.r_[pairs[:, 0], pairs[:, 1]])),
        (len(pairs), count),
    ).tocsr()
    apart = sparse.kron(steps.T @ steps / _SMOOTH**2, sparse.eye_array(2))
    own = sparse.bsr_array((weights, np.arange(count), np.arange(count + 1)))  # 2 x 2 blocks
    prior = sparse.eye_array(2 * count) / _SMALL**2
    wanted = np.einsum("nij,nj->ni", weights, targets).ravel()
    return np.asarray(spsolve((apart + own + prior).tocsc(), wanted)).reshape(height, width, 2)


def _moved(points_xy: FloatArray, origin_xy: FloatArray, shifts: FloatArray) -> FloatArray:
    cells = ((points_xy - origin_xy) / _SPACING).T[::-1]
    by = [
        ndimage.map_coordinates(shifts[..., axis], cells, order=1, mode="nearest")
        for axis in (0, 1)
    ]
    moved: FloatArray = points_xy + np.column_stack(by)
    return moved


def _agreement(walls: FloatArray, field: Field, within: float) -> float:
    """Return the share of walls in known area that lie on walls."""
    distance, known = field.at(walls)
    is_same = distance <= within
    return int(np.count_nonzero(is_same & known)) / max(1, int(np.count_nonzero(known)))
