"""Finds the transform between two maps of one place: coarse to fine, by walls and objects.

The search over all rotations and shifts is a cross-correlation of grids (as Carpin, Fast and
accurate map merging, Autonomous Robots 25, 2008, does with spectra): walls on walls count for a
pose, walls on free space against it. The best places are then refined by least squares on the
distances between walls.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import fft, optimize

from hypermap.alignment.grids import Field, Scan, scan_of, wall_tolerance
from hypermap.core.arguments import check_kind
from hypermap.core.arrays import FloatArray
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap

_COARSE_CELLS = 128  # across the larger map, in the first search
_PER_ROTATION, _CANDIDATES = 3, 24  # places that are kept of each rotation, and altogether
_MOST_POINTS = 4000  # of walls, that are compared in the fine search
_ELSEWHERE = (0.5, math.radians(8))  # [m, rad] by which another place differs
_NEAR_INITIAL = (2.0, math.radians(30))  # [m, rad] around a pose that is given
_OBJECT = 0.6  # [m] up to which objects of one name are the same
_OBJECT_WEIGHT = 1.0  # [m] of wall for which an object in its place counts, and against, elsewhere

_LEAST_AGREEMENT, _LEAST_IF_BENT = 0.75, 0.4
_LEAST_OVERLAP = 0.15
_SMALL_OVERLAP, _LEAST_IF_SMALL = 0.5, 0.85  # less than half can fit by chance
_CONFIRMING = 3  # objects, at least half of those that could fit, with which the walls need not
_LEAST_CERTAINTY = 0.12
_LEAST_OBJECTS, _ENOUGH_OBJECTS = 0.15, 8  # share, and from how many on it counts


class NotAligned(HypermapError):
    """Two maps could not be aligned: no pose matches, or several do."""


@dataclass(frozen=True)
class Alignment:
    """The alignment of one map to another.

    Attributes:
        a_T_b: takes points in the base frame of the second map to that of the first.
        agreement: share of the walls in the area known to both that lie on walls of the other map.
        overlap: share of the smaller map's known area that the other map knows, too.
        objects: how many objects of the second map lie on objects of that name in the first.
        certainty: 0..1, how much worse the next best pose matches.
        others: how many other objects in the area known to both have a name that both maps know.
    """

    a_T_b: Pose2D
    agreement: float
    overlap: float
    objects: int
    certainty: float
    others: int = 0


@dataclass(frozen=True)
class _Fit:
    pose: Pose2D
    support: float  # [m] of wall that fits, less what contradicts
    agreement: float = 0.0
    overlap: float = 0.0
    objects: int = 0
    others: int = 0


def align(
    first: Hypermap,
    second: Hypermap,
    *,
    initial: Pose2D | None = None,
    layers: tuple[str | None, str | None] = (None, None),
    is_bent: bool = False,
) -> Alignment:
    """Align the second map to the first, by their occupancy layers and objects.

    Args:
        first: a map.
        second: a map of the same floor, which overlaps with the first.
        initial: approximate pose of the second map's base frame in that of the first, within 2 m
            and 30 degrees; None for anywhere.
        layers: names of their occupancy layers; None for the only one.
        is_bent: whether one map may be bent, so that fewer walls agree; see `bend_of`.

    Raises:
        NotAligned: If no pose matches well enough, or several match about equally.
        LayerNotFound: If a map has no occupancy layer of that name.
        HypermapError: If a map has none at all, or an empty one.
        TypeError: If one is not a map.
    """
    check_kind(first, Hypermap)
    check_kind(second, Hypermap)
    a, b = _scan("first", first, layers[0]), _scan("second", second, layers[1])
    fits = _refined(a, b, _candidates(a, b, initial))
    if not fits:
        raise NotAligned("no pose was found in which the maps overlap")
    best = fits[0]
    other = next((fit for fit in fits[1:] if _is_elsewhere(fit.pose, best.pose)), None)
    certainty = 1.0
    if other is not None and best.support > 0:
        certainty = float(np.clip(1 - other.support / best.support, 0, 1))
    found = Alignment(best.pose, best.agreement, best.overlap, best.objects, certainty, best.others)
    _check(found, _LEAST_IF_BENT if is_bent else _least_agreement(found))
    return found


def _least_agreement(found: Alignment) -> float:
    """Return by how much of the walls two maps must agree, neither of which is bent.

    Corners of different buildings are often alike, so a small overlap needs more.
    """
    confirmed = found.objects >= max(_CONFIRMING, found.others)
    is_small = found.overlap < _SMALL_OVERLAP and not confirmed
    return _LEAST_IF_SMALL if is_small else _LEAST_AGREEMENT


def _scan(which: str, hypermap: Hypermap, layer: str | None) -> Scan:
    try:
        return scan_of(hypermap, layer)
    except HypermapError as error:
        error.args = (f"the {which} map: {error}",)  # it stays of its class
        raise


def _check(found: Alignment, least_agreement: float) -> None:
    pose = found.a_T_b
    where = f"x {pose.x:.2f} m, y {pose.y:.2f} m, {math.degrees(pose.yaw):.1f} degrees"
    if found.agreement < least_agreement or found.overlap < _LEAST_OVERLAP:
        raise NotAligned(
            f"the maps do not match: at the best pose ({where}), {found.overlap:.0%} of the "
            f"smaller map overlaps, and {found.agreement:.0%} of the walls there lie on walls of "
            "the other; do they show the same floor?"
        )
    comparable = found.objects + found.others
    if comparable >= _ENOUGH_OBJECTS and found.objects < _LEAST_OBJECTS * comparable:
        raise NotAligned(
            f"the walls match ({where}), but only {found.objects} of {comparable} objects are "
            "where the other map has one of that name; are the maps of one floor?"
        )
    if found.certainty < _LEAST_CERTAINTY:
        raise NotAligned(
            f"several poses match: the next best is only {found.certainty:.0%} worse than the best "
            f"({where}); give `hypermap align` --initial X,Y,YAW to choose"
        )


# The search over all places


def _candidates(a: Scan, b: Scan, initial: Pose2D | None) -> list[Pose2D]:
    """Return poses of b in a that may fit, best first."""
    resolution = max(2 * max(a.radius, b.radius) / _COARSE_CELLS, a.resolution, b.resolution)
    field = Field.of(a, resolution, margin=3 * resolution)
    resolution = field.resolution
    near_wall = np.exp(-0.5 * (field.distance / resolution) ** 2).astype(np.float32)
    is_free = field.known & (field.distance > 2 * resolution)
    # Walls of b: for them on walls of a, against them in its free space; and the other way round.
    for_walls = near_wall - 0.5 * is_free
    for_free = -0.5 * (field.distance < resolution / 2).astype(np.float32)
    half = math.ceil(b.radius / resolution) + 2
    size = [fft.next_fast_len(side + 2 * half, real=True) for side in field.distance.shape]
    spectra = [fft.rfft2(part, size) for part in (for_walls, for_free)]

    step = 1.5 * resolution / max(b.radius, resolution)
    count = max(8, math.ceil(2 * math.pi / step))
    yaws = np.arange(count) * 2 * math.pi / count
    if initial is not None:
        off = np.abs(np.angle(np.exp(1j * (yaws - initial.yaw))))
        yaws = yaws[off <= _NEAR_INITIAL[1] + step]
    scored: list[tuple[float, Pose2D]] = []
    for yaw in yaws.tolist():
        score = _correlated(spectra, b, yaw, resolution, half, size)
        rotated = Pose2D(0, 0, yaw).apply(b.center)[0]
        if initial is not None:
            score = np.where(_near(score.shape, initial, b, field, half), score, -np.inf)
        for row, col in _peaks(score):
            middle = field.origin_xy + (np.array([col, row]) - half + 0.5) * resolution
            x, y = (middle - rotated).tolist()
            scored.append((float(score[row, col]), Pose2D(x, y, yaw)))
    scored.sort(key=lambda one: -one[0])
    return _different([pose for _, pose in scored], b)[:_CANDIDATES]


def _correlated(
    spectra: list[NDArray[np.complex64]],
    b: Scan,
    yaw: float,
    resolution: float,
    half: int,
    size: list[int],
) -> FloatArray:
    """Return the score of b, turned, by where its middle is: cells are shifted by `half`."""
    turn = Pose2D(0, 0, yaw)
    total = np.zeros(1, dtype=np.complex64)
    for spectrum, points in zip(spectra, (b.occupied_xy, b.free_xy), strict=True):
        local = turn.apply(points - b.center)
        cols, rows = (np.floor(local / resolution + 0.5).astype(int) + half).T
        image = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
        image[rows, cols] = 1.0  # flipped below, as a correlation is a convolution of that
        total = total + spectrum * fft.rfft2(image[::-1, ::-1], size)
    return np.asarray(fft.irfft2(total, size))


def _peaks(score: FloatArray) -> list[tuple[int, int]]:
    """Return the cells of the highest local maxima."""
    highest = _highest_within_two(_highest_within_two(score).T).T
    rows, cols = np.nonzero((score == highest) & (score > 0))
    order = np.argsort(-score[rows, cols], kind="stable")[:_PER_ROTATION]
    return [(int(rows[i]), int(cols[i])) for i in order]


def _highest_within_two(values: FloatArray) -> FloatArray:
    """Return the highest of each value and the two before and after it, along the first axis.

    For each rotation anew, which takes a third of the time of `scipy.ndimage.maximum_filter`.
    """
    padded = np.pad(values, ((2, 2), (0, 0)), constant_values=-np.inf)
    pairs = np.maximum(padded[:-1], padded[1:])
    highest: FloatArray = np.maximum(np.maximum(pairs[:-3], pairs[2:-1]), padded[4:])
    return highest


def _near(
    shape: tuple[int, ...], initial: Pose2D, b: Scan, field: Field, half: int
) -> NDArray[np.bool_]:
    """Return for which cells b's middle is near where a given pose has it."""
    x, y = ((initial.apply(b.center)[0] - field.origin_xy) / field.resolution + half).tolist()
    rows, cols = np.ogrid[: shape[0], : shape[1]]
    reach = _NEAR_INITIAL[0] / field.resolution + 1
    near: NDArray[np.bool_] = (rows - y) ** 2 + (cols - x) ** 2 <= reach**2
    return near


