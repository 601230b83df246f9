"""Moves the layers of a bent map onto a better map of the same place."""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.alignment.bending import Bend
from hypermap.core.errors import HypermapError
from hypermap.core.frames import FrameTree, Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.notes_layer import NotesLayer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer

Points: TypeAlias = NDArray[np.float64]

_log = logging.getLogger(__name__)


def bent_onto(first: Hypermap, second: Hypermap, a_T_b: Pose2D, bend: Bend) -> Hypermap:
    """Return the layers of a bent map on the occupancy layers of a better one.

    Objects, zones, notes and samples move, each to where the walls around it are on the better map.
    The evidence for the objects does not: mapping cannot continue the result. Layers that cannot be
    moved are left out, which is logged.

    Args:
        first: the better map; only its occupancy layers and frames are used.
        second: the bent map.
        a_T_b: pose of its base frame in that of the first.
        bend: of `bend_of`.
    """
    grids: list[Layer] = [layer for layer in first if isinstance(layer, OccupancyLayer)]
    names = {layer.name for layer in grids}
    walls = first.occupancy(None) if len(grids) == 1 else None
    moved: list[Layer] = []
    for layer in second:
        if isinstance(layer, OccupancyLayer):
            continue
        pose = a_T_b @ second.frames.lookup(second.base_frame, layer.frame_id)

        def places(points_xy: Points, pose: Pose2D = pose) -> Points:
            return np.asarray(bend.moved(pose.apply(points_xy)), np.float64)

        other = _moved(layer, first.base_frame, places, walls)
        if other is None or other.name in names:
            _log.warning("layer %r of the bent map is left out: it cannot be moved", layer.name)
        else:
            moved.append(other)
    result = Hypermap([*grids, *moved], FrameTree(first.frames), second.metadata)
    for key in ("config", "drives"):  # of a map that mapping can continue
        result.metadata.pop(key, None)
    return result


def _moved(
    layer: Layer,
    frame_id: str,
    places: Callable[[Points], Points],
    walls: OccupancyLayer | None,
) -> Layer | None:
    """Return a layer whose points are elsewhere, in another frame; None if it cannot be moved."""

    def shape(geometry: BaseGeometry) -> BaseGeometry:
        moved: BaseGeometry = shapely.transform(geometry, places)
        return moved if moved.is_valid else shapely.make_valid(moved)

    if isinstance(layer, SemanticLayer):
        objects = layer.copy()
        objects.frame_id, objects.kept_evidence = frame_id, None
        objects.update_many(
            {
                item.id: replace(item, footprint=shape(item.footprint))
                for item in objects.objects()
                if item.id is not None
            }
        )
        return objects
    if isinstance(layer, NotesLayer):
        notes = [note.with_place(shape(note.place)) for note in layer.notes()]
        return NotesLayer(layer.name, frame_id, notes, layer.settings)
    if isinstance(layer, ValueLayer) and layer.samples is not None:
        # Only here, as few maps have samples, and the solvers take long to import.
        from hypermap.values.on_map import made_again

        samples = replace(layer.samples, points_xy=places(layer.samples.points_xy))
        here = copy.copy(layer)
        here.frame_id = frame_id
        try:
            return made_again(here, samples, walls)
        except HypermapError as error:
            _log.warning("layer %r: %s", layer.name, error)
    return None
