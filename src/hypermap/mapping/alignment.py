"""Scan matching: corrects poses so that depth images fit a known occupancy map.

Localization errors are some centimeters and a degree. At 3 m, a degree is more than half the width
of a cup. A known occupancy map improves the pose: upright surfaces in the depth image must lie
where the map's free space ends.

Source: matching against the distance to the nearest obstacle is the likelihood field of Thrun,
Burgard, Fox, Probabilistic Robotics, 2005, section 6.4; solved by Gauss-Newton steps as in
Kohlbrecher et al., "A flexible and scalable SLAM system with full 3D motion estimation", SSRR 2011,
section IV.B. Here the distance is signed, so points on both sides of a border are pulled toward it;
and the border is that of free space, because no camera sees the far side of a wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.agreement import Agreement
from hypermap.mapping.corrections import (
    FEW_POINTS,
    LESS_AGREEMENT,
    NO_BETTER,
    NO_MAP,
    Corrections,
)
from hypermap.mapping.shrinkage import Shrinkage
from hypermap.mapping.stages import AlignmentConfig
from hypermap.perception.frame import RgbdFrame

_STEP = 0.015  # between the pixels used, as a share of the focal length: 4 for a 320 x 240 Kinect
_APART = 2  # steps between the two pixels of a column that are tested for an upright surface
_LEAN = 0.25  # horizontal distance over difference in height up to which a surface is upright
_NOISE = 0.002  # standard deviation of the depth divided by its square [1/m]
_FEWEST = 20  # points that a correction needs
_TOGETHER = 10  # points with a common error, as on a wall: so many count as one
_MOST_OCCUPIED = 50  # percent; cells that are less likely occupied are free
_FACING = 0.1  # least cosine between the viewing direction and the inward normal of the wall
_STEPS = 15  # of Gauss-Newton, at most
_FAR = 1e3  # meters; the distance where the map is unknown
_SMALL = 1e-4  # meters or radians; the iteration ends with a step below this


class Aligner:
    """Corrects x, y and the heading of poses by a known map.

    Each pose is matched independently: an error of the map in one place does no harm elsewhere, and
    localization may jump. How much of a correction is applied depends on earlier corrections
    (`shrinkage`). If they are no larger than their own errors, as with exact poses, nothing is
    applied. The same holds if depth images agree less with each other by the corrected poses than
    by the given ones, as with exact poses and a distorted map.

    Attributes:
        config: expected pose errors, and which points are compared.
        corrections: statistics of the corrections so far.
    """

    def __init__(self, occupancy: OccupancyLayer, config: AlignmentConfig) -> None:
        """Prepare to correct poses in the frame of an occupancy layer."""
        self.config = config
        self._occupancy = occupancy
        self._borders: _Borders | None = None
        self._shrinkage = Shrinkage()
        self._agreement = Agreement()
        self.corrections = Corrections()

    def replace_map(self, occupancy: OccupancyLayer) -> None:
        """Correct by another map of the same place from now on."""
        self._occupancy, self._borders = occupancy, None

    @property
    def learned(self) -> tuple[float, float, bool]:
        """The state for `go_on_with`: two sums of `Shrinkage`, and the last verdict."""
        return *self._shrinkage.learned, self._agreement.is_worse

    def go_on_with(self, size: float, expected: float, is_worse: bool) -> None:
        """Take over the state of another aligner (`learned`).

        Its depth images are gone; until there are enough new ones, its last verdict holds.
        """
        self._shrinkage.go_on_with((size, expected))
        self._agreement.is_worse = is_worse

    def align(self, frame: RgbdFrame) -> RgbdFrame:
        """Return the frame with a pose that fits the map better.

        It keeps its pose if its depth image shows too little of the map, or if corrections are
        disabled.
        """
        position = frame.map_T_camera[:2, 3]
        if not self.config.enabled:
            return frame
        borders = self._borders_around(position)
        if borders is None:
            self.corrections.leave(NO_MAP)
            return frame
        xy, depths = _one_per_cell(*upright_points(frame, self.config), borders.resolution)
        if len(xy) < _FEWEST:
            self.corrections.leave(FEW_POINTS)
            return frame
        share, found = self._correction(xy, depths, position, borders)
        self._agreement.add(frame, _corrected(frame.map_T_camera, found))
        if share == 0 or self._agreement.is_worse:
            self.corrections.leave(NO_BETTER if share == 0 else LESS_AGREEMENT)
            return frame
        dx, dy, turn = share * found
        self.corrections.add(math.hypot(dx, dy), float(turn))
        return frame.moved_to(_corrected(frame.map_T_camera, share * found))

    def _correction(
        self,
        xy: NDArray[np.float64],
        depths: NDArray[np.float64],
        position: NDArray[np.float64],
        borders: _Borders,
    ) -> tuple[float, NDArray[np.float64]]:
        """Return which share of the correction to apply, 0..1, and the correction, shape (3,).

        The correction moves the points onto borders: x, y [m], rotation about the camera [rad].

        Args:
            xy: upright points from the camera, along the axes of the map [m], shape (N, 2).
            depths: of the points [m], shape (N,).
            position: of the camera in the map [m], shape (2,).
            borders: of free space around the camera.
        """
        config = self.config
        expected = np.array([config.position, config.position, math.radians(config.yaw_deg)])
        prior = np.diag(expected**-2.0)
        # A wall may lie anywhere in its outermost cells.
        sigma = borders.resolution / 2 + _NOISE * depths**2
        found = np.zeros(3)
        for _ in range(_STEPS):
            turned = xy @ _rotation(found[2])[:2, :2].T
            distance, slope = borders.at(turned + position + found[:2])
            inward = -np.sum(slope * turned, axis=1)
            counts = np.abs(distance) < config.max_distance
            counts &= inward > _FACING * np.hypot(*turned.T)
            inlier = np.where(counts, 1 - (distance / config.max_distance) ** 2, 0.0)  # Tukey 1960
            weight = inlier**2 / sigma**2 / _TOGETHER
            by_turn = slope[:, 1] * turned[:, 0] - slope[:, 0] * turned[:, 1]
            jacobian = np.column_stack([slope, by_turn])
            measured = jacobian.T @ (weight[:, np.newaxis] * jacobian)
            information = measured + prior
            step = np.linalg.solve(information, -jacobian.T @ (weight * distance) - prior @ found)
            found += step
            if np.abs(step).max() < _SMALL:
                break
        # If the pose was exact, `found` is measurement error alone. Then the expectation of the
        # first number is the second: the number of directions that the map constrains.
        size = float(found @ information @ found)
        by_errors = float(np.trace(np.linalg.solve(information, measured)))
        return self._shrinkage.share_of(size, by_errors), found

    def _borders_around(self, position: NDArray[np.float64]) -> _Borders | None:
        """Return the borders of free space near the camera; None where the map has none."""
        reach = self.config.max_range
        if self._borders is None or not self._borders.is_about(position, reach):
            self._borders = _Borders.of(self._occupancy, position, 2 * reach)
        return self._borders


@dataclass(frozen=True, eq=False)
class _Borders:
    """The signed distance to the nearest border of free space, on a grid around a place.

    Attributes:
        distances: from the center of each cell [m], negative beyond the border, shape (H, W).
        to_cells: maps (x, y, 1) to (col, row, 1) of these cells, shape (3, 3).
        resolution: side of a cell [m].
        center: center of the grid [m], shape (2,).
    """

    distances: NDArray[np.float64]
    to_cells: NDArray[np.float64]
    resolution: float
    center: NDArray[np.float64]

    @classmethod
    def of(
        cls, occupancy: OccupancyLayer, center: NDArray[np.float64], reach: float
    ) -> _Borders | None:
        """Return the borders in a square about a place.

        None if nothing or everything is free there, or if it covers fewer than two rows or columns.
        """
        grid, values = occupancy.grid, occupancy.cells
        if grid is None or values is None:
            return None
        row, col = grid.cells_at(center[np.newaxis])[0]
        cells = math.ceil(reach / grid.resolution)
        rows = slice(*np.clip([row - cells, row + cells + 1], 0, grid.height))
        cols = slice(*np.clip([col - cells, col + cells + 1], 0, grid.width))
        part = values[rows, cols]
        is_free = (part >= 0) & (part < _MOST_OCCUPIED)
        if is_free.all() or not is_free.any() or min(part.shape) < 2:
            return None
        free_side = scipy.ndimage.distance_transform_edt(is_free)
        far_side = scipy.ndimage.distance_transform_edt(~is_free)
        # The border lies half a cell before the centers of the first cells beyond it. What made
        # these cells occupied lies half a cell behind the border on average.
        distances = np.where(is_free, free_side, 1 - far_side) * grid.resolution
        to_cells = grid.to_cells_matrix()
        to_cells[:2, 2] -= cols.start, rows.start
        return cls(distances, to_cells, grid.resolution, center.copy())

    def is_about(self, position: NDArray[np.float64], reach: float) -> bool:
        """Return whether a place is near enough to the center."""
        return float(np.hypot(*(position - self.center))) <= reach

    def at(self, points_xy: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the distance at each point [m], shape (N,), and its gradient, shape (N, 2).

        Bilinear between the centers of cells. Outside of the grid it is `_FAR`, with gradient 0.
        """
        places = points_xy @ self.to_cells[:2, :2].T + self.to_cells[:2, 2] - 0.5
        first = np.floor(places).astype(int)
        height, width = self.distances.shape
        inside = np.all((first >= 0) & (first < (width - 1, height - 1)), axis=1)
        col, row = np.where(inside[:, np.newaxis], first, 0).T
        right, up = np.where(inside[:, np.newaxis], places - first, 0.0).T
        low, low_right = self.distances[row, col], self.distances[row, col + 1]
        high, high_right = self.distances[row + 1, col], self.distances[row + 1, col + 1]
        below, above = low + right * (low_right - low), high + right * (high_right - high)
        along_cols = (1 - up) * (low_right - low) + up * (high_right - high)
        slope = np.column_stack([along_cols, above - below]) @ self.to_cells[:2, :2]
        slope[~inside] = 0.0
        return np.where(inside, below + up * (above - below), _FAR), slope


