"""Logged frames as if taken from other poses, many at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.mapping.frame_log import LoggedFrame, floor_motions
from hypermap.perception.depth_view import DepthView
from hypermap.perception.observation import Observation, ObservedObject

ROUNDING = 1e-9
"""Largest difference between the numbers of equal poses."""


def moved_frames(
    frames: Sequence[LoggedFrame], poses: Sequence[NDArray[np.float64]], resolution: float
) -> list[LoggedFrame]:
    """Return frames as if taken from other poses, whose roll and pitch are ignored.

    Those that move were not corrected by a map: their poses are the recorded ones from now on.

    Args:
        frames: as they were mapped.
        poses: new `map_T_camera` of each, shape (4, 4).
        resolution: side of a cell [m].
    """
    before = np.array([frame.observation.map_T_camera for frame in frames]).reshape(-1, 4, 4)
    ways = floor_motions(before, np.asarray(poses).reshape(-1, 4, 4))
    matrices = np.array([motion.matrix() for motion, _ in ways]).reshape(-1, 3, 3)
    after = _in_space(matrices, [rise for _, rise in ways]) @ before
    stay = (np.abs(after - before).max(axis=(1, 2)) <= ROUNDING).tolist()
    shapes = iter(_moved_shapes(frames, matrices).tolist())
    return [
        LoggedFrame(
            _moved(frame.observation, pose, lift, stays, shapes),
            None if frame.seen is None else frame.seen.moved(motion, resolution),
            frame.finds_objects,
        )
        for frame, pose, (motion, lift), stays in zip(frames, after, ways, stay, strict=True)
    ]


def _moved_shapes(frames: Sequence[LoggedFrame], matrices: NDArray[np.float64]) -> ObjectArray:
    """Return the moved visible area of each frame, and then its footprints, in one array.

    Args:
        frames: N frames.
        matrices: homogeneous, of how the floor moves, shape (N, 3, 3).
    """
    observations = [frame.observation for frame in frames]
    shapes = as_objects(
        shape
        for each in observations
        for shape in (each.visible_area, *(one.footprint for one in each.objects))
    )
    points, shape_of_point = shapely.get_coordinates(shapes, return_index=True)
    frame_of_shape = np.repeat(
        np.arange(len(frames)), [1 + len(each.objects) for each in observations]
    )
    m = matrices[frame_of_shape[shape_of_point]]
    x, y = points.T
    moved = np.column_stack([m[:, 0, 0] * x + m[:, 0, 1] * y + m[:, 0, 2],
                             m[:, 1, 0] * x + m[:, 1, 1] * y + m[:, 1, 2]])  # fmt: skip
    return np.asarray(shapely.set_coordinates(shapes, moved))


def _moved(
    before: Observation,
    pose: NDArray[np.float64],
    lift: float,
    stays: bool,
    shapes: Iterator[shapely.Polygon],
) -> Observation:
    """Return an observation after a motion over the floor, with its new pose and next shapes."""
    area = next(shapes)
    objects = tuple(
        ObservedObject(one.name, one.score, next(shapes), one.z_min + lift, one.z_max + lift)
        for one in before.objects
    )
    view = before.view
    if view is not None:
        view = DepthView(view.camera, pose, view.reach, view.max_range)
    correction = before.correction if stays else (0.0, 0.0, 0.0)
    return Observation(before.stamp, pose, objects, area, view, correction)


def _in_space(motions: NDArray[np.float64], rises: Sequence[float]) -> NDArray[np.float64]:
    """Return motions over the floor, shape (N, 3, 3), with rises [m], as matrices (N, 4, 4)."""
    matrices = np.tile(np.eye(4), (len(motions), 1, 1))
    rows = np.array([0, 1, 3])
    matrices[:, rows[:, np.newaxis], rows] = motions
    matrices[:, 2, 3] = rises
    return matrices
