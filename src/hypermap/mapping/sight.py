"""What a frame could see of a place where an object is known to be."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray
from hypermap.perception.view import View

_AROUND = np.arange(8) / 8  # samples along an outline
_INWARD = 0.75  # where the samples lie between centroid and outline
_HEIGHTS = np.array([0.25, 0.5, 0.75])  # where they lie between lowest and highest point
_FEWEST_RAYS = 10  # that must be able to hit a thing for it to be large enough to be found


def sights(
    view: View, shapes: ObjectArray, heights: NDArray[np.float64], tolerance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how much of some objects a frame could see, and how much it saw through.

    Samples of each object are looked up in the depth image. A ray that ended before the object
    shows nothing of it; one that ended behind it went through the place where it should be. Of
    things too small or too far away to be found nothing is seen.

    Args:
        view: where the frame's rays ended.
        shapes: footprints in the map frame [m], shape (N,).
        heights: lowest and highest point of each [m], shape (N, 2).
        tolerance: how far before and behind an object its surface may be measured [m].

    Returns:
        Share of each object's samples whose rays ended at the object or behind it, and share of
        those that ended behind it, shape (N,) each.
    """
    count, samples = len(shapes), (len(_AROUND) + 1) * len(_HEIGHTS)
    if count == 0:
        return np.empty(0), np.empty(0)
    outlines = shapely.get_exterior_ring(shapes)[:, np.newaxis]
    points = shapely.line_interpolate_point(outlines, _AROUND, normalized=True)
    around = shapely.get_coordinates(points).reshape(count, -1, 2)
    distances = np.linalg.norm(around - view.position[:2], axis=2)

    middles = shapely.get_coordinates(shapely.centroid(shapes))[:, np.newaxis]
    xy = np.concatenate([middles, middles + _INWARD * (around - middles)], axis=1)
    z = heights[:, :1] + (heights[:, 1:] - heights[:, :1]) * _HEIGHTS
    xyz = np.empty((count, xy.shape[1], len(_HEIGHTS), 3))
    xyz[..., :2] = xy[:, :, np.newaxis]
    xyz[..., 2] = z[:, np.newaxis]
    reach = view.reach_towards(xyz.reshape(-1, 3)).reshape(count, samples)
    # Where there was no return, the comparisons with NaN are false: nothing was seen.
    visible = reach >= distances.min(axis=1, keepdims=True) - tolerance
    through = reach > distances.max(axis=1, keepdims=True) + tolerance
    widths = np.linalg.norm(around - np.roll(around, 4, axis=1), axis=2).max(axis=1)
    sizes = widths * (heights[:, 1] - heights[:, 0])
    K = view.camera.K
    rays = sizes * K[0, 0] * K[1, 1] / np.maximum(distances.mean(axis=1), 1e-3) ** 2
    is_large = rays >= _FEWEST_RAYS
    return visible.mean(axis=1) * is_large, through.mean(axis=1) * is_large
