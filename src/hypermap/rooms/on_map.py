"""Finds the rooms of a whole map, from its grid and its objects."""

from __future__ import annotations

from dataclasses import replace

from hypermap.core.arguments import check_kind
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.rooms.find import find_rooms
from hypermap.rooms.kinds import Kinds
from hypermap.rooms.rooms import Rooms
from hypermap.rooms.settings import RoomSettings


def rooms_of_map(
    hypermap: Hypermap,
    settings: RoomSettings | None = None,
    *,
    occupancy: str | None = None,
    kinds: Kinds | None = None,
) -> Rooms:
    """Find the rooms of a map, in the frame of its occupancy layer.

    Objects in the semantic layers determine the kinds; rooms in its layer `rooms` keep their ids
    and the names given by hand.

    Args:
        hypermap: the map, which is unchanged.
        settings: what a room is.
        occupancy: name of the layer; None for the only one.
        kinds: the table of kinds; None for ours.

    Raises:
        HypermapError: If there is not one such layer, it has no free cell, or the layer `rooms` is
            of a different kind.
        FrameError: If a layer's frame is not connected to that of the occupancy.
        TypeError: If it is not a map.
    """
    check_kind(hypermap, Hypermap)
    grid = hypermap.occupancy(occupancy)
    objects: list[SemanticObject] = []
    for layer in hypermap:
        if isinstance(layer, SemanticLayer) and layer.name != ROOMS:
            pose = hypermap.frames.lookup(grid.frame_id, layer.frame_id)
            objects += [
                replace(item, footprint=pose.apply_geometry(item.footprint)) for item in layer
            ]
    previous = _previous(hypermap)
    return find_rooms(grid, settings, objects=objects, kinds=kinds, previous=previous)


def with_rooms(hypermap: Hypermap, rooms: Rooms) -> Hypermap:
    """Return a map with these rooms as its layer `rooms`, which replaces an older one.

    Raises:
        HypermapError: If there is a layer of another kind of that name.
        TypeError: If it is not a map, or these are not rooms.
    """
    check_kind(hypermap, Hypermap)
    check_kind(rooms, Rooms)
    previous = _previous(hypermap)
    layer = rooms.layer()
    if previous is None:
        return hypermap.with_layers([*hypermap, layer])
    layer.settings.update(previous.settings)
    return hypermap.with_layers(layer if each is previous else each for each in hypermap)


def _previous(hypermap: Hypermap) -> SemanticLayer | None:
    if ROOMS not in hypermap:
        return None
    layer = hypermap[ROOMS]
    if not isinstance(layer, SemanticLayer):
        raise HypermapError(
            f"layer {ROOMS!r} is a {layer.class_name}, so rooms cannot be stored in it; rename it"
        )
    return layer
