"""One frame, from its points and detections to what it says about the floor."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.perception.config import PerceptionConfig
from hypermap.perception.depth_view import DepthView
from hypermap.perception.detections import Detections
from hypermap.perception.footprints import footprint
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.perception.outline import outer_points
from hypermap.perception.projection import transform
from hypermap.perception.segmentation import segment, valid_pixels

PIECE_WEIGHT = 0.5  # of the score of what its box cut out of a surface that runs on


def observe(
    frame: RgbdFrame,
    detections: Detections,
    config: PerceptionConfig,
    keep_segments: bool = False,
) -> Observation:
    """Return the objects of a frame as shapes on the floor, and the area that it could see.

    A detection gives no object where the camera saw too few points, where no smooth region is
    large enough, or where all its points lie above one line of the floor.

    Args:
        frame: depth, intrinsics and pose.
        detections: boxes or masks in the frame's image; boxes may reach past it.
        config: method and thresholds.
        keep_segments: whether the objects carry the points that they were made of.

    Raises:
        ValueError: If the detections' masks are not of the frame's size.

    Source: section 3.4 of the thesis behind the first Hypermap program.
    """
    valid = valid_pixels(frame, config)
    detections = usable_detections(detections, config)

    # In float32 a millimeter counts only near the origin, so shapes far from it are made as if the
    # camera stood there, and then moved back.
    offset = np.round(frame.map_T_camera[:2, 3], -2)
    near_T_camera = frame.map_T_camera.copy()
    near_T_camera[:2, 3] -= offset

    def on_floor(points_near: NDArray[np.float32]) -> BaseGeometry:
        shape = footprint(points_near, config.voxel_size)
        return shapely.transform(shape, lambda xy: xy + offset) if offset.any() else shape

    objects = []
    for found in segment(frame, valid, detections, config):
        points_near = transform(near_T_camera, found.points_xyz)
        shape = on_floor(points_near)
        if shape.is_empty:
            continue
        objects.append(
            ObservedObject(
                name=str(detections.names[found.detection]),
                score=float(detections.scores[found.detection])
                * (PIECE_WEIGHT if found.is_piece else 1.0),
                footprint=shape,
                z_min=float(points_near[:, 2].min()),
                z_max=float(points_near[:, 2].max()),
                segment=found if keep_segments else None,
            )
        )
    outer = outer_points(frame, valid, near_T_camera, config.voxel_size, config.visible_step)
    visible_area = on_floor(transform(near_T_camera, outer))
    view = DepthView.of(frame, config.max_depth)
    return Observation(frame.stamp, frame.map_T_camera, tuple(objects), visible_area, view)


def usable_detections(detections: Detections, config: PerceptionConfig) -> Detections:
    """Return the detections that are sure enough, and of very many of them the best, in order."""
    sure = detections[detections.scores >= config.min_score]
    if len(sure) <= config.max_detections:
        return sure
    best = np.argsort(-sure.scores, kind="stable")[: config.max_detections]
    return sure[np.sort(best)]
