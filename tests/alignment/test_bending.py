"""A bent map is put onto a better one by a smooth field of shifts."""

from __future__ import annotations

import functools
import logging

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from hypermap import GridGeometry, Hypermap, NotesLayer, OccupancyLayer, Pose2D, SemanticLayer
from hypermap.alignment import Bend, NotAligned, bend_of
from hypermap.core.frames import FrameTree, Transform
from hypermap.core.notes import Note
from hypermap.core.samples import Samples
from hypermap.core.semantic import SemanticObject
from hypermap.core.value_layer import ValueLayer
from hypermap.mapping.bent_map import bent_onto
from hypermap.paths.floors import Connector, connectors_on, with_connector
from hypermap.values import value_layer_of

SIDE, WIDTH, HEIGHT = 0.05, 200, 160  # m, cells: 10 m x 8 m
PLACES = np.array([[1.5, 1.5], [8.0, 2.0], [4.5, 6.5], [2.5, 4.0], [9.0, 6.5]])


def bent(points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a robot that drifts maps points."""
    x, y = points_xy.T
    return np.asarray(points_xy + 0.3 * np.column_stack([np.sin(y / 3), np.sin(x / 4 + 1)]))


def rooms(is_bent: bool = False, has_doors: bool = True) -> OccupancyLayer:
    """Some rooms; a bent map shows each point where `bent` puts it."""
    grid = GridGeometry(WIDTH + 40, HEIGHT + 40, SIDE, Pose2D(-1.0, -1.0))
    shown = grid.centers(*np.mgrid[: grid.height, : grid.width].reshape(2, -1))
    points = shown.copy()
    for _ in range(12 if is_bent else 0):
        points = shown - (bent(points) - points)
    x, y = points.T
    inside = (x > 0) & (x < 10) & (y > 0) & (y < 8)
    wall = (x < 0.1) | (x > 9.9) | (y < 0.1) | (y > 7.9)
    wall |= (np.abs(x - 5) < 0.06) & ((np.abs(y - 2) > 0.5) if has_doors else y > 1)
    wall |= (np.abs(y - 5) < 0.06) & (np.abs(x - 3) > 0.5) & (np.abs(x - 7.5) > 0.5)
    cells = np.where(inside, np.where(wall, 100, 0), -1).astype(np.int8)
    return OccupancyLayer("occupancy", "map", grid, cells.reshape(grid.height, grid.width))


def test_walls_show_where_each_place_of_a_bent_map_is() -> None:
    bend = bend_of(Hypermap([rooms(has_doors=False)]), Hypermap([rooms(is_bent=True)]), Pose2D())
    off = np.linalg.norm(bend.moved(bent(PLACES)) - PLACES, axis=1)
    assert np.linalg.norm(bent(PLACES) - PLACES, axis=1).mean() > 0.25
    assert off.mean() < 0.06
    assert off.max() < 0.12
    assert bend.before < 0.6
    assert bend.after > 0.9


def test_a_map_that_is_not_bent_stays_as_it_is() -> None:
    said = "bending does not help: 100% of the walls agree without .*; leave out --local"
    with pytest.raises(NotAligned, match=said):
        bend_of(Hypermap([rooms()]), Hypermap([rooms()]), Pose2D())


def test_a_map_of_another_place_is_not_bent_into_this_one() -> None:
    with pytest.raises(NotAligned, match="do the maps show the same floor"):
        bend_of(Hypermap([rooms()]), Hypermap([rooms()]), Pose2D(2.3, 1.2, 0.7))


@functools.cache
def bend() -> Bend:
    return bend_of(Hypermap([rooms()]), Hypermap([rooms(is_bent=True)]), Pose2D())


def put_onto(first: Hypermap, second: Hypermap) -> Hypermap:
    return bent_onto(first, second, Pose2D(), bend())


def test_all_that_has_a_place_moves_onto_the_better_map(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    was = bent(PLACES)
    objects = [SemanticObject("cup", shapely.Point(place).buffer(0.1)) for place in was]
    samples = Samples.of(was, [20.0, 21.0, 22.0, 23.0, 24.0])
    doors = [{"to": 1, "line": was[:2].tolist(), "width": 0.9}]
    outlines = [shapely.box(1, 1, 2, 2), shapely.box(2, 1, 3, 2)]
    second = Hypermap(
        [
            rooms(is_bent=True),
            SemanticLayer("semantic", "map", objects),
            SemanticLayer(
                "rooms",
                "map",
                [
                    SemanticObject(f"room {number}", outline, attributes={"doors": doors})
                    for number, outline in enumerate(outlines)
                ],
            ),
            NotesLayer("notes", "map", [Note(shapely.Point(was[0]), "Loose tile")], next_id=7),
            value_layer_of("warmth", samples, rooms(is_bent=True), unit="°C"),
        ],
        metadata={"config": {}, "map_id": "00ff", "map_version": 3, "floor": "1"},
    )
    second["warmth"].settings["show"] = False
    second = with_connector(second, Connector("lift", (was[1][0], was[1][1]), "up.hmap", (0, 0)))
    second.mapper_state = b"not moved"
    first = Hypermap([rooms()], metadata={"map_id": "1a5e"})
    made = put_onto(first, second)
    assert [layer.name for layer in made] == ["occupancy", "semantic", "rooms", "notes", "warmth"]
    assert made.occupancy().cells is first.occupancy().cells
    centers = [item.footprint.centroid.coords[0] for item in made.semantic("semantic").objects()]
    np.testing.assert_allclose(centers, PLACES, atol=0.12)
    (door,) = made.semantic("rooms")[0].attributes["doors"]
    np.testing.assert_allclose(door["line"], PLACES[:2], atol=0.12)
    notes = made.layer("notes", NotesLayer)
    np.testing.assert_allclose(notes[7].place.coords[0], PLACES[0], atol=0.12)
    assert notes.next_id == 8
    warmth = made.layer("warmth", ValueLayer)
    assert warmth.samples is not None
    np.testing.assert_allclose(warmth.samples.points_xy, PLACES, atol=0.12)
    assert warmth.settings == {"show": False}
    (lift,) = connectors_on(made)
    np.testing.assert_allclose(lift.at_xy, PLACES[1], atol=0.12)
    assert made.mapper_state is None
    assert second.semantic("semantic")[0].footprint.centroid.coords[0] == pytest.approx(was[0])
    assert not caplog.records
    del made.metadata["connectors"]
    assert made.metadata == {"floor": "1", "aligned_to": "1a5e"}  # it is in the frame of the first


def test_what_cannot_be_moved_is_left_out_with_a_word(caplog: pytest.LogCaptureFixture) -> None:
    crossed = shapely.Polygon([(1, 1), (2, 2), (2, 1), (1, 2)])
    flat = shapely.Polygon([(3, 3), (4, 3), (3, 3)])
    few = Samples.of([[1.0, 1.0], [2.0, 1.0]], [20.0, 21.0])
    second = Hypermap(
        [
            rooms(is_bent=True),
            SemanticLayer("semantic", "map", [SemanticObject("x", crossed)]),
            SemanticLayer("flat", "map", [SemanticObject("y", flat)]),
            SemanticLayer("lost", "nowhere", [SemanticObject("z", shapely.box(0, 0, 1, 1))]),
            ValueLayer("bare", "map", unit="°C"),
            ValueLayer("few", "map", GridGeometry(1, 1, 1.0), [[20.0]], samples=few),
        ]
    )
    made = put_onto(Hypermap([rooms()]), second)
    assert [layer.name for layer in made] == ["occupancy", "semantic", "flat", "few"]
    assert len(made.layer("few", ValueLayer).samples or ()) == 2
    assert [record.getMessage().split(":")[0] for record in caplog.records] == [
        "layer 'lost' of the bent map is left out",
        "layer 'bare' of the bent map is left out",
        "layer 'few' keeps its samples, but has no values",
    ]


def test_the_result_is_in_the_base_frame_of_the_better_map() -> None:
    walls = rooms()
    walls.frame_id = "laser"
    objects = SemanticLayer("objects", "map")
    first = Hypermap([objects, walls], FrameTree([Transform("map", "laser", Pose2D(1, 2, 0.3))]))
    notes = NotesLayer("notes", "map", [Note(shapely.Point(1, 1), "Loose tile")])
    made = put_onto(first, Hypermap([rooms(is_bent=True), notes]))
    assert made.base_frame == first.base_frame == made["notes"].frame_id
