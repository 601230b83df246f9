"""Moves the layers of a bent map onto a better map of the same place."""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.alignment.bending import Bend
from hypermap.core.errors import HypermapError
from hypermap.core.frames import FrameTree, Pose2D
from hypermap.core.history import MAP_ID, MAP_VERSION
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.layer import Layer
from hypermap.core.notes_layer import NotesLayer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.value_layer import ValueLayer
from hypermap.formats.backup import ALIGNED_TO
from hypermap.paths.floors import CONNECTORS, connectors_on, with_connector
from hypermap.rooms.rooms import DOORS
from hypermap.text import counted

Points: TypeAlias = NDArray[np.float64]
Places: TypeAlias = Callable[[Points], Points]
"""Returns where points of a layer are on the better map, shape (N, 2)."""

_OF_THE_BENT_MAP = ("config", "drives", MAP_ID, MAP_VERSION, ALIGNED_TO, CONNECTORS)

_log = logging.getLogger(__name__)


def bent_onto(first: Hypermap, second: Hypermap, a_T_b: Pose2D, bend: Bend) -> Hypermap:
    """Return the layers of a bent map on the occupancy layer of a better one.

    Objects, zones, rooms, notes, samples, lifts and stairs move, each to where the walls around it
    are on the better map. The evidence for the objects does not: mapping cannot continue the
    result, which is a new map, without the id and the history of either. Layers that cannot be
    moved are left out, which is logged.

    Args:
        first: the better map; only its occupancy layer and its frames are used.
        second: the bent map.
        a_T_b: pose of its base frame in that of the first.
        bend: of `bend_of`.

    Raises:
        HypermapError: If the first map does not have exactly one occupancy layer, or the lifts and
            stairs of the second cannot be read.
    """
    walls, frame_id = first.occupancy(), first.base_frame
    layers: list[Layer] = [walls]
    for layer in second:
        if isinstance(layer, OccupancyLayer):
            continue
        try:
            if layer.name == walls.name:
                raise HypermapError("the occupancy layer of the better map has this name")
            pose = a_T_b @ second.frames.lookup(second.base_frame, layer.frame_id)
            layers.append(_moved(layer, frame_id, _placing(bend, pose), walls))
        except HypermapError as error:
            _log.warning("layer %r of the bent map is left out: %s", layer.name, error)
    layers.sort(key=lambda layer: layer.frame_id != frame_id)  # the first layer's is the base frame
    kept = {key: value for key, value in second.metadata.items() if key not in _OF_THE_BENT_MAP}
    if MAP_ID in first.metadata:
        kept[ALIGNED_TO] = first.metadata[MAP_ID]
    return _connected(Hypermap(layers, FrameTree(first.frames), kept), second, bend, a_T_b)


def _placing(bend: Bend, pose: Pose2D) -> Places:
    def places(points_xy: Points) -> Points:
        return np.asarray(bend.moved(pose.apply(points_xy)), np.float64)

    return places


def _connected(made: Hypermap, second: Hypermap, bend: Bend, a_T_b: Pose2D) -> Hypermap:
    """Return a map with the lifts and stairs of the bent one."""
    places = _placing(bend, a_T_b)
    for connector in connectors_on(second):
        ((x, y),) = places(np.array([connector.at_xy])).tolist()
        made = with_connector(made, replace(connector, at_xy=(x, y)))
    return made


def _moved(layer: Layer, frame_id: str, places: Places, walls: OccupancyLayer) -> Layer:
    """Return a layer whose points are elsewhere, in another frame.

    Raises:
        HypermapError: If it cannot be moved.
    """
    if isinstance(layer, SemanticLayer):
        return _moved_objects(layer, frame_id, places)
    if isinstance(layer, NotesLayer):
        notes = [note.with_place(_valid(_shape(note.place, places))) for note in layer.notes()]
        return NotesLayer(
            layer.name,
            frame_id,
            notes,
            layer.settings,
            next_id=layer.next_id,
            inside_up_to=layer.inside_up_to,
        )
    if isinstance(layer, ValueLayer) and layer.samples is not None:
        return _measured_again(layer, layer.samples, frame_id, places, walls)
    why = " without its samples" if isinstance(layer, ValueLayer) else ""
    raise HypermapError(f"a {layer.class_name}{why} cannot be moved")


def _moved_objects(layer: SemanticLayer, frame_id: str, places: Places) -> SemanticLayer:
    moved = layer.copy()
    moved.frame_id, moved.kept_evidence = frame_id, None
    changes: dict[int, SemanticObject] = {}
    for item in layer.objects():
        assert item.id is not None  # as every object in a layer
        attributes = item.attributes
        if layer.name == ROOMS and DOORS in attributes:
            attributes = {**attributes, DOORS: _moved_doors(attributes[DOORS], places)}
        footprint = _shape(item.footprint, places)
        changes[item.id] = replace(item, footprint=footprint, attributes=attributes)
    moved.update_many(changes)
    return moved


def _moved_doors(doors: Any, places: Places) -> list[Mapping[str, Any]]:
    try:
        return [
            {**door, "line": places(np.array(door["line"], np.float64)).tolist()} for door in doors
        ]
    except (TypeError, KeyError, ValueError) as error:
        raise HypermapError(f"the doors of a room cannot be read: {error}") from error


def _shape(geometry: BaseGeometry, places: Places) -> BaseGeometry:
    moved: BaseGeometry = shapely.transform(geometry, places)
    return moved


def _valid(area: BaseGeometry) -> BaseGeometry:
    """Return the place of a note, which must not cross itself."""
    return area if area.is_valid else area.buffer(0)


def _measured_again(
    layer: ValueLayer, samples: Samples, frame_id: str, places: Places, walls: OccupancyLayer
) -> ValueLayer:
    """Return a layer of values estimated from its samples, where they were really taken."""
    # Only here, as few maps have samples, and the solvers take long to import.
    from hypermap.values.layers import unknown_layer_of
    from hypermap.values.on_map import made_again

    samples = replace(samples, points_xy=places(samples.points_xy))
    here = copy.copy(layer)
    here.frame_id = frame_id
    try:
        made = made_again(here, samples, walls if walls.frame_id == frame_id else None)
    except HypermapError as error:
        _log.warning("layer %r keeps its samples, but has no values: %s", layer.name, error)
        names = {"quantity": layer.quantity, "unit": layer.unit}
        made = unknown_layer_of(layer.name, samples, frame_id, **names)
    if made.samples is not None and (lost := len(samples) - len(made.samples)):
        _log.warning(
            "layer %r: left out %s off the better map", layer.name, counted(lost, "sample")
        )
    made.settings.update(layer.settings)
    return made
