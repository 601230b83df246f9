"""Public functions that are given another kind of argument than they take."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import hypermap
from hypermap import GridGeometry, Hypermap, OccupancyLayer, SemanticLayer, SemanticObject
from hypermap.alignment import align
from hypermap.evaluation import changes_between
from hypermap.exploration import Explorer
from hypermap.history import as_of, at_version
from hypermap.notes import add_note, find_notes
from hypermap.paths import Planner
from hypermap.questions import ask_map
from hypermap.rooms import find_rooms, rooms_of_map, with_rooms

THINGS = SemanticLayer("semantic", "map", [SemanticObject("cup", shapely.box(1, 1, 1.1, 1.1))])
GRID = OccupancyLayer(
    "occupancy", "map", GridGeometry(30, 20, 0.1), np.zeros((20, 30), dtype=np.int8)
)
ROOM = Hypermap([GRID, THINGS])
HERE = [0.5, 0.5]

NO_MAP = (
    "expected Hypermap, got {}; open_map(path) opens one, Hypermap([layer]) makes one of layers"
)
NO_LAYER = "expected SemanticLayer, got {}; map.semantic() is that of a map"
NO_ROBOT = "expected PathSettings, got float; of a robot: PathSettings(robot_radius=0.3)"


@pytest.mark.parametrize(
    "call",
    [
        lambda wrong: hypermap.render(wrong, "never.png"),
        hypermap.plot,
        lambda wrong: hypermap.save_map(wrong, "never.hmap"),
        Planner,
        lambda wrong: Explorer(wrong, HERE),
        lambda wrong: Explorer(wrong, 1),
        rooms_of_map,
        lambda wrong: with_rooms(wrong, rooms_of_map(ROOM)),
        lambda wrong: as_of(wrong, "2026-11-24"),
        lambda wrong: at_version(wrong, 1),
        lambda wrong: align(wrong, ROOM),
        lambda wrong: align(ROOM, wrong),
        lambda wrong: ask_map(wrong, "where is the cup?"),
        find_notes,
        lambda wrong: add_note(wrong, None),
    ],
)
@pytest.mark.parametrize("wrong", [THINGS, GRID, "office.hmap", Path("office.hmap")])
def test_what_is_no_map_is_refused_with_the_way_to_one(
    call: Callable[[Any], Any], wrong: object
) -> None:
    with pytest.raises(TypeError) as caught:
        call(wrong)
    assert str(caught.value) == NO_MAP.format(type(wrong).__name__)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: hypermap.to_geojson(ROOM), NO_LAYER.format("Hypermap")),
        (lambda: hypermap.to_geojson(GRID), NO_LAYER.format("OccupancyLayer")),
        (lambda: hypermap.from_geojson(Path("cups.geojson")), "expected str, got "),
        (lambda: hypermap.to_geodataframe(GRID), "expected SemanticLayer or Hypermap, got "),
        (lambda: hypermap.from_geodataframe(ROOM), "expected GeoDataFrame, got Hypermap"),
        (lambda: Planner(ROOM, 0.3), NO_ROBOT),
        (lambda: Explorer(ROOM, HERE, 0.3), NO_ROBOT),
        (lambda: Explorer(ROOM, HERE, None, 3.0), "expected Sensor, got float"),
        (lambda: Planner(ROOM, keepout=["cup"]), 'expected Zone, got str; around objects: Zone("'),
        (lambda: find_rooms(ROOM), "expected OccupancyLayer, got Hypermap; map.occupancy() is "),
        (lambda: with_rooms(ROOM, THINGS), "expected Rooms, got SemanticLayer; rooms_of_map(map)"),
        (lambda: changes_between(ROOM, ROOM), "expected MapObjects, got Hypermap; hypermap.evalua"),
        (lambda: add_note(ROOM, "wet"), "expected Note, got str; such as Note("),
        (lambda: hypermap.image_of("cup.jpg"), "expected ObjectPicture, got str; layer.pictures("),
        (lambda: ROOM.plot("room.png"), "expected Axes, got str; render(map, path) saves a pictu"),
        (lambda: ROOM.plot(area=(0, 0, 1, 1)), "an area must be a shapely geometry, got tuple"),
        (lambda: ROOM[0], "expected str, got int"),
        (lambda: ROOM.objects(layer=THINGS), "expected str, got SemanticLayer"),
    ],
)
def test_other_arguments_of_the_wrong_kind_are_refused_by_their_type(
    call: Callable[[], Any], message: str
) -> None:
    with pytest.raises(TypeError) as caught:
        call()
    assert str(caught.value).startswith(message)
