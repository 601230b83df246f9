"""One frame, from its points and detections to what it says about the floor."""

from __future__ import annotations

from hypermap.core.trajectory import transform_points
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.perception.segmentation import segment, valid_pixels
from hypermap.perception.shapes import footprint


def observe(frame: RgbdFrame, detections: Detections, config: PerceptionConfig) -> Observation:
    """Return the objects of a frame as shapes on the floor, and the area that it could see.

    A detection gives no object where the camera saw too few points, where no smooth region is
    large enough, or where all its points lie above one line of the floor.

    Args:
        frame: depth, intrinsics and pose.
        detections: boxes or masks in the frame's image; boxes may reach past it.
        config: method and thresholds.

    Raises:
        ValueError: If the detections' masks are not of the frame's size.

    Source: section 3.4 of the thesis behind the first Hypermap program.
    """
    points = frame.points()
    valid = valid_pixels(frame, config)
    detections = detections[detections.scores >= config.min_score]

    objects = []
    for found in segment(points, valid, frame.camera, detections, config):
        points_map = transform_points(frame.map_T_camera, found.points_xyz)
        shape = footprint(points_map, config.voxel_size)
        if shape.is_empty:
            continue
        objects.append(
            ObservedObject(
                name=str(detections.names[found.detection]),
                score=float(detections.scores[found.detection]),
                footprint=shape,
                z_min=float(points_map[:, 2].min()),
                z_max=float(points_map[:, 2].max()),
            )
        )
    some = (slice(None, None, config.visible_step),) * 2
    some_points_map = transform_points(frame.map_T_camera, points[some][valid[some]])
    visible_area = footprint(some_points_map, config.voxel_size)
    return Observation(frame.stamp, frame.map_T_camera, tuple(objects), visible_area)
