"""The occlusion test: how much of an object on the map a frame could see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.perception.depth_view import DepthView

_AROUND = np.arange(8) / 8  # samples along the contour
_INWARD = 0.75  # where the samples lie between centroid and contour
_HEIGHTS = np.array([0.25, 0.5, 0.75])  # of the samples, between lowest and highest point
_FEWEST_RAYS = 10  # that must be able to hit an object; smaller ones cannot be detected


@dataclass(frozen=True, eq=False)
class SamplePoints:
    """Where the occlusion test samples an object.

    Attributes:
        around: points of its contour [m], shape (8, 2).
        xy: its center, and points between that and its contour [m], shape (9, 2).
        width: the largest distance between opposite samples of its contour [m].
    """

    around: NDArray[np.float64]
    xy: NDArray[np.float64]
    width: float


def sample_points(shape: PreparedPolygon) -> SamplePoints:
    """Return the sample points of an object, from the convex hull of its shape."""
    hull = shapely.convex_hull(shape.geometry)
    ring = shapely.get_exterior_ring(hull)
    around = shapely.get_coordinates(shapely.line_interpolate_point(ring, _AROUND, normalized=True))
    center = shapely.get_coordinates(shapely.centroid(hull))
    xy = np.concatenate([center, center + _INWARD * (around - center)])
    across = np.linalg.norm(around[:4] - around[4:], axis=1)
    return SamplePoints(around, xy, float(across.max()))


@dataclass(frozen=True, eq=False)
class SeenShares:
    """How much of N objects a frame could see, as shares of the samples, shape (N,) each.

    Attributes:
        visible: samples whose rays ended at the object or behind it.
        through: samples whose rays ended behind the whole object.
        beyond: samples whose rays ended behind the sample itself. Where an object on a wall is
            gone, rays hit the wall, which is not behind the whole object by the tolerance.
    """

    visible: NDArray[np.float64]
    through: NDArray[np.float64]
    beyond: NDArray[np.float64]


def visible_shares(
    view: DepthView, samples: Sequence[SamplePoints], heights: NDArray[np.float64], tolerance: float
) -> SeenShares:
    """Return how much of each object a frame could see, and how much it saw through.

    Samples of each object are projected into the depth image. A ray that ended before the object
    shows an occlusion; one that ended behind it passed through its place. Objects too small or too
    far away to be detected have no visible samples.

    Args:
        view: where the frame's rays ended.
        samples: of each of the N objects.
        heights: lowest and highest point of each object [m], shape (N, 2).
        tolerance: error of the measured surface of an object [m].
    """
    if not samples:
        return SeenShares(np.empty(0), np.empty(0), np.empty(0))
    around = np.array([one.around for one in samples])
    distances = np.linalg.norm(around - view.position[:2], axis=2)
    xy = np.array([one.xy for one in samples])
    z = heights[:, :1] + (heights[:, 1:] - heights[:, :1]) * _HEIGHTS
    xyz = np.empty((*xy.shape[:2], len(_HEIGHTS), 3))
    xyz[..., :2] = xy[:, :, np.newaxis]
    xyz[..., 2] = z[:, np.newaxis]
    reach = view.reach_towards(xyz.reshape(-1, 3)).reshape(len(samples), -1)
    # Without a return, the comparisons with NaN are false: not visible.
    visible = reach >= distances.min(axis=1, keepdims=True) - tolerance
    through = reach > distances.max(axis=1, keepdims=True) + tolerance
    own = np.linalg.norm(xy - view.position[:2], axis=2)
    beyond = reach > np.repeat(own, len(_HEIGHTS), axis=1) + tolerance
    sizes = np.array([one.width for one in samples]) * (heights[:, 1] - heights[:, 0])
    K = view.camera.K
    rays = sizes * K[0, 0] * K[1, 1] / np.maximum(distances.mean(axis=1), 1e-3) ** 2
    is_large = rays >= _FEWEST_RAYS
    shares = (found.mean(axis=1) * is_large for found in (visible, through, beyond))
    return SeenShares(*shares)
