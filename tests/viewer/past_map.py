"""The small room over three days: a drive, another one, and an edit."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from hypermap.core.history import MAP_ID, MAP_VERSION, Mapped
from hypermap.core.hypermap import Hypermap
from hypermap.formats import save_map
from hypermap.history import begun, grown
from hypermap.testing import square

from .small_map import CHAIR, CUP, DESK, small_map

MONDAY, TUESDAY, WEDNESDAY = (1_763_971_200.0 + day * 86_400 for day in range(3))
CHAIR_BEFORE, CHAIR_AFTER = (7.0, 5.0), (5.0, 6.5)
PLANT, PLANT_PLACE = 4, (8.5, 6.5)


def past_map() -> Hypermap:
    """Return the room in version 4: mapped in versions 1 and 2, edited in 3 and 4.

    On Tuesday, the chair has moved, the cup is gone, and there is a plant. On Wednesday the desk
    got another name; then the tags of the desk changed.
    """
    hypermap = small_map()
    hypermap.metadata |= {MAP_ID: "00ff", MAP_VERSION: 0}
    layer = hypermap.semantic()
    things = layer.objects()
    layer.remove([thing.id for thing in things if thing.id is not None])
    hypermap.history = dataclasses.replace(begun(hypermap), mapped=Mapped("monday", MONDAY))
    layer.add(things)
    hypermap = grown(hypermap, MONDAY)
    layer = hypermap.semantic()
    layer.update(CHAIR, square("chair", *CHAIR_AFTER))
    layer.remove(CUP)
    layer.add([square("plant", *PLANT_PLACE, 0.6)])
    history = hypermap.history
    assert history is not None
    hypermap.history = dataclasses.replace(history, mapped=Mapped("tuesday", TUESDAY))
    hypermap = grown(hypermap, TUESDAY)
    hypermap.semantic().rename(DESK, "table")
    hypermap = grown(hypermap, WEDNESDAY)
    desk = hypermap.semantic()[DESK]
    hypermap.semantic().update(DESK, dataclasses.replace(desk, tags=("oak",)))
    return grown(hypermap, WEDNESDAY + 60)


def saved_past_map(folder: Path) -> Path:
    path = folder / "room.hmap"
    save_map(past_map(), path)
    return path
