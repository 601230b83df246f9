"""The occupancy map that a robot with a planar laser makes on its drive.

Source: Grisetti, Stachniss, Burgard, "Improved techniques for grid mapping with Rao-Blackwellized
particle filters", IEEE T-RO 23(1), 2007, for a map as the share of rays that ended in a cell. Scans
are matched to the map so far by Gauss-Newton steps as in Kohlbrecher et al., "A flexible and
scalable SLAM system with full 3D motion estimation", SSRR 2011, section IV.B.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray

from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.simulation.parts import Part
from hypermap.simulation.scene import placed, wall_parts
from hypermap.simulation.trajectory import planar_poses
from hypermap.simulation.truth import RESOLUTION, grid_around
from hypermap.simulation.world import World

# A small indoor laser, as a Hokuyo URG-04LX or an RPLIDAR A1, low on the robot.
_HEIGHT = 0.2  # meters above the floor
_REACH = 8.0  # meters
_NOISE = 0.01  # standard deviation of a range [m]
_ANGLES = np.radians(np.arange(-135, 135, 0.75))
_RATE = 2.0  # scans per second
# Odometry of a wheeled robot: errors per meter and per radian, which scan matching takes out.
_SLIP, _TURN_SLIP, _TURN_PER_METER = 0.02, 0.03, math.radians(1.0)
_OCCUPIED_SHARE = 0.3  # of the rays through a cell that end in it
_STEPS = 12  # of Gauss-Newton, at most
_NEAR = 0.3  # points farther than this from the map so far show something new [m]
_ODOMETRY = np.array([0.02, 0.02, math.radians(1.0)]) ** -2.0  # how sure it is from scan to scan

Bend = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def laser_map(world: World, rng: np.random.Generator, bend: Bend | None = None) -> OccupancyLayer:
    """Return the map that scan matching makes of a drive.

    Args:
        world: what there is to see, with a drive. The laser sees no glass.
        rng: random number generator.
        bend: moves the places of the world before the laser sees them; None for no move.
    """
    if world.drive is None:
        raise ValueError(f"the world {world.name!r} has no drive, which a laser map needs")
    lines = outlines_at(_HEIGHT, _solid_parts(world))
    if bend is not None:
        lines = bend(lines.reshape(-1, 2)).reshape(-1, 2, 2)
    floor = shapely.union_all([shapely.box(*area) for area in world.floor.all_rectangles])
    grid = _HitMap(grid_around(floor, RESOLUTION))
    _, true = planar_poses(world.drive, _RATE)
    scans, poses = [_scan(true[0], lines, rng)], [true[0]]
    grid.add(scans[0], poses[0])
    for before, here in itertools.pairwise(true):
        scans.append(_scan(here, lines, rng))
        poses.append(grid.matched(scans[-1], _moved(poses[-1], before, here, rng)))
        grid.add(scans[-1], poses[-1])
    grid = _HitMap(grid.grid)
    for points, pose in zip(scans, _registered(np.array(poses), true), strict=True):
        grid.add(points, pose)
    return grid.layer()


def outlines_at(height: float, parts: Iterable[Part]) -> NDArray[np.float64]:
    """Return where upright bodies are cut at a height: lines on the floor [m], shape (L, 2, 2)."""
    found = [np.empty((0, 2, 2))]
    for part in parts:
        corners = part.vertices[part.faces]
        above = corners[..., 2] > height
        cut = corners[above.any(axis=1) & ~above.all(axis=1)]
        if len(cut):
            ahead = np.roll(cut, -1, axis=1)
            crosses = (cut[..., 2] > height) != (ahead[..., 2] > height)
            share = (height - cut[crosses][:, 2]) / (ahead[crosses] - cut[crosses])[:, 2]
            points = cut[crosses] + share[:, np.newaxis] * (ahead[crosses] - cut[crosses])
            found.append(points[:, :2].reshape(-1, 2, 2))  # two of three sides of each triangle
    return np.concatenate(found)


def _solid_parts(world: World) -> list[Part]:
    parts = [part for wall in world.walls if not wall.glass for part in wall_parts(wall)]
    return parts + [part for one in world.objects if not one.glass for part in placed(one)]


def _scan(
    pose: NDArray[np.float64], lines: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the ends of the rays, seen from the robot [m]; those that hit nothing lie beyond."""
    a, b = lines[:, 0] - pose[:2], lines[:, 1] - pose[:2]
    along = b - a
    share = -np.einsum("ij,ij->i", a, along) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = a + np.clip(share, 0, 1)[:, np.newaxis] * along
    is_near = np.hypot(*nearest.T) < _REACH
    a, along = a[is_near], along[is_near]
    x, y = np.cos(pose[2] + _ANGLES)[:, np.newaxis], np.sin(pose[2] + _ANGLES)[:, np.newaxis]
    across = x * along[:, 1] - y * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (a[:, 0] * along[:, 1] - a[:, 1] * along[:, 0]) / across
        where = (a[:, 0] * y - a[:, 1] * x) / across
        hits = (ranges > 0) & (where >= 0) & (where <= 1)
    ranges = np.where(hits, ranges, np.inf).min(axis=1, initial=2 * _REACH)
    ranges = np.where(ranges < _REACH, ranges + _NOISE * rng.normal(size=len(ranges)), 2 * _REACH)
    rays = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
    return np.asarray(ranges[:, np.newaxis] * rays)


