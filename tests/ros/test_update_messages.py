"""Updates of objects and of cells in messages of ROS 1 and ROS 2, as their receiver gets them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.from_messages import apply_semantic_update, with_grid_update
from hypermap.ros.messages.to_messages import semantic_map
from hypermap.ros.server.updates import _objects
from hypermap.testing.builders import occupancy_from_text, square

from .message_builder import NAN, SQUARE, item, semantic, update


def things() -> SemanticLayer:
    frame = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 2, 2))
    shelf = SemanticObject("shelf", frame, existence=3.5, attributes={"color": "red"})
    return SemanticLayer("things", "map", [shelf, square("cup", 9, 9), square("bin", 7, 7)])


def test_an_update_adds_changes_and_removes(types: Any) -> None:
    layer = things()
    message = update(
        types,
        to_add=[item(types, "plant", SQUARE, 1), item(types, "door", SQUARE, 1)],
        to_modify=[2, 0],
        updates=[item(types, "basket", SQUARE, 99), item(types, "rack", SQUARE)],
        to_delete=[1],
    )
    assert apply_semantic_update(layer, message) == []
    held = {got.id: got for got in layer.objects()}
    assert {number: got.name for number, got in held.items()} == {
        0: "rack",
        2: "basket",
        3: "plant",
        4: "door",
    }
    assert held[2].footprint.equals(shapely.Polygon(SQUARE))
    assert (held[0].existence, held[0].attributes) == (3.5, {"color": "red"})


def test_a_new_name_keeps_the_exact_shape(types: Any) -> None:
    layer = things()
    before = layer.get(0).footprint
    (sent, *_) = types.sent(semantic_map(layer, types, 0)).objects
    sent.name = "rack"
    assert apply_semantic_update(layer, update(types, to_modify=[0], updates=[sent])) == []
    assert layer.get(0).name == "rack"
    assert layer.get(0).footprint.equals_exact(before)
    assert len(layer.get(0).footprint.interiors) == 1


@pytest.mark.parametrize(
    ("fields", "error"),
    [
        ({"to_modify": [0, 1]}, "names 2 objects to modify, but brings 1 new states"),
        ({"to_modify": []}, "names 0 objects to modify, but brings 1"),
        ({"to_modify": [77]}, "layer 'things' has no object with id 77"),
        ({"to_modify": [2**32 - 1]}, "no object with id 4294967295"),
        ({"to_modify": [0], "to_delete": [50]}, "no object with id 50"),
        ({"to_modify": [1], "to_delete": [1]}, "changes object 1 twice"),
    ],
)
def test_of_an_update_that_contradicts_itself_nothing_is_applied(
    types: Any, fields: Any, error: str
) -> None:
    layer = things()
    message = update(
        types,
        to_add=[item(types, "plant", SQUARE)],
        updates=[item(types, "new", SQUARE)],
        **fields,
    )
    with pytest.raises(FormatError, match=error):
        apply_semantic_update(layer, message)
    assert layer.names.tolist() == ["shelf", "cup", "bin"]


def test_two_states_of_one_object_are_a_contradiction(types: Any) -> None:
    states = [item(types, "a", SQUARE), item(types, "b", SQUARE)]
    with pytest.raises(FormatError, match="changes object 1 twice"):
        apply_semantic_update(things(), update(types, to_modify=[1, 1], updates=states))


def test_a_malformed_shape_in_an_update_leaves_that_object_out(types: Any) -> None:
    layer = things()
    message = update(
        types,
        to_add=[item(types, "line", SQUARE[:2]), item(types, "plant", SQUARE)],
        to_modify=[1, 2],
        updates=[item(types, "mug", [(0, 0), (NAN, 0), (1, 1)]), item(types, "box", SQUARE)],
    )
    assert apply_semantic_update(layer, message) == [
        "to_add 0 ('line') is left out: its shape has 2 different points; three are needed",
        "object 1 ('mug') is left out: its shape has a coordinate that is not finite",
    ]
    assert layer.names.tolist() == ["shelf", "cup", "box", "plant"]


# Updates of cells


def grid_update(types: Any, x: int, y: int, width: int, cells: Any, frame: str = "map") -> Any:
    message = types.message("map_msgs/OccupancyGridUpdate")(
        x=x, y=y, width=width, height=len(cells) // max(width, 1), data=np.array(cells, np.int8)
    )
    message.header.frame_id = frame
    return types.sent(message)


def held(layer: OccupancyLayer) -> list[list[int]]:
    assert layer.cells is not None
    return layer.cells.tolist()


def test_a_window_is_put_into_the_grid(types: Any) -> None:
    layer = occupancy_from_text("....\n....\n....")
    layer.settings["enable_update"] = True
    got = with_grid_update(layer, grid_update(types, 1, 0, 2, [100, -1, 57, 100], "/map"))
    assert held(got) == [[0, 100, -1, 0], [0, 57, 100, 0], [0, 0, 0, 0]]
    assert (got.name, got.frame_id, got.grid) == (layer.name, layer.frame_id, layer.grid)
    assert got.settings == layer.settings
    assert not np.any(layer.cells)  # the old one is as it was


def test_a_window_without_cells_changes_nothing(types: Any) -> None:
    got = with_grid_update(occupancy_from_text(".#"), grid_update(types, 1, 0, 0, []))
    assert held(got) == [[0, 100]]


@pytest.mark.parametrize(
    ("x", "y", "width", "cells", "error"),
    [
        (3, 0, 2, [0, 0], r"2 x 1 cells at \(3, 0\) reach out of the map of 4 x 3 cells"),
        (-1, 0, 2, [0, 0], "reach out of the map"),
        (0, -1, 1, [0, 0], "reach out of the map"),
        (0, 2, 1, [0, 0], "reach out of the map"),
        (0, 0, 2, [0, 101], r"must be -1 to 100, found 0 to 101"),
        (0, 0, 2, [-2, 0], r"must be -1 to 100"),
    ],
)
def test_a_wrong_window_is_refused(
    types: Any, x: int, y: int, width: int, cells: Any, error: str
) -> None:
    layer = occupancy_from_text("....\n....\n....")
    with pytest.raises(FormatError, match=error):
        with_grid_update(layer, grid_update(types, x, y, width, cells))


def test_a_window_with_too_few_cells_is_refused(types: Any) -> None:
    message = grid_update(types, 0, 0, 2, [0, 0])
    message.height = 2
    with pytest.raises(FormatError, match="2 x 2 cells has 2 numbers"):
        with_grid_update(occupancy_from_text("..\n.."), message)


def test_a_window_of_another_frame_is_refused(types: Any) -> None:
    message = grid_update(types, 0, 0, 1, [0], "odom")
    with pytest.raises(FormatError, match="for frame 'odom', but layer 'occupancy' is in 'map'"):
        with_grid_update(occupancy_from_text(".."), message)


def test_an_empty_layer_takes_no_window(types: Any) -> None:
    with pytest.raises(FormatError, match="is empty; an update needs a map"):
        with_grid_update(OccupancyLayer("o", "map"), grid_update(types, 0, 0, 1, [0]))


def test_an_object_that_its_frame_moves_out_of_the_world_is_left_out(types: Any) -> None:
    far = [(1e9 - 1000, 0), (1e9, 0), (1e9, 1000)]
    message = semantic(types, item(types, "plant", SQUARE, 1), item(types, "door", far, 2))
    layer, problems = _objects(things(), message, Pose2D(10.0, 0.0))
    assert [got.name for got in layer.objects()] == ["plant"]
    (problem,) = problems
    assert problem.startswith(
        "object 2 ('door') is left out: a footprint must be finite and within"
    )
