"""Rectification: images of a camera with a lens as a pinhole camera would have taken them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, FloatArray, IntArray
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera
from hypermap.perception.lens import Lens

_SAME_SURFACE = 1.05  # ratio of the depths of neighboring pixels of one surface, at most
_ON_A_SIDE = 9  # points of a box's side, whose image is bent

_Intrinsics = tuple[float, float, float, float, int, int]


@dataclass(frozen=True, eq=False)
class Rectification:
    """A camera with a lens, and the pinhole camera to which its images are rectified.

    Attributes:
        lens: the lens.
        raw: the camera behind it.
        camera: the pinhole camera, at the same place.
    """

    lens: Lens
    raw: Camera
    camera: Camera

    def depth(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a rectified depth image.

        Between pixels of one surface, the inverse of depth is interpolated, which is exact on
        planes. Elsewhere it is that of the nearest pixel, so that no two surfaces are mixed.

        Args:
            depth: meters along the optical axis, float32, NaN for no return, shape (H, W).

        Returns:
            The same; NaN where the raw image shows nothing.
        """
        places = _places(self.lens, _intrinsics(self.raw), _intrinsics(self.camera))
        near = depth.ravel()[places.corners]
        is_one_surface = near.max(axis=0) <= _SAME_SURFACE * near.min(axis=0)  # false for NaN
        with np.errstate(divide="ignore", invalid="ignore"):
            mixed = 1 / np.einsum("ij,ij->j", places.weights, 1 / near)
        nearest = near[places.nearest, np.arange(near.shape[1])]
        rectified = np.full((self.camera.height, self.camera.width), np.nan, np.float32)
        rectified[places.is_in] = np.where(is_one_surface, mixed, nearest)
        return rectified

    def color(self, color: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a rectified color image, uint8, shape (H, W, 3), black where nothing is shown."""
        places = _places(self.lens, _intrinsics(self.raw), _intrinsics(self.camera))
        near = color.reshape(-1, 3)[places.corners]
        rectified = np.zeros((self.camera.height, self.camera.width, 3), np.uint8)
        rectified[places.is_in] = np.rint(np.einsum("ij,ijk->jk", places.weights, near))
        return rectified

    def detections(self, found: Detections) -> Detections:
        """Return detections of the raw image as ones of the rectified image.

        The bent sides of a box become straight ones. Boxes with a side of which the lens shows
        nothing are left out.
        """
        boxes = self._boxes(found.xyxy.astype(np.float64))
        is_there = np.isfinite(boxes).all(axis=1)
        masks = None
        if found.masks is not None:
            seen = [self._mask(mask) for mask in found.masks]
            masks = np.array(seen, bool).reshape(-1, self.camera.height, self.camera.width)
        return replace(found, xyxy=boxes.astype(found.xyxy.dtype), masks=masks)[is_there]

    def _mask(self, mask: BoolArray) -> BoolArray:
        places = _places(self.lens, _intrinsics(self.raw), _intrinsics(self.camera))
        nearest = places.corners[places.nearest, np.arange(len(places.nearest))]
        rectified = np.zeros((self.camera.height, self.camera.width), bool)
        rectified[places.is_in] = mask.ravel()[nearest]
        return rectified

    def _boxes(self, boxes: FloatArray) -> FloatArray:
        """Return boxes whose sides are where the bent sides are on the average, shape (N, 4).

        A side of which the lens shows nothing is NaN.
        """
        x0, y0, x1, y1 = boxes.T[..., np.newaxis]
        along = np.linspace(0, 1, _ON_A_SIDE)
        across, down = x0 + (x1 - x0) * along, y0 + (y1 - y0) * along
        x = np.stack([x0 + 0 * along, across, x1 + 0 * along, across], axis=1)
        y = np.stack([down, y0 + 0 * along, down, y1 + 0 * along], axis=1)
        sides = _points_of(np.stack([x, y], axis=-1) - 0.5, self.raw)  # from borders to centers
        pixels = _pixels_of(self.lens.undistorted(sides), self.camera) + 0.5
        across_sides = pixels[:, range(4), :, [0, 1, 0, 1]]  # (4, N, points)
        is_known = np.isfinite(across_sides)
        counts = is_known.sum(axis=-1)
        totals = across_sides.sum(axis=-1, where=is_known)
        return np.where(counts > 0, totals / np.maximum(counts, 1), np.nan).T


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the pixels of a rectified image, of which N show something, are in the raw image.

    Attributes:
        is_in: which pixels show something, shape (H, W).
        corners: row-major indices of the four raw pixels around each, shape (4, N).
        weights: how much each counts, shape (4, N).
        nearest: which of the four is the nearest, shape (N,).
    """

    is_in: BoolArray
    corners: IntArray
    weights: NDArray[np.float32]
    nearest: IntArray


@lru_cache(maxsize=4)  # of two cameras, in each process
def _places(lens: Lens, raw: _Intrinsics, pinhole: _Intrinsics) -> _Places:
    camera, (width, height) = Camera.from_intrinsics(*pinhole), raw[4:]
    pixels: Any = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    shown = lens.distorted(_points_of(np.stack(pixels, axis=-1), camera))
    x, y = np.moveaxis(_pixels_of(shown, Camera.from_intrinsics(*raw)), -1, 0)
    is_in = (x > -0.5) & (x < width - 0.5) & (y > -0.5) & (y < height - 0.5)  # false for NaN
    x, y = np.clip(x[is_in], 0, width - 1), np.clip(y[is_in], 0, height - 1)
    left, top = np.minimum(x.astype(np.intp), width - 2), np.minimum(y.astype(np.intp), height - 2)
    to_right, to_bottom = x - left, y - top
    corners = top * width + left + np.array([[0], [1], [width], [width + 1]])
    across, down = np.stack([1 - to_right, to_right]), np.stack([1 - to_bottom, to_bottom])
    weights = (down[:, np.newaxis] * across).reshape(4, -1)
    return _Places(is_in, corners, weights.astype(np.float32), weights.argmax(axis=0))


def _points_of(pixels: FloatArray, camera: Camera) -> FloatArray:
    """Return where pixels are on the plane at z = 1, shape (..., 2)."""
    points: FloatArray = (pixels - camera.K[:2, 2]) / camera.K[[0, 1], [0, 1]]
    return points


def _pixels_of(points_xy: FloatArray, camera: Camera) -> FloatArray:
    pixels: FloatArray = points_xy * camera.K[[0, 1], [0, 1]] + camera.K[:2, 2]
    return pixels


def _intrinsics(camera: Camera) -> _Intrinsics:
    K = camera.K
    return K[0, 0], K[1, 1], K[0, 2], K[1, 2], camera.width, camera.height
