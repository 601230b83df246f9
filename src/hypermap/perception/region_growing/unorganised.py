"""The reference method: PCL's normals and region growing over the points' nearest neighbors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig

CHUNK = 8192  # points whose neighbors are held in memory at a time


def grow_regions(
    points: NDArray[np.float32],
    valid: BoolArray,
    objects: Sequence[IntArray],
    config: PerceptionConfig,
) -> list[IntArray]:
    """Return the region of each pixel of each object.

    Source: PCL 1.13, `NormalEstimation` over the whole cloud, then `RegionGrowing` over the
    object's points.

    Args:
        points: organized cloud in the optical frame [m], shape (H, W, 3).
        valid: which of its pixels have a point, shape (H, W).
        objects: row-major indices of the valid pixels of each object.
        config: neighbors and thresholds.

    Returns:
        For each object, the number of each pixel's region; regions count from 0.
    """
    flat = points.reshape(-1, 3)
    cloud = flat[valid.ravel()]
    wanted = np.unique(np.concatenate([*objects, np.empty(0, dtype=np.int64)]))
    normals, curvatures = normals_of(cloud, flat[wanted], config.normal_neighbors)
    regions = []
    for pixels in objects:
        own = np.searchsorted(wanted, pixels)
        neighbors = _nearest(KDTree(flat[pixels]), flat[pixels], config.region_neighbors)
        regions.append(_grow(neighbors, normals[own], curvatures[own], config))
    return regions


def normals_of(
    cloud: NDArray[np.float32], at: NDArray[np.float32], k: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit a plane to the k points of the cloud that are nearest to each of some points.

    Source: PCL 1.13, `computePointNormal`.

    Args:
        cloud: finite points, shape (N, 3).
        at: points whose normals are wanted, shape (M, 3).
        k: number of neighbors, including the point itself if it belongs to the cloud.

    Returns:
        Unit normals of either sign, shape (M, 3); and curvatures, the share of the neighbors'
        variance along the normal, from 0 (flat) to 1/3, shape (M,).
    """
    normals = np.empty((len(at), 3))
    curvatures = np.empty(len(at))
    if len(at) == 0:
        return normals, curvatures
    tree = KDTree(cloud)
    for start in range(0, len(at), CHUNK):
        chunk = slice(start, start + CHUNK)
        around = cloud[_nearest(tree, at[chunk], k)].astype(np.float64)
        around -= around.mean(axis=1, keepdims=True)
        variances, axes = np.linalg.eigh(np.swapaxes(around, 1, 2) @ around)
        normals[chunk] = axes[:, :, 0]
        total = variances.sum(axis=1)
        curvatures[chunk] = variances[:, 0] / np.where(total > 0, total, 1)
    return normals, curvatures


def _nearest(tree: KDTree, at: NDArray[np.float32], k: int) -> IntArray:
    """Return the indices of the k nearest points in the tree, or of all if there are fewer."""
    ranks = np.arange(1, min(k, tree.n) + 1)
    return np.asarray(tree.query(at, ranks)[1])


def _grow(
    neighbors: IntArray,
    normals: NDArray[np.float64],
    curvatures: NDArray[np.float64],
    config: PerceptionConfig,
) -> IntArray:
    """Return the region of each point of one object."""
    cosines = np.abs(np.einsum("ni,nki->nk", normals, normals[neighbors]))
    joins = cosines >= np.cos(np.radians(config.smoothness_deg))
    spreads = curvatures <= config.curvature_threshold
    return np.asarray(_flood(np.argsort(curvatures, kind="stable"), neighbors, joins, spreads))


@loop(allocates=True)
def _flood(seeds: IntArray, neighbors: IntArray, joins: BoolArray, spreads: BoolArray) -> IntArray:
    """Grow one region after the other, from the flattest point that is still free.

    Neighborhood is not mutual, so the order matters: points that an earlier
    region cannot reach stay free for a later one.
    """
    region_of = np.full(len(seeds), -1)
    queue = np.empty(len(seeds), dtype=np.int64)
    region = 0
    for seed in seeds:
        if region_of[seed] >= 0:
            continue
        region_of[seed] = region
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            point = queue[head]
            head += 1
            for rank in range(neighbors.shape[1]):
                other = neighbors[point, rank]
                if joins[point, rank] and region_of[other] < 0:
                    region_of[other] = region
                    if spreads[other]:
                        queue[tail] = other
                        tail += 1
        region += 1
    return region_of
