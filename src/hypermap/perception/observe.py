"""From the points and detections of one frame to its observation."""

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
from hypermap.perception.paint import some_of
from hypermap.perception.projection import transform
from hypermap.perception.segmentation import segment, valid_pixels


def observe(
    frame: RgbdFrame,
    detections: Detections,
    config: PerceptionConfig,
    keep_segments: bool = False,
) -> Observation:
    """Return the objects of a frame as shapes on the floor, and the visible area.

    A detection gives no object if the camera saw too few points, if no smooth region is
    large enough, if all its points are above one line on the floor, or if they are the floor.

    Args:
        frame: depth, intrinsics and pose.
        detections: boxes or masks in the frame's image; boxes may extend past it.
        config: method and thresholds.
        keep_segments: whether the objects keep their points.

    Raises:
        ValueError: If the detections' masks do not have the frame's size.

    Source: section 3.4 of the thesis behind the first Hypermap program.
    """
    valid = valid_pixels(frame, config)
    detections = usable_detections(detections, config)

    # float32 resolves a millimeter only near the origin, so shapes are made with the camera near
    # the origin and then moved back.
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
        z_min, z_max = float(points_near[:, 2].min()), float(points_near[:, 2].max())
        if abs(z_max) < config.min_top:  # far below z = 0: the floor of this map is elsewhere
            continue
        objects.append(
            ObservedObject(
                name=str(detections.names[found.detection]),
                score=float(detections.scores[found.detection]),
                footprint=shape,
                z_min=z_min,
                z_max=z_max,
                segment=found if keep_segments else None,
                detection=int(found.detection),
                pixel_count=len(found.pixels),
                pixels=some_of(found.pixels),
            )
        )
    outer = outer_points(frame, valid, near_T_camera, config.voxel_size, config.visible_step)
    visible_area = on_floor(transform(near_T_camera, outer))
    view = DepthView.of(frame, config.max_depth)
    return Observation(frame.stamp, frame.map_T_camera, tuple(objects), visible_area, view)


def usable_detections(detections: Detections, config: PerceptionConfig) -> Detections:
    """Return the detections with enough score, and only the best of very many, in order."""
    sure = detections[detections.scores >= config.min_score]
    if len(sure) <= config.max_detections:
        return sure
    best = np.argsort(-sure.scores, kind="stable")[: config.max_detections]
    return sure[np.sort(best)]
