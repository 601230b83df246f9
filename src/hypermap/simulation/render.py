"""What a camera sees of a scene: color, depth and the object behind every pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from hypermap.perception.frame import Camera
from hypermap.simulation.scene import BACKGROUND, Scene

# A Kinect's nominal intrinsics for images of half the size: 63 degrees wide.
DEFAULT_CAMERA = Camera.from_intrinsics(262.5, 262.5, 159.5, 119.5, width=320, height=240)

SKY = np.array([0.80, 0.86, 0.92], dtype=np.float32)  # color where there is nothing
_AMBIENT, _FROM_ABOVE, _FROM_LAMP = 0.56, 0.14, 0.48  # shares of light
_BOARD = 0.16  # width of a floor board [m]


_Number = TypeVar("_Number", bound=np.generic)


@dataclass(frozen=True, eq=False)
class View:
    """What is really there, pixel by pixel.

    Attributes:
        depth: metres along the optical axis, float32, NaN where there is nothing, shape (H, W).
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
        self._embree = EmbreeScene(robust=True)  # no gaps between neighbouring triangles
        self._mesh = TriangleMesh(self._embree, scene.triangles)
        self._rays = _rays(camera)
        self._lamp = _lamp(scene)

    def render(self, map_T_camera: NDArray[np.float64]) -> View:
        """Return the view from a pose of the optical frame."""
        pose = map_T_camera.astype(np.float32)
        directions = np.ascontiguousarray(self._rays @ pose[:3, :3].T)
        origins = np.tile(pose[:3, 3], (len(directions), 1))
        found = self._embree.run(origins, directions, output=True)
        hit = found["primID"] >= 0
        triangles = found["primID"][hit]
        depth = found["tfar"]  # the rays advance one metre along the optical axis per unit
        points = origins[hit] + depth[hit, np.newaxis] * directions[hit]

        seen = directions[hit] / np.linalg.norm(directions[hit], axis=1, keepdims=True)
        cosine = -np.einsum("ij,ij->i", seen, self._normals[triangles])
        shape = (self.camera.height, self.camera.width)
        color = np.tile(SKY, (len(directions), 1))
        color[hit] = self._shade(points, triangles)
        return View(
            depth=_image(depth[hit], hit, np.nan, shape),
            color=np.round(255 * np.clip(color, 0, 1)).astype(np.uint8).reshape(*shape, 3),
            instances=_image(self._scene.instances[triangles], hit, BACKGROUND, shape),
            incidence=_image(np.arccos(np.clip(np.abs(cosine), 0, 1)), hit, np.nan, shape),
        )

    def _shade(
        self, points: NDArray[np.float32], triangles: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        """Return Lambert shading: light from all around, a little more from above, and a lamp."""
        normals = self._normals[triangles]
        to_lamp = self._lamp - points
        facing = np.einsum("ij,ij->i", normals, to_lamp)
        facing /= np.linalg.norm(to_lamp, axis=1)
        lit = np.flatnonzero(facing > 0)
        start = points[lit] + 1e-3 * normals[lit]
        shadow = self._embree.run(start, to_lamp[lit], dists=np.ones(len(lit), np.float32)) >= 0
        facing[lit[shadow]] = 0
        light = _AMBIENT + _FROM_ABOVE * normals[:, 2] + _FROM_LAMP * np.maximum(facing, 0)
        colors = self._scene.colors[triangles]
        boards = self._scene.is_floor[triangles]
        colors[boards] *= _boards(points[boards])[:, np.newaxis]
        shaded: NDArray[np.float32] = colors * light[:, np.newaxis]
        return shaded


def _rays(camera: Camera) -> NDArray[np.float32]:
    """Return a direction per pixel in the optical frame with z = 1, row-major, shape (H * W, 3)."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
    return np.ascontiguousarray(np.linalg.solve(camera.K, pixels).T, dtype=np.float32)


def _lamp(scene: Scene) -> NDArray[np.float32]:
    """Return where the lamp hangs: high above the middle of the floor; it casts shadows."""
    corners = scene.triangles[scene.is_floor].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    above = max(6.0, 0.8 * float((high - low).max()))
    return np.array([*(low + high)[:2] / 2, above], dtype=np.float32)


def _normals(triangles: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the outward unit normal of each triangle, shape (T, 3)."""
    a, b, c = np.moveaxis(triangles.astype(np.float64), 1, 0)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(lengths, 1e-20), dtype=np.float32)


def _boards(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return how bright the floor board under each point is: every board a little different."""
    row = np.floor(points[:, 1] / _BOARD)
    column = np.floor(points[:, 0] / 1.2 + 0.37 * row)
    tone = np.abs(np.sin(12.9898 * row + 78.233 * column))
    return np.asarray(0.86 + 0.14 * tone, dtype=np.float32)


def _image(
    values: NDArray[_Number], hit: NDArray[np.bool_], nothing: float, shape: tuple[int, int]
) -> NDArray[_Number]:
    """Return one value per pixel from the values of the pixels that hit something."""
    image = np.full(len(hit), nothing, dtype=values.dtype)
    image[hit] = values
    return image.reshape(shape)
