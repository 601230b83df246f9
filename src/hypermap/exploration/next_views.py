"""Viewpoints from which to look at the uncertain objects of a map next."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.evidence import EvidenceTable, is_one_sided
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import ROOMS, FoundObject, Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.exploration.sensor import Sensor
from hypermap.exploration.visibility import CLEAR, MOST_CELLS, WALL, Visibility
from hypermap.paths import Planner
from hypermap.paths.settings import STAND_OFF

_FARTHEST = 2.5  # meters from an object; a depth camera measures shapes badly from farther away
_NEW_SIDE = math.radians(30)  # around the object from the earlier views; less is the same side


@dataclass(frozen=True, eq=False)
class NextView:
    """A viewpoint from which to look at an uncertain object, in the base frame of the map.

    Attributes:
        item: the object.
        pose: of the robot, facing the object.
        distance: length of the shortest path to the viewpoint [m].
        turn: angle around the object to the closest earlier view [rad]; pi if none is known.
        is_weak: whether its existence is low.
        is_one_sided: whether it was only seen from one side.
    """

    item: FoundObject
    pose: Pose2D
    distance: float
    turn: float
    is_weak: bool
    is_one_sided: bool


def find_next_views(
    hypermap: Hypermap,
    planner: Planner,
    meters: NDArray[np.float32],
    sensor: Sensor,
    sure_from: float,
    per_meter: float,
) -> Iterator[NextView]:
    """Yield a viewpoint for each uncertain object that can be seen from a new side.

    Args:
        hypermap: the map.
        planner: for the map and the robot.
        meters: length of the path to each cell, shape (height, width).
        sensor: range and field of view of the robot's sensor.
        sure_from: existence below which an object is uncertain. Objects without an existence,
            such as those drawn by hand, are certain.
        per_meter: the score of a viewpoint is `turn` * exp(-per_meter * length of the path).
    """
    nearest = max(STAND_OFF, planner.space.settings.robot_radius)
    farthest = max(nearest, min(_FARTHEST, sensor.max_range))
    grid = planner.space.grid
    past_objects = None
    for one in _uncertain_objects(hypermap, sure_from):
        if past_objects is None:
            past_objects = np.where(planner.sight.clear, np.uint8(CLEAR), np.uint8(WALL))
        shape = one.item.object.footprint
        cells, _ = planner.sight.around(shape, nearest, farthest)
        far = meters.ravel()[cells]
        ok = np.isfinite(far) & _sees(grid, past_objects, shape, cells, farthest)
        if not ok.any():
            continue
        far = far[ok].astype(np.float64)
        places = grid.centers(*np.divmod(cells[ok], grid.width))
        turns = new_angles(one.center_xy, one.cameras_xy, places)
        best = int(np.argmax(turns * np.exp(-per_meter * far)))
        if not one.is_weak and turns[best] < _NEW_SIDE:
            continue
        x, y = places[best].tolist()
        toward = one.center_xy - places[best]
        yield NextView(
            one.item,
            Pose2D(x, y, math.atan2(toward[1], toward[0])),
            float(far[best]),
            float(turns[best]),
            one.is_weak,
            one.is_one_sided,
        )


def new_angles(
    center_xy: NDArray[np.float64], cameras_xy: NDArray[np.float64], places_xy: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the angle around a center from each place to the closest camera [rad], shape (N,).

    It is pi where there are no cameras.
    """
    if not len(cameras_xy):
        return np.full(len(places_xy), math.pi)
    places, cameras = (
        np.arctan2(*(points - center_xy).T[::-1]) for points in (places_xy, cameras_xy)
    )
    known = np.sort(cameras)
    known = np.concatenate([[known[-1] - math.tau], known, [known[0] + math.tau]])
    after = np.clip(np.searchsorted(known, places), 1, len(known) - 1)
    return np.asarray(np.minimum(places - known[after - 1], known[after] - places))


@dataclass(frozen=True, eq=False)
class _Uncertain:
    """An uncertain object, its center, shape (2,), and the camera positions [m], shape (N, 2)."""

    item: FoundObject
    center_xy: NDArray[np.float64]
    cameras_xy: NDArray[np.float64]
    is_weak: bool
    is_one_sided: bool


def _uncertain_objects(hypermap: Hypermap, sure_from: float) -> Iterator[_Uncertain]:
    for layer in hypermap:
        if not isinstance(layer, SemanticLayer) or layer.name == ROOMS:
            continue
        base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
        cameras = _cameras(layer.evidence())
        for item in hypermap.objects(layer=layer.name):
            one = item.object
            assert one.id is not None  # it is in a layer
            center = shapely.get_coordinates(shapely.centroid(one.footprint))[0]
            seen_from = base_T_layer.apply(cameras.get(one.id, np.empty((0, 2))))
            is_weak = one.existence is not None and one.existence < sure_from
            one_sided = is_one_sided(center, seen_from)
            if is_weak or one_sided:
                yield _Uncertain(item, center, seen_from, is_weak, one_sided)


def _cameras(table: EvidenceTable | None) -> dict[int, NDArray[np.float64]]:
    """Return the camera positions of each object's evidence, (N, 2), by the object's id."""
    if table is None or not len(table):
        return {}
    order = np.argsort(table.object_ids, kind="stable")
    ids, starts = np.unique(table.object_ids[order], return_index=True)
    places = table.poses[table.views[order], :2, 3]
    return dict(zip(ids.tolist(), np.split(places, starts[1:]), strict=True))


def _sees(
    grid: GridGeometry,
    past_objects: NDArray[np.uint8],
    shape: BaseGeometry,
    cells: IntArray,
    farthest: float,
) -> BoolArray:
    """Return from which cells (flat indices) the middle of a shape is visible, shape (N,)."""
    xmin, ymin, xmax, ymax = shape.bounds
    reach = farthest + math.hypot(xmax - xmin, ymax - ymin) + grid.resolution
    reach = min(reach, MOST_CELLS * grid.resolution)
    middle = shapely.get_coordinates(shapely.point_on_surface(shape))
    row, col = grid.cells_at(middle)[0].tolist()
    seen = Visibility(grid, past_objects, reach).of(row, col, through_unknown=False)
    rows, cols = seen.clear_on(grid.shape)
    return np.isin(cells, rows * grid.width + cols)
