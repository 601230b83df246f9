"""How views lie on each other by the brightness of what both see, where depth does not tell.

Depth says nothing about a motion along a bare wall, but boards and tiles of the floor, notices, or
the edges of shadows do.

Source: direct alignment of images whose depth is known (Kerl, Sturm, Cremers, "Robust odometry
estimation for RGB-D cameras", ICRA 2013), by the mean gradient of both (Benhimane, Malis,
"Homography-based 2D visual tracking and servoing", IJRR 26(7), 2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.errors import HypermapError
from hypermap.mapping.pose_graph.planar import Array
from hypermap.mapping.pose_graph.view import Floats, View
from hypermap.perception.frame import RgbdFrame

_DARK = 8.0  # added to brightness, which is up to 255, before its logarithm
_LEAST = 0.01  # difference in log brightness between the neighbors of a point that is used
_MOST_POINTS, _FEWEST = 1500, 80
_TRIED = np.arange(-0.06, 0.065, 0.01)  # along a direction, at first [m]
_STEPS = 6
_ALIKE = 0.4  # least correlation of the gradients of both images
_WIDEST, _NARROWEST = 0.3, 0.03  # differences in log brightness from which points do not count
_CUT = 3.0  # the same in standard deviations
_LEAST_SIGMA = 0.01  # standard deviation of a difference in log brightness
_TOGETHER = 10.0  # points with a common error: so many count as one
_FLOOR = 0.02  # added standard deviation [m], as on a real desk


@dataclass(frozen=True, eq=False)
class Texture:
    """The brightness of a view in blocks of pixels, half as wide as those of its depth.

    Attributes:
        level_R_camera: rotation of its camera, shape (3, 3).
        height: of the camera above the floor [m].
        intrinsics: fx, fy, cx, cy of the blocks [blocks], shape (4,).
        depth: of each block of the view [m], NaN without one, float32, shape (H, W).
        bright: logarithm of the brightness of its blocks, float32, shape (2H, 2W), or (H, W).
        points: where it changes, in the view's coordinates [m], shape (N, 3).
        values: of these points, shape (N,).
        gradients: how it changes there along x and y [1/m], shape (N, 2).
    """

    level_R_camera: Array
    height: float
    intrinsics: Array
    depth: Floats
    bright: Floats
    points: Floats
    values: Floats
    gradients: Floats

    @classmethod
    def of(cls, view: View, color: NDArray[np.uint8]) -> Texture:
        """Return the texture of a view by its color image, RGB, shape (H, W, 3)."""
        rows, columns = view.points.shape[:2]
        step = color.shape[1] // columns
        finer = 1 if step % 2 else 2
        bright = _bright(color[: rows * step, : columns * step, 1], step // finer)
        by_column, by_row = np.zeros_like(bright), np.zeros_like(bright)
        by_column[:, 1:-1] = (bright[:, 2:] - bright[:, :-2]) / 2
        by_row[1:-1] = (bright[2:] - bright[:-2]) / 2
        depth = (view.points - [0, 0, view.height]) @ view.level_R_camera[:, 2]
        row, column = np.nonzero(np.maximum(np.abs(by_column), np.abs(by_row)) > _LEAST / 2)
        ahead = _depth_at(depth, (row + 0.5) / finer - 0.5, (column + 0.5) / finer - 0.5)
        chosen = np.flatnonzero(np.isfinite(ahead))
        chosen = chosen[:: max(1, -(-len(chosen) // _MOST_POINTS))]
        row, column, ahead = row[chosen], column[chosen], ahead[chosen]
        fx, fy, cx, cy = np.append(view.intrinsics[:2], view.intrinsics[2:] + 0.5) * finer
        x, y = (column - cx + 0.5) / fx, (row - cy + 0.5) / fy
        across, down = fx * by_column[row, column] / ahead, fy * by_row[row, column] / ahead
        gradients = np.column_stack([across, down, -(across * x + down * y)])
        points = np.column_stack([x * ahead, y * ahead, ahead]) @ view.level_R_camera.T
        points[:, 2] += view.height
        return cls(
            np.ascontiguousarray(view.level_R_camera),
            view.height,
            np.array([fx, fy, cx - 0.5, cy - 0.5]),
            depth.astype(np.float32),
            bright,
            points.astype(np.float32),
            bright[row, column],
            (gradients @ view.level_R_camera.T)[:, :2].astype(np.float32),
        )


def _bright(green: NDArray[np.uint8], step: int) -> Floats:
    """Return the log brightness of blocks of some rows and columns of pixels."""
    total = np.zeros((green.shape[0] // step, green.shape[1] // step), np.float32)
    for i in range(step):
        for j in range(step):
            total += green[i::step, j::step]
    return np.asarray(np.log(total / np.float32(step * step) + np.float32(_DARK)))


def _depth_at(depth: Array, rows: Array, columns: Array) -> Array:
    """Return the depth between pixels of an image, as of planes; NaN at edges and outside, (N,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        nearness = np.pad(1 / depth, 1, constant_values=np.nan)
        row, column = np.floor(rows).astype(int) + 1, np.floor(columns).astype(int) + 1
        s, t = columns - np.floor(columns), rows - np.floor(rows)
        above = (1 - s) * nearness[row, column] + s * nearness[row, column + 1]
        below = (1 - s) * nearness[row + 1, column] + s * nearness[row + 1, column + 1]
        return np.asarray(1 / ((1 - t) * above + t * below))


class Textures:
    """The textures of the newest views, each made when it is first asked for."""

    def __init__(self, count: int) -> None:
        """Prepare to keep the textures of some of the newest views."""
        self._count = count
        self._shown: dict[int, tuple[View, RgbdFrame]] = {}
        self._made: dict[int, Texture | None] = {}

    def add(self, b: int, view: View, frame: RgbdFrame) -> None:
        """Add the next view, the b-th, and its frame."""
        self._shown[b] = view, frame
        self._shown.pop(b - self._count, None)
        self._made.pop(b - self._count, None)

    def of(self, a: int) -> Texture | None:
        """Return the texture of one of the newest views; None without a color image."""
        if a not in self._made:
            view, frame = self._shown.pop(a)
            try:
                color = frame.color
            except HypermapError:  # it cannot be read, and so tells nothing
                color = None
            self._made[a] = None if color is None else Texture.of(view, color)
        return self._made[a]


def align(
    first: Texture, second: Texture, a_T_b: Array, direction: Array
) -> tuple[Array, float] | None:
    """Return a relative pose, moved along a direction, and its standard deviation there [m].

    None if there is too little texture.

    Args:
        first: texture of a view.
        second: that of another one.
        a_T_b: approximate pose of the second in the first [m, m, rad], shape (3,).
        direction: in the first, of length 1, shape (2,).
    """
    if len(second.points) < _FEWEST:
        return None
    offset, cut = 0.0, _WIDEST
    for _ in range(2):
        sums = _compared(first, second, a_T_b, 0.0, direction, offset, 2 * cut)
        offset += sums[2] / max(sums[0], 1.0)
    tried = [_compared(first, second, a_T_b, along, direction, offset, cut) for along in _TRIED]
    best = int(np.argmin([one[1] + cut**2 * (one[6] - one[0]) for one in tried]))
    along = float(_TRIED[best])
    for _ in range(_STEPS):
        sums = _compared(first, second, a_T_b, along, direction, offset, cut)
        weight = sums[0]
        if weight < _FEWEST or sums[3] <= 0:
            return None
        along -= sums[4] / sums[3]
        offset += sums[2] / weight
        sigma = max(float(np.sqrt(sums[1] / weight)), _LEAST_SIGMA)
        cut = min(cut, max(_CUT * sigma, _NARROWEST))
    if not sums[5] > _ALIKE * np.sqrt(sums[7] * sums[8]):
        return None
    pose = a_T_b.astype(float)
    pose[:2] += along * direction
    return pose, float(np.sqrt(_TOGETHER * sigma**2 / sums[5] + _FLOOR**2))


def _compared(
    first: Texture,
    second: Texture,
    a_T_b: Array,
    along: float,
    direction: Array,
    offset: float,
    cut: float,
) -> Array:
    """Return the sums of `_compare` for a pose that is moved along a direction."""
    pose, sums = a_T_b.astype(float), np.zeros(9)
    pose[:2] += along * direction
    _compare(
        second.points,
        second.values,
        second.gradients,
        first.depth,
        first.bright,
        first.level_R_camera,
        first.height,
        first.intrinsics,
        pose,
        direction,
        offset,
        cut,
        sums,
    )
    return sums


@loop()
def _compare(
    points: Floats,
    values: Floats,
    gradients: Floats,
    depths: Floats,
    on: Floats,
    R: Array,
    height: float,
    intrinsics: Array,
    pose: Array,
    direction: Array,
    offset: float,
    cut: float,
    sums: Array,
) -> None:
    """Compare the brightness of points with that of an image that shows them.

    Args:
        points: of one view [m], shape (N, 3).
        values: their log brightness, shape (N,).
        gradients: of these along x and y [1/m], shape (N, 2).
        depths: of the other view [m], shape (H, W).
        on: its log brightness, shape (2H, 2W), or (H, W).
        R: level_R_camera of its camera, shape (3, 3).
        height: of its camera [m].
        intrinsics: fx, fy, cx, cy of its image, shape (4,).
        pose: x, y, yaw of the points' view in the other [m, m, rad], shape (3,).
        offset: by how much the other image is brighter.
        cut: difference from which points do not count.
        direction: in which that may change, of length 1, shape (2,).
        sums: filled in: the sums of weights, and of weighted squared differences, differences,
            squared gradients, gradients times differences, and products of both gradients along the
            direction; the number of points that are seen; the weighted sums of the squares of
            either gradient; shape (9,).
    """
    sums[:] = 0.0
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    rows, columns = on.shape
    scale = len(depths) / rows
    for i in range(len(points)):
        rx = cos * points[i, 0] - sin * points[i, 1]
        ry = sin * points[i, 0] + cos * points[i, 1]
        x, y, h = rx + pose[0], ry + pose[1], points[i, 2] - height
        depth = R[0, 2] * x + R[1, 2] * y + R[2, 2] * h
        if depth < 0.2:
            continue
        across = (R[0, 0] * x + R[1, 0] * y + R[2, 0] * h) / depth
        down = (R[0, 1] * x + R[1, 1] * y + R[2, 1] * h) / depth
        u = intrinsics[0] * across + intrinsics[2]
        v = intrinsics[1] * down + intrinsics[3]
        column, row = int(np.floor(u)), int(np.floor(v))
        if not (0 <= row < rows - 1 and 0 <= column < columns - 1):
            continue
        there = depths[int((v + 0.5) * scale), int((u + 0.5) * scale)]
        if not abs(there - depth) < 0.05 + 0.05 * depth:  # another surface, or none
            continue
        s, t = u - column, v - row
        a, b = on[row, column], on[row, column + 1]
        c, d = on[row + 1, column], on[row + 1, column + 1]
        value = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d)
        apart = value - values[i] - offset
        sums[6] += 1
        if abs(apart) >= cut:
            continue
        weight = (1 - (apart / cut) ** 2) ** 2
        gu = intrinsics[0] * ((1 - t) * (b - a) + t * (d - c)) / depth
        gv = intrinsics[1] * ((1 - s) * (c - a) + s * (d - b)) / depth
        gz = -(gu * across + gv * down)
        gx = R[0, 0] * gu + R[0, 1] * gv + R[0, 2] * gz
        gy = R[1, 0] * gu + R[1, 1] * gv + R[1, 2] * gz
        here = gx * direction[0] + gy * direction[1]
        mx = cos * gradients[i, 0] - sin * gradients[i, 1]
        my = sin * gradients[i, 0] + cos * gradients[i, 1]
        other = mx * direction[0] + my * direction[1]
        mean = (here + other) / 2
        sums[0] += weight
        sums[1] += weight * apart * apart
        sums[2] += weight * apart
        sums[3] += weight * mean * mean
        sums[4] += weight * mean * apart
        sums[5] += weight * here * other
        sums[7] += weight * here * here
        sums[8] += weight * other * other
