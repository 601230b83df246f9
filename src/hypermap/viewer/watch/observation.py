"""The observation of one frame, as the page draws it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.mapper import MappedFrame
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.viewer.watch.picture import CameraPicture

Polygons = list[list[list[list[float]]]]

_SHARPEST = 3  # decimals of a coordinate in meters
_TOLERANCE = 0.01  # by which the outline of the observed area is simplified [m]


def describe_observation(
    seen: MappedFrame, picture: CameraPicture, config: MappingConfig
) -> dict[str, Any]:
    """Return the detections, footprints, observed area and camera of a frame.

    Pixels are those of the picture; meters are in the map frame.
    """
    observation = seen.observation
    found = {o.segment.detection: o for o in observation.objects if o.segment is not None}
    shape = seen.frame.depth.shape
    return {
        "stamp": observation.stamp,
        "picture": {"width": picture.width, "height": picture.height, "kind": picture.kind},
        "detections": [
            {
                "name": str(name),
                "score": round(float(score), 3),
                "box": _box(box, shape, picture.reduced_by),
                **_on_floor(found.get(number), shape, picture.reduced_by),
            }
            for number, (name, score, box) in enumerate(
                zip(
                    seen.detections.names,
                    seen.detections.scores,
                    seen.detections.xyxy,
                    strict=True,
                )
            )
        ],
        "observed": polygon_rings(
            shapely.simplify(_observed_area(observation, config), _TOLERANCE)
        ),
        "camera": _camera(observation, seen.frame.camera.K[0, 0], shape[1]),
    }


def polygon_rings(shape: BaseGeometry) -> Polygons:
    """Return the polygons of a shape, each as its rings without the last point, the outer first."""
    parts = [p for p in shapely.get_parts(shape) if p.geom_type == "Polygon" and not p.is_empty]
    return [[_ring(ring) for ring in (part.exterior, *part.interiors)] for part in parts]


def runs_of(pixels: IntArray, shape: tuple[int, ...], step: int) -> list[int]:
    """Return pixels of an image as runs in the picture of every `step`-th row and column.

    Args:
        pixels: row-major indices in the image.
        shape: rows and columns of the image.
        step: rows and columns of the image per row and column of the picture.

    Returns:
        Column, row and length of each run, one after the other.

    >>> runs_of(np.array([1, 2, 3, 5, 6]), shape=(2, 4), step=1)
    [1, 0, 3, 1, 1, 2]
    """
    rows, columns = np.divmod(pixels, shape[1])
    kept = (rows % step == 0) & (columns % step == 0)
    rows, columns = rows[kept] // step, columns[kept] // step
    if len(rows) == 0:
        return []
    is_first = np.append(True, (np.diff(columns) != 1) | (np.diff(rows) != 0))
    starts = np.flatnonzero(is_first)
    lengths = np.diff(np.append(starts, len(rows)))
    runs: list[int] = np.column_stack([columns[starts], rows[starts], lengths]).ravel().tolist()
    return runs


def _box(box: NDArray[np.float32], shape: tuple[int, ...], step: int) -> list[float] | None:
    """Return a box within the picture; None if it is not a number."""
    if np.isnan(box).any():
        return None
    height, width = shape[:2]
    inside = np.clip(box.astype(float), 0, [width, height, width, height]) / step
    return [round(side, 1) for side in inside.tolist()]


def _on_floor(found: ObservedObject | None, shape: tuple[int, ...], step: int) -> dict[str, Any]:
    """Return the segment and the footprint of a detection; nothing where there are none."""
    if found is None or found.segment is None:
        return {"runs": [], "footprint": []}
    return {
        "runs": runs_of(found.segment.pixels, shape, step),
        "footprint": polygon_rings(found.footprint),
    }


def _observed_area(observation: Observation, config: MappingConfig) -> BaseGeometry:
    """Return the ground in which missing objects lose existence."""
    view = observation.view
    if config.evidence.sight == "rays" and view is not None and view.is_level:
        return view.ground
    return observation.visible_area


def _camera(observation: Observation, focal_length: float, columns: int) -> dict[str, Any]:
    """Return where the camera stood [m] and, if it did not look down or up, whereto [rad]."""
    pose, view = observation.map_T_camera, observation.view
    is_level = view is not None and view.is_level
    return {
        "x": round(float(pose[0, 3]), _SHARPEST),
        "y": round(float(pose[1, 3]), _SHARPEST),
        "yaw": round(math.atan2(pose[1, 2], pose[0, 2]), 4) if is_level else None,
        "width": round(2 * math.atan(columns / 2 / focal_length), 4),
    }


def _ring(ring: BaseGeometry) -> list[list[float]]:
    points: list[list[float]] = np.round(shapely.get_coordinates(ring)[:-1], _SHARPEST).tolist()
    return points
