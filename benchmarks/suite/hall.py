"""A synthetic hall full of round things, and what a camera that stands among them sees.

Each frame shows five things, as a detector and noise leave them, and carries the ends of the rays
of a depth image of 320 x 240 pixels, cast onto the things, the floor and the walls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.perception.depth_view import DepthView
from hypermap.perception.frame import Camera
from hypermap.perception.observation import Observation, ObservedObject

CLASSES, PER_FRAME = 20, 5
CORNERS = 12  # of a thing's outline
_SPACING = 1.43  # meters from one thing to the next
_HEIGHT = 0.8  # of the things [m]
_CAMERA_HEIGHT = 1.2  # meters
_DRIFT = 0.03  # by which a footprint is off [m]
_MAX_RANGE = 5.0  # of the observed area [m]
_SENSOR_RANGE = 6.0  # rays that would end farther away have no return [m]
_MIN_PIXELS = 10  # of those that a view keeps, for a thing to be found
# A view keeps every fourth row and column of a depth image.
_CAMERA = Camera.from_intrinsics(262.5, 262.5, 159.5, 119.5, 320, 240).every(4)
_ANGLES = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])


@dataclass(frozen=True, eq=False)
class _Pose:
    """Where a level camera stands on the floor and which way it looks."""

    position: NDArray[np.float64]
    forward: NDArray[np.float64]

    @property
    def right(self) -> NDArray[np.float64]:
        return np.array([self.forward[1], -self.forward[0]])

    def matrix(self) -> NDArray[np.float64]:
        """Return map_T_camera of the optical frame, shape (4, 4)."""
        pose = np.eye(4)
        pose[:2, 0], pose[:2, 2] = self.right, self.forward
        pose[1:3, 1] = 0, -1
        pose[2, 2] = 0
        pose[:3, 3] = *self.position, _CAMERA_HEIGHT
        return pose


@dataclass(frozen=True, eq=False)
class _Look:
    """A depth image [m], from where it was taken, and the five things that it shows best."""

    pose: _Pose
    depth: NDArray[np.float64]
    things: list[int]


class Hall:
    """Things on a square grid, each a prism over a polygon of twelve corners.

    Attributes:
        places: middle of each thing [m], shape (N, 2).
        radii: about how far its corners lie from there [m], shape (N,).
    """

    def __init__(self, count: int, rng: np.random.Generator) -> None:
        """Fill a hall with some things."""
        side = int(np.ceil(np.sqrt(count)))
        numbers = np.arange(count)
        self.places = np.column_stack([numbers % side, numbers // side]) * _SPACING
        self.radii = rng.uniform(0.22, 0.28, count)
        self._rng = rng
        self._limits = np.array([[-1.0, -1.0], self.places.max(axis=0) + 1])

    def frames(self, count: int) -> list[Observation]:
        """Return what as many frames show, each from a place of its own.

        Each thing in turn is looked at.
        """
        return [self._observation(number, self._look(number)) for number in range(count)]

    def frames_from_one_place(self, count: int) -> list[Observation]:
        """Return what as many frames show of the same five things."""
        look = self._look(0)
        return [self._observation(number, look) for number in range(count)]

    def _look(self, number: int) -> _Look:
        """Return what one sees of a thing and its surroundings from some place before it."""
        while True:
            pose = self._pose_before(self.places[number % len(self.places)])
            depth, thing_of_ray = self._rays(pose)
            pixels = np.bincount(thing_of_ray[thing_of_ray >= 0], minlength=len(self.places))
            most = np.argsort(-pixels, kind="stable")[:PER_FRAME]
            if len(most) == PER_FRAME and pixels[most[-1]] >= _MIN_PIXELS:
                return _Look(pose, depth, most.tolist())

    def _observation(self, number: int, look: _Look) -> Observation:
        pose = look.pose
        map_T_camera = pose.matrix()
        right = (np.arange(_CAMERA.width) - _CAMERA.K[0, 2]) / _CAMERA.K[0, 0]
        reach = (look.depth * np.hypot(1, right)).astype(np.float32)
        is_near = look.depth <= _MAX_RANGE
        across = (look.depth * right)[is_near, np.newaxis] * pose.right
        points = pose.position + look.depth[is_near, np.newaxis] * pose.forward + across
        return Observation(
            stamp=number / 30,
            map_T_camera=map_T_camera,
            objects=tuple(self._found(thing) for thing in look.things),
            visible_area=shapely.convex_hull(shapely.linestrings(points)),
            view=DepthView(_CAMERA, map_T_camera, reach, _MAX_RANGE),
        )

    def _pose_before(self, place: NDArray[np.float64]) -> _Pose:
        """Return a free place some two meters before a thing, looking at it."""
        while True:
            yaw = self._rng.uniform(-np.pi, np.pi)
            forward = np.array([np.cos(yaw), np.sin(yaw)])
            position = place - self._rng.uniform(1.2, 2.4) * forward
            is_inside = (position > self._limits[0]).all() and (position < self._limits[1]).all()
            if is_inside and np.hypot(*(self.places - position).T).min() > 0.4:
                return _Pose(position, forward)

    def _found(self, thing: int) -> ObservedObject:
        """Return a thing as a detector and a noisy camera show it."""
        rng = self._rng
        radii = self.radii[thing] + rng.uniform(-0.05, 0.05, CORNERS)
        corners = self.places[thing] + radii[:, np.newaxis] * _CIRCLE + rng.normal(0, _DRIFT, 2)
        footprint = shapely.convex_hull(shapely.linestrings(corners))
        z_max = _HEIGHT + rng.normal(0, 0.02)
        return ObservedObject(
            f"class {thing % CLASSES}", rng.uniform(0.3, 1), footprint, 0.02, z_max
        )

    def _rays(self, pose: _Pose) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the depth image, NaN for no return, and the thing that each ray hits, or -1."""
        offsets = self.places - pose.position
        ahead, beside = offsets @ pose.forward, np.abs(offsets @ pose.right)
        is_in_view = (ahead > 0) & (ahead < _SENSOR_RANGE + 1) & (beside < 0.7 * ahead + 0.5)
        things = np.flatnonzero(is_in_view)
        right = (np.arange(_CAMERA.width) - _CAMERA.K[0, 2]) / _CAMERA.K[0, 0]
        directions = pose.forward + right[:, np.newaxis] * pose.right
        begin, end = self._passages(pose.position, directions, things)

        down = ((np.arange(_CAMERA.height) - _CAMERA.K[1, 2]) / _CAMERA.K[1, 1])[:, np.newaxis]
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = np.where(down > 0, _CAMERA_HEIGHT / down, np.inf)
            top = np.where(down > 0, (_CAMERA_HEIGHT - _HEIGHT) / down, np.inf)
            walls = np.where(directions > 0, self._limits[1], self._limits[0]) - pose.position
            wall = (walls / directions).min(axis=1)
        hit = np.maximum(begin[:, np.newaxis], top)  # the side, or the top behind its edge
        hit = np.where((hit < end[:, np.newaxis]) & (hit <= floor), hit, np.inf)
        nearest = hit.argmin(axis=0)
        of_things = np.take_along_axis(hit, nearest[np.newaxis], axis=0)[0]
        depth = np.minimum(of_things, np.minimum(floor, wall))
        thing_of_ray = np.where(of_things <= depth, things[nearest], -1)
        is_far = depth > _SENSOR_RANGE
        return np.where(is_far, np.nan, depth), np.where(is_far, -1, thing_of_ray)

    def _passages(
        self,
        position: NDArray[np.float64],
        directions: NDArray[np.float64],
        things: NDArray[np.int64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where rays over the floor enter and leave some things, shape (T, columns) each.

        A ray that misses a thing leaves it before it enters.
        """
        radii = self.radii[things, np.newaxis, np.newaxis]
        corners = self.places[things, np.newaxis] + radii * _CIRCLE
        edges = np.roll(corners, -1, axis=1) - corners
        inward = np.stack([-edges[..., 1], edges[..., 0]], axis=-1)
        to_edge = np.einsum("tcx,tcx->tc", inward, corners - position)[..., np.newaxis]
        speed = np.einsum("tcx,rx->tcr", inward, directions)
        with np.errstate(divide="ignore"):
            at_edge = to_edge / speed
        begin = np.where(speed > 0, at_edge, -np.inf).max(axis=1)
        end = np.where(speed < 0, at_edge, np.inf).min(axis=1)
        return begin, end
