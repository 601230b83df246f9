"""What Open3D can do of one frame's perception: normals, and clusters of points.

Open3D's normals on a real frame are not the right ones, and neither are ours: a camera's noise
turns them by degrees, and other ones with other neighbors. So a made-up frame with such noise says
whose are nearer to the true ones. Its clusters look at distances alone; so do our regions where
normals may differ by a right angle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.projection import rows_of
from hypermap.perception.region_growing.normals import fit_planes
from hypermap.perception.region_growing.padded import MARGIN, planes_of
from hypermap.perception.segmentation import segment, valid_pixels
from suite.race import Disagreement, Race, Settings, library, race
from suite.scenes import ORGANISED, SIZES, Scene, load_scenes, pixel_iou

NEIGHBORS = 50  # of a normal, as in PCL
BY_DISTANCE = replace(ORGANISED, smoothness_deg=90.0)
# Our distance is that of a point's nearest neighbors. This one is about as large at 320 x 240 in
# the room of the frames; the denser clouds of 640 x 480 hang together otherwise.
CLUSTERED, DISTANCE = 240, 0.03  # the height of the frames [pixels], and the distance there [m]
SAME_CLUSTERS = 0.97  # least mean IoU of the largest clusters


def races(settings: Settings) -> Iterator[Race]:
    """Yield the normals of all points of a frame, and the clusters in its boxes."""
    o3d = library("open3d")
    scenes = load_scenes(settings.folder("pcl_golden"), settings.folder("desk"))
    for height in SIZES:
        some = [scene for scene in scenes if scene.depth.shape[0] == height]
        yield _normals(o3d, some[0], settings)
        if height == CLUSTERED:
            yield _clusters(o3d, some, settings)


def _cloud_of(o3d: Any, points: NDArray[np.float32]) -> Any:
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(float)))


def _version(o3d: Any) -> str:
    return f"Open3D {o3d.__version__} (C++)"


# Normals


def _normals(o3d: Any, scene: Scene, settings: Settings) -> Race:
    knn = o3d.geometry.KDTreeSearchParamKNN(NEIGHBORS)

    def theirs(cloud: Any) -> NDArray[np.float64]:
        cloud.estimate_normals(knn, fast_normal_computation=True)
        return np.asarray(cloud.normals)

    made_up, true_normals = noisy_desk(scene.camera)
    valid = np.isfinite(made_up.depth)
    off = [
        angles(normals, true_normals[valid])
        for normals in (
            all_normals(made_up, valid),
            theirs(_cloud_of(o3d, made_up.points()[valid])),
        )
    ]
    frame = scene.frame()
    points, valid = frame.points(), np.isfinite(frame.depth)
    return race(
        f"normals of all points of a frame of {SIZES[len(valid)]}",
        _version(o3d),
        partial(all_normals, frame, valid),
        partial(theirs, _cloud_of(o3d, points[valid])),
        partial(as_near, *off),
        settings,
    )


def noisy_desk(camera: Camera) -> tuple[RgbdFrame, NDArray[np.float64]]:
    """Return a frame of a desk, a wall, a slanted board and three balls, and its true normals.

    The noise is a Kinect's, in disparity and quantized there, and one pixel of a hundred is lost.
    """
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[: camera.height, : camera.width]
    K = camera.K
    rays = np.stack(
        [(columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1], np.ones(rows.shape)], axis=-1
    )
    depth, normals = np.full(rows.shape, np.inf), np.zeros(rays.shape)

    def put(distance: NDArray[np.float64], of: NDArray[np.float64]) -> None:
        nearest = (distance > 0) & (distance < depth)
        depth[nearest] = distance[nearest]
        normals[nearest] = np.broadcast_to(of, normals.shape)[nearest]

    for normal, offset in (((0, 0.8, 0.6), 0.55), ((0.2, 0.3, -1), -2.2), ((1, -0.2, 0.35), 1.6)):
        direction = np.array(normal) / np.linalg.norm(normal)
        put(offset / (rays @ direction), direction)
    for center, radius in (
        ((0.1, 0.05, 0.8), 0.1),
        ((-0.25, 0.1, 1.0), 0.15),
        ((0.4, -0.1, 1.4), 0.25),
    ):
        squares, along = np.sum(rays**2, axis=-1), rays @ center
        root = along**2 - squares * (np.dot(center, center) - radius**2)
        distance = np.where(root > 0, (along - np.sqrt(np.maximum(root, 0))) / squares, np.inf)
        hit = rays * np.where(root > 0, distance, 0)[..., np.newaxis]
        put(distance, (hit - center) / radius)
    disparity = np.round((1 / depth + rng.normal(0, 0.0008, depth.shape)) / 0.0029) * 0.0029
    disparity[rng.random(depth.shape) < 0.01] = np.nan
    return RgbdFrame(0.0, (1 / disparity).astype(np.float32), camera, np.eye(4)), normals


def all_normals(frame: RgbdFrame, valid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the normals of all points of a frame, shape (N, 3)."""
    planes = planes_of(rows_of(frame.depth, frame.camera.K, frame.cloud), valid, 0, 0, *valid.shape)
    K = frame.camera.K
    normals, *_ = fit_planes(planes, np.pad(valid, MARGIN), NEIGHBORS, (K[0, 0], K[1, 1]))
    inner = normals[:, MARGIN:-MARGIN, MARGIN:-MARGIN]
    return inner[:, valid].T.astype(float)