def _moved(
    pose: NDArray[np.float64],
    before: NDArray[np.float64],
    now: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return where odometry has a robot go from a pose, as it truly went from before to now."""
    step, turn = now[:2] - before[:2], now[2] - before[2]
    distance = float(np.hypot(*step))
    errors = rng.normal(size=3)
    length = distance * (1 + _SLIP * errors[0])
    heading = pose[2] + math.atan2(step[1], step[0]) - before[2] if distance else 0.0
    heading += _SLIP * errors[1]
    turned = turn + (_TURN_SLIP * abs(turn) + _TURN_PER_METER * distance) * errors[2]
    steps = [length * math.cos(heading), length * math.sin(heading), turned]
    return np.asarray(pose + np.array(steps))


def _registered(poses: NDArray[np.float64], true: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses, all turned and moved alike, so that they lie on the true ones.

    The frame of a map that scan matching makes is arbitrary, and a robot localizes itself in it.

    Source: Horn, "Closed-form solution of absolute orientation using unit quaternions", 1987; in
    the plane, and of headings, too, as a robot may have turned on the spot.
    """
    turn = np.angle(np.exp(1j * (true[:, 2] - poses[:, 2])).mean())
    rotation = _rotation(turn)
    xy = poses[:, :2] @ rotation.T
    xy += (true[:, :2] - xy).mean(axis=0)
    return np.column_stack([xy, poses[:, 2] + turn])


class _HitMap:
    """Counts, for each cell, the rays that ended there and those that went through."""

    def __init__(self, grid: GridGeometry) -> None:
        self.grid = grid
        self.hits, self.passes = np.zeros((2, *grid.shape), dtype=np.int32)

    def add(self, points: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        """Add a scan from a pose."""
        ranges = np.hypot(*points.T)
        is_hit = ranges < _REACH
        steps = np.arange(0, _REACH - RESOLUTION, RESOLUTION / 2)
        along = points[:, np.newaxis] / ranges[:, np.newaxis, np.newaxis] * steps[:, np.newaxis]
        through = along[steps < ranges[:, np.newaxis] - RESOLUTION]
        ended = self._cells(points[is_hit], pose)
        passed = self._cells(through, pose) & ~ended
        self.hits += ended
        self.passes += passed

    def matched(
        self, points: NDArray[np.float64], guess: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the pose, x, y and yaw [m, m, rad], near a guess, where a scan (N, 2) [m] fits."""
        points = points[np.hypot(*points.T) < _REACH]
        (row, col), reach = self.grid.cells_at(guess[np.newaxis, :2])[0], int(10 / RESOLUTION)
        rows = slice(max(row - reach, 0), row + reach)
        cols = slice(max(col - reach, 0), col + reach)
        is_occupied = self._is_occupied()[rows, cols]
        if not is_occupied.any() or len(points) == 0:
            return guess
        distances = scipy.ndimage.distance_transform_edt(~is_occupied) * RESOLUTION
        slopes = np.gradient(distances, RESOLUTION)
        pose = guess.copy()
        corner = np.array([rows.start, cols.start])
        for _ in range(_STEPS):
            turned = points @ _rotation(pose[2]).T
            places = self._places(turned + pose[:2]) - corner[:, np.newaxis]
            at = [
                scipy.ndimage.map_coordinates(one, places, order=1, cval=_NEAR)
                for one in (distances, slopes[1], slopes[0])
            ]
            distance, slope = at[0], np.column_stack(at[1:])
            weight = np.maximum(1 - (distance / _NEAR) ** 2, 0) ** 2 / RESOLUTION**2
            by_turn = slope[:, 1] * turned[:, 0] - slope[:, 0] * turned[:, 1]
            jacobian = np.column_stack([slope, by_turn])
            information = jacobian.T @ (weight[:, np.newaxis] * jacobian) + np.diag(_ODOMETRY)
            pull = jacobian.T @ (weight * distance) + _ODOMETRY * (pose - guess)
            step = np.linalg.solve(information, -pull)
            pose += step
            if np.abs(step).max() < 1e-4:
                break
        return pose

    def layer(self) -> OccupancyLayer:
        """Return the map: unknown where no ray went."""
        cells = np.full(self.grid.shape, UNKNOWN, dtype=np.int8)
        cells[self.passes > 0] = FREE
        cells[self._is_occupied()] = OCCUPIED
        return OccupancyLayer("occupancy", "map", self.grid, cells)

    def _is_occupied(self) -> NDArray[np.bool_]:
        return np.asarray(
            (self.hits > 0) & (self.hits >= _OCCUPIED_SHARE * (self.hits + self.passes))
        )

    def _places(self, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return row and column of points, whole at the centers of cells, shape (2, N)."""
        origin = self.grid.origin
        return (points_xy[:, ::-1] - [origin.y, origin.x]).T / RESOLUTION - 0.5

    def _cells(self, points: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which cells hold a point seen from a pose."""
        rows, cols = np.rint(self._places(points @ _rotation(pose[2]).T + pose[:2])).astype(int)
        found = np.zeros(self.grid.shape, dtype=bool)
        height, width = found.shape
        inside = (rows >= 0) & (rows < height) & (cols >= 0) & (cols < width)
        found[rows[inside], cols[inside]] = True
        return found


def _rotation(angle: float) -> NDArray[np.float64]:
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