def _different(poses: list[Pose2D], b: Scan) -> list[Pose2D]:
    """Return poses without those that put b near where an earlier one does."""
    kept: list[Pose2D] = []
    for pose in poses:
        if all(_is_elsewhere(pose, other, b.center) for other in kept):
            kept.append(pose)
        if len(kept) == _CANDIDATES:
            break
    return kept


def _is_elsewhere(one: Pose2D, other: Pose2D, center: FloatArray | None = None) -> bool:
    middle = np.zeros(2) if center is None else center
    far = np.linalg.norm(one.apply(middle)[0] - other.apply(middle)[0])
    turned = abs(math.remainder(one.yaw - other.yaw, 2 * math.pi))
    return bool(far > _ELSEWHERE[0] or turned > _ELSEWHERE[1])


# The fine search


def _refined(a: Scan, b: Scan, poses: list[Pose2D]) -> list[_Fit]:
    """Return how well places fit after refinement, best first."""
    resolution = min(a.resolution, b.resolution)
    on_a = Field.of(a, resolution, margin=1.0)
    on_b = Field.of(b, resolution, margin=1.0)
    some_a, some_b = _some(a.occupied_xy), _some(b.occupied_xy)
    fits = []
    for pose in poses:
        refined = _least_squares(pose, on_a, on_b, some_a, some_b, b.center)
        fits.append(_fit(refined, a, b, on_a, on_b))
    return sorted(fits, key=lambda fit: -fit.support)