def angles(normals: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angle between each two unit normals, whatever their sign [degrees]."""
    cosines = np.abs(np.sum(normals * others, axis=1))
    found: NDArray[np.float64] = np.degrees(np.arccos(np.clip(cosines, 0, 1)))
    return found


def as_near(
    ours_off: NDArray[np.float64],
    theirs_off: NDArray[np.float64],
    ours: NDArray[np.float64],
    theirs: NDArray[np.float64],
) -> str:
    """Return how far both are from the true normals, and ours from theirs on the real frame.

    Raises:
        Disagreement: If ours are farther from the true ones than theirs by more than a tenth.
    """
    percents = [50, 90, 95]
    own, peer = np.percentile(ours_off, percents), np.percentile(theirs_off, percents)
    middle, most = np.percentile(angles(ours, theirs), [50, 90])
    said = (
        f"off the true normals of a made-up frame, half, 90 % and 95 % of them by at most "
        f"{own[0]:.2f}, {own[1]:.2f}, {own[2]:.2f} degrees, Open3D's by "
        f"{peer[0]:.2f}, {peer[1]:.2f}, {peer[2]:.2f}; "
        f"on the real frame half differ by at most {middle:.1f}, 90 % by {most:.1f}"
    )
    if (own > 1.1 * peer).any():
        raise Disagreement(said)
    return said


# Clusters


def _clusters(o3d: Any, scenes: Sequence[Scene], settings: Settings) -> Race:
    """Return who is faster to find the largest cluster in each box; ours computes normals, too."""
    asked = []
    for scene in scenes:
        frame = scene.frame()
        points = frame.points().reshape(-1, 3)
        valid = valid_pixels(frame, BY_DISTANCE)
        in_boxes = [pixels_in(box, valid) for box in scene.boxes]
        asked += [(pixels, _cloud_of(o3d, points[pixels])) for pixels in in_boxes]

    def theirs() -> list[IntArray]:
        return [_largest(pixels, cloud.cluster_dbscan(DISTANCE, 1)) for pixels, cloud in asked]

    return race(
        f"clusters by distance in the boxes of a frame of {SIZES[CLUSTERED]}",
        _version(o3d),
        partial(clusters_by_distance, scenes),
        theirs,
        same_clusters,
        settings,
        each=len(scenes),
    )


def pixels_in(box: NDArray[np.int32], valid: NDArray[np.bool_]) -> IntArray:
    """Return the valid pixels of a box, up to but without its end, as row-major indices."""
    left, top, right, bottom = np.maximum(box, 0).tolist()
    inside = np.zeros_like(valid)
    inside[top:bottom, left:right] = valid[top:bottom, left:right]
    return np.flatnonzero(inside)


def _largest(pixels: IntArray, labels: Any) -> IntArray:
    of = np.asarray(labels)
    return np.asarray(pixels[of == np.bincount(of).argmax()])


def clusters_by_distance(scenes: Sequence[Scene]) -> list[IntArray]:
    """Return the pixels of the largest cluster in each box."""
    found = []
    for scene in scenes:
        frame = scene.frame()
        valid = valid_pixels(frame, BY_DISTANCE)
        of = {
            part.detection: part.pixels
            for part in segment(frame, valid, scene.detections(), BY_DISTANCE)
        }
        found += [of.get(box, np.empty(0, np.int64)) for box in range(len(scene.boxes))]
    return found


def same_clusters(ours: Sequence[IntArray], theirs: Sequence[IntArray]) -> str:
    """Return how far the clusters agree.

    Raises:
        Disagreement: If their mean IoU is below `SAME_CLUSTERS`.
    """
    ious = [pixel_iou(*both) for both in zip(ours, theirs, strict=True)]
    said = (
        f"largest clusters of {len(ious)} boxes: "
        f"mean IoU {np.mean(ious):.4f}, median {np.median(ious):.4f}"
    )
    if np.mean(ious) < SAME_CLUSTERS:
        raise Disagreement(said)
    return said
