"""Edit operations on rooms, whose doors change with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from shapely.geometry import LineString

from hypermap import rooms as finding
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import ROOMS
from hypermap.core.occupancy import OccupancyLayer
from hypermap.rooms.rooms import DOORS, Rooms
from hypermap.viewer.live.changes import Draft
from hypermap.viewer.live.request_errors import Refused


def find_rooms(draft: Draft, layer: str) -> None:
    """Add the rooms of a map without rooms, found in its first grid, and their layer.

    Raises:
        Refused: If the layer is not that of rooms, or there are rooms already.
        HypermapError: If the map has no grid with free cells, or no place is a room.
    """
    _check_layer(layer)
    hypermap = draft.hypermap
    if ROOMS in hypermap and len(draft.layer(ROOMS)):
        raise Refused("the map has rooms already; `hypermap rooms` finds them again")
    grids = [each.name for each in hypermap if isinstance(each, OccupancyLayer)]
    found = finding.rooms_of_map(hypermap, occupancy=grids[0] if grids else None)
    if not len(found):
        raise HypermapError(f"no place in layer {grids[0]!r} is as large as a room")
    if ROOMS not in hypermap:
        draft.add_layer(ROOMS)
    frame_id = draft.layer(ROOMS).frame_id
    pose = hypermap.frames.lookup(frame_id, found.frame_id)
    for item in found.moved(pose, frame_id).layer():
        draft.add(ROOMS, item)


def split_room(draft: Draft, layer: str, number: int, line: LineString) -> None:
    """Make two rooms of one.

    Args:
        draft: the map.
        layer: must be that of the rooms.
        number: id of the room.
        line: across it, in the base frame [m].

    Raises:
        Refused: If the layer is another one.
        ObjectNotFound: If there is no such room.
        HypermapError: If the line does not cut it into two parts.
    """
    _check_layer(layer)
    kept = draft.get(ROOMS, number)
    own = draft.layer(ROOMS)
    layer_T_base = draft.hypermap.frames.lookup(own.frame_id, draft.hypermap.base_frame)
    before, new_id = Rooms.of_layer(own), own.snapshot.next_id
    across = LineString(layer_T_base.apply(np.array(line.coords)))
    after = finding.split_room(before, number, across, new_id)
    (new,) = (item for item in after.layer() if item.id == new_id)
    for old in before:
        outline = after[old.id].outline
        if outline is not old.outline:
            changed = kept if old.id == number else draft.get(ROOMS, old.id)
            draft.update(ROOMS, old.id, replace(changed, footprint=outline))
    draft.add(ROOMS, new)
    set_doors(draft, after)


def set_doors(draft: Draft, rooms: Rooms) -> None:
    """Give the rooms of a map their doors, as they are kept in its layer."""
    for wanted in rooms.layer():
        assert wanted.id is not None
        item = draft.get(ROOMS, wanted.id)
        doors = wanted.attributes.get(DOORS)
        if item.attributes.get(DOORS) != doors:
            others = {key: value for key, value in item.attributes.items() if key != DOORS}
            attributes = others if doors is None else {**others, DOORS: doors}
            draft.update(ROOMS, wanted.id, replace(item, attributes=attributes))


def _check_layer(layer: str) -> None:
    if layer != ROOMS:
        raise Refused(f"layer: only {ROOMS!r} has rooms, got {layer!r}")