def _least_squares(
    pose: Pose2D, on_a: Field, on_b: Field, a_xy: FloatArray, b_xy: FloatArray, center: FloatArray
) -> Pose2D:
    """Return the pose nearby in which walls are nearest to walls, by a robust loss."""
    parameters = np.array([*pose.apply(center)[0], pose.yaw])  # b's middle in a, and the yaw
    for reach in (1.0, 0.3, 0.1):  # [m] of the loss, from far to near
        far_and_slope = _Distances(on_a, on_b, a_xy, b_xy, center, most=3 * reach)
        parameters = optimize.least_squares(
            far_and_slope.at,
            parameters,
            jac=far_and_slope.slope_at,
            loss="cauchy",
            f_scale=reach / 2,
            x_scale=[1, 1, 0.1],
            ftol=1e-5,
            max_nfev=40,
        ).x
    x, y = parameters[:2] - _rotation(parameters[2]) @ center
    return Pose2D(float(x), float(y), math.remainder(parameters[2], 2 * math.pi))


_Seen: TypeAlias = tuple[
    FloatArray, tuple[FloatArray, FloatArray], FloatArray, tuple[FloatArray, FloatArray]
]


@dataclass(frozen=True, eq=False)
class _Distances:
    """How far walls of one map are from those of the other, up to a limit, by the pose.

    A pose is given as where the middle of b lies in a, and the yaw: x, y, yaw.
    """

    on_a: Field
    on_b: Field
    a_xy: FloatArray
    b_xy: FloatArray
    center: FloatArray
    most: float
    _last: dict[bytes, _Seen] = dataclasses.field(default_factory=dict)

    def at(self, parameters: FloatArray) -> FloatArray:
        """Return the distances [m], first of b's points, then of a's, shape (N,)."""
        _, (far_a, _), _, (far_b, _) = self._seen(parameters)
        far: FloatArray = np.concatenate([far_a, far_b])
        return far.clip(max=self.most)

    def slope_at(self, parameters: FloatArray) -> FloatArray:
        """Return the derivatives of the distances by the parameters, shape (N, 3)."""
        there, (far_a, up_a), back, (far_b, up_b) = self._seen(parameters)
        by_b = np.column_stack([up_a, _cross(there - parameters[:2], up_a)])
        turned = up_b @ _rotation(parameters[2]).T
        by_a = -np.column_stack([turned, _cross(back - self.center, up_b)])
        slope: FloatArray = np.concatenate([by_b, by_a])
        slope[np.concatenate([far_a, far_b]) >= self.most] = 0.0
        return slope

    def _seen(self, parameters: FloatArray) -> _Seen:
        """Return where the points come to lie, and what is near; kept, as slopes are asked next."""
        pose = parameters.tobytes()
        if pose not in self._last:
            self._last.clear()
            there, back = self._moved(parameters)
            self._last[pose] = there, self.on_a.near(there), back, self.on_b.near(back)
        return self._last[pose]

    def _moved(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points of b in a, and those of a in b."""
        turn = _rotation(parameters[2])
        there = (self.b_xy - self.center) @ turn.T + parameters[:2]
        return there, (self.a_xy - parameters[:2]) @ turn + self.center


def _rotation(yaw: float) -> FloatArray:
    return np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def _fit(pose: Pose2D, a: Scan, b: Scan, on_a: Field, on_b: Field) -> _Fit:
    """Return how well a pose fits."""
    within = wall_tolerance(a, b)
    back = pose.inverse()
    fits, against = 0.0, 0.0
    shares = []
    for points, move, field, side in (
        (b.occupied_xy, pose, on_a, b.resolution),
        (a.occupied_xy, back, on_b, a.resolution),
    ):
        distance, known = field.at(move.apply(points))
        on_wall = distance <= within
        fits += side * np.count_nonzero(on_wall)
        against += side * np.count_nonzero(known & ~on_wall)
        shares.append((np.count_nonzero(on_wall), np.count_nonzero(known | on_wall)))
    agreement = float(sum(good for good, _ in shares) / max(1, sum(every for _, every in shares)))
    _, there = on_a.at(pose.apply(b.known_xy))
    _, here = on_b.at(back.apply(a.known_xy))
    overlap = max(float(there.mean()), float(here.mean()))
    matched, missing = _objects(pose, a, b, on_a)
    support = (fits - against) / 2 + _OBJECT_WEIGHT * (matched - missing)
    return _Fit(pose, support, agreement, overlap, matched, missing)


def _objects(pose: Pose2D, a: Scan, b: Scan, on_a: Field) -> tuple[int, int]:
    """Return how many objects of b lie on one of a, and how many could, but do not.

    Names that a has nowhere do not count: it may come from another detector.
    """
    if not len(a.names) or not len(b.names):
        return 0, 0
    moved = pose.apply(b.objects_xy)
    _, known = on_a.at(moved)
    far = np.linalg.norm(moved[:, np.newaxis] - a.objects_xy, axis=2)
    far[b.names[:, np.newaxis] != a.names] = np.inf
    matched = far.min(axis=1) <= _OBJECT
    could = known & np.isin(b.names, a.names)
    return int(matched.sum()), int((could & ~matched).sum())


def _some(points: FloatArray) -> FloatArray:
    """Return so many of the points that they are compared quickly, spread evenly."""
    step = -(-len(points) // _MOST_POINTS)
    return points[::step]
