"""What a camera sees of a scene: color, depth and the object behind every pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import invert
from hypermap.perception.frame import Camera
from hypermap.simulation.scene import BACKGROUND, Scene
from hypermap.simulation.visibility import Shadows, nearest_triangles

# A Kinect's nominal intrinsics for images of half the size: 63 degrees wide.
DEFAULT_CAMERA = Camera.from_intrinsics(262.5, 262.5, 159.5, 119.5, width=320, height=240)

SKY = np.array([0.80, 0.86, 0.92], dtype=np.float32)  # color where there is nothing
_AMBIENT, _FROM_ABOVE, _FROM_LAMP = 0.56, 0.14, 0.48  # shares of light
_BOARD = 0.16  # width of a floor board [m]


@dataclass(frozen=True, eq=False)
class Rendering:
    """The ground truth of an image.

    Attributes:
        depth: meters along the optical axis, float32, NaN where there is nothing, shape (H, W).
        color: RGB, uint8, shape (H, W, 3).
        instances: which of the world's objects, -1 for none, int32, shape (H, W).
        incidence: angle between the ray and the surface's normal [rad], NaN where there is
            nothing, float32, shape (H, W).
    """

    depth: NDArray[np.float32]
    color: NDArray[np.uint8]
    instances: NDArray[np.int32]
    incidence: NDArray[np.float32]


class Renderer:
    """Casts one ray through each pixel of a camera."""

    def __init__(self, scene: Scene, camera: Camera = DEFAULT_CAMERA) -> None:
        self.camera = camera
        self._scene = scene
        self._normals = _normals(scene.triangles)
        self._rays = _rays(camera)
        self._lengths = np.sqrt((self._rays**2).sum(axis=0))
        self._shadows = Shadows.of(scene.triangles, _lamp(scene))

    def render(self, map_T_camera: NDArray[np.float64], moving: Scene | None = None) -> Rendering:
        """Return the view from a pose of the optical frame.

        Args:
            map_T_camera: the pose, shape (4, 4).
            moving: moving bodies at this time; they cast no shadow.
        """
        scene, facing = self._scene, self._normals
        if moving is not None:
            scene = scene.joined(moving)
            facing = np.concatenate([facing, _normals(moving.triangles)], axis=1)
        shape = (self.camera.height, self.camera.width)
        pose = map_T_camera.astype(np.float32)
        directions = np.stack([_dot(row, self._rays) for row in pose[:3, :3]])
        projection = self.camera.K @ invert(map_T_camera)[:3]
        depths, found = nearest_triangles(scene.triangles, projection, *shape)

        triangles = found.ravel()  # -1 for nothing: what it stands for is overwritten below
        nothing = triangles < 0
        # A ray advances one meter along the optical axis per unit of length.
        depth = np.where(nothing, np.nan, depths.ravel()).astype(np.float32)
        points = pose[:3, 3:] + depth * directions
        normals = facing.take(triangles, axis=1, mode="wrap")
        cosine = _dot(directions, normals) / self._lengths
        instances = scene.instances[triangles]
        instances[nothing] = BACKGROUND
        incidence = np.arccos(np.minimum(np.abs(cosine), 1))
        incidence[nothing] = np.nan
        color = self._shade(points, scene, triangles, normals)
        color[:, nothing] = SKY[:, np.newaxis]
        pixels = np.round(255 * np.clip(color, 0, 1)).astype(np.uint8)
        return Rendering(
            depth=depth.reshape(shape),
            color=np.ascontiguousarray(pixels.T).reshape(*shape, 3),
            instances=instances.reshape(shape),
            incidence=incidence.reshape(shape),
        )

    def _shade(
        self,
        points: NDArray[np.float32],
        scene: Scene,
        triangles: NDArray[np.int32],
        normals: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        """Return Lambert shading: light from all around, a little more from above, and a lamp."""
        to_lamp = self._shadows.lamp.astype(np.float32)[:, np.newaxis] - points
        facing = _dot(normals, to_lamp)
        facing /= np.sqrt(_dot(to_lamp, to_lamp))
        lit = np.flatnonzero(facing > 0)
        above = points[:, lit] + 1e-3 * normals[:, lit]
        facing[lit[self._shadows.cover(np.ascontiguousarray(above.T))]] = 0
        light = _AMBIENT + _FROM_ABOVE * normals[2] + _FROM_LAMP * np.maximum(facing, 0)
        boards = np.flatnonzero(scene.is_floor[triangles])
        light[boards] *= _boards(points[:, boards])
        colors = np.ascontiguousarray(scene.colors.T).take(triangles, axis=1, mode="wrap")
        shaded: NDArray[np.float32] = colors * light
        return shaded


def _dot(one: NDArray[np.float32], other: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the products of vectors; shapes (3,) or (3, N), which is quicker than (N, 3)."""
    product: NDArray[np.float32] = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
    return product


def _rays(camera: Camera) -> NDArray[np.float32]:
    """Return a direction per pixel in the optical frame with z = 1, row-major, shape (3, H * W)."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
    return np.linalg.solve(camera.K, pixels).astype(np.float32)


def _lamp(scene: Scene) -> NDArray[np.float32]:
    """Return where the lamp hangs: high above the middle of the floor; it casts shadows."""
    corners = scene.triangles[scene.is_floor].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    above = max(6.0, 0.8 * float((high - low).max()))
    return np.array([*(low + high)[:2] / 2, above], dtype=np.float32)


def _normals(triangles: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the outward unit normal of each triangle, shape (3, T)."""
    a, b, c = np.moveaxis(triangles.astype(np.float64), 1, 0)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.ascontiguousarray((normals / np.maximum(lengths, 1e-20)).T, dtype=np.float32)


def _boards(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the brightness of the floor board under each point; boards differ a little."""
    row = np.floor(points[1] / _BOARD)
    column = np.floor(points[0] / 1.2 + 0.37 * row)
    tone = np.abs(np.sin(12.9898 * row + 78.233 * column))
    return np.asarray(0.86 + 0.14 * tone, dtype=np.float32)