def upright_points(
    frame: RgbdFrame, config: AlignmentConfig
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points of upright surfaces: walls, and the sides of furniture.

    Returns:
        x and y of each from the camera, along the axes of the map [m], shape (N, 2); and their
        depths [m], shape (N,).
    """
    K = frame.camera.K
    step = max(1, round(_STEP * min(K[0, 0], K[1, 1])))
    points = frame.points(step)
    with np.errstate(invalid="ignore", over="ignore"):  # depth may be infinite
        turned = points @ frame.map_T_camera[:3, :3].T
        upper, lower = turned[:-_APART], turned[_APART:]
        depths, heights = points[:-_APART, :, 2], upper[..., 2] + frame.map_T_camera[2, 3]
        shift = np.hypot(upper[..., 0] - lower[..., 0], upper[..., 1] - lower[..., 1])
        rise = np.abs(upper[..., 2] - lower[..., 2])
        chosen = shift <= _LEAN * rise + 2 * _NOISE * depths**2  # False for NaN
    chosen &= (heights >= config.min_height) & (heights <= config.max_height)
    chosen &= (depths > 0) & (depths <= config.max_range)
    return upper[chosen][:, :2], depths[chosen].astype(float)


def _one_per_cell(
    xy: NDArray[np.float64], depths: NDArray[np.float64], side: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of the points, and of their depths, in each square of side `side` [m]."""
    cells = np.floor(xy / side).astype(np.int64)
    keys = cells[:, 0] << 32 | (cells[:, 1] & 0xFFFFFFFF)
    _, which, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = [np.bincount(which, values, len(counts)) for values in (*xy.T, depths)]
    x, y, depth = sums / counts
    return np.column_stack([x, y]), depth


def _corrected(
    map_T_camera: NDArray[np.float64], correction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a pose moved by x and y [m] and turned about the camera [rad], shape (4, 4)."""
    corrected = map_T_camera.copy()
    corrected[:3, :3] = _rotation(correction[2]) @ corrected[:3, :3]
    corrected[:2, 3] += correction[:2]
    return corrected


def _rotation(angle: float) -> NDArray[np.float64]:
    """Return the rotation about z by an angle [rad], shape (3, 3)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
