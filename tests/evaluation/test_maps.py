"""The objects of whole maps in the frame of the truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import Rejected, SemanticLayer, SemanticObject
from hypermap.evaluation.closest import centroids
from hypermap.evaluation.maps import map_objects
from hypermap.testing import occupancy_from_text, square

MAP_T_ODOM = Transform("map", "odom", Pose2D(x=10.0, yaw=math.pi / 2))


def one_cup(frame_id: str, *transforms: Transform) -> Hypermap:
    """A map with a cup at (1, 0) in a frame."""
    layer = SemanticLayer("semantic", frame_id, [square("cup", 1, 0)])
    return Hypermap([layer], FrameTree(transforms))


def test_all_semantic_layers_count_each_brought_into_the_base_frame() -> None:
    things = SemanticLayer("things", "map", [square("sink", 5, 5), square("bin", 7, 7)])
    hypermap = one_cup("odom", MAP_T_ODOM)
    hypermap = Hypermap([things, occupancy_from_text(".."), *hypermap], hypermap.frames)
    found = map_objects(hypermap, "room.hmap")
    assert (found.name, found.frame_id) == ("room.hmap", "map")
    assert [thing.name for thing in found.objects] == ["sink", "bin", "cup"]
    assert found.layers == ("things", "things", "semantic")
    assert centroids(found.objects) == pytest.approx(np.array([[5, 5], [7, 7], [10, 1]]))


def test_rooms_are_not_compared_with_objects() -> None:
    rooms = SemanticLayer("rooms", "map", [square("kitchen", 0, 0)])
    (cup,) = map_objects(Hypermap([*one_cup("map"), rooms]), "room.hmap").objects
    assert cup.name == "cup"
    (kitchen,) = map_objects(Hypermap([rooms]), "rooms.hmap").objects
    assert kitchen.name == "kitchen"


@pytest.mark.parametrize("who_knows", ["the estimate", "the truth", "both"])
def test_another_base_frame_is_brought_into_that_of_the_truth(who_knows: str) -> None:
    estimate = one_cup("odom", *([MAP_T_ODOM] if who_knows != "the truth" else []))
    truth = one_cup("map", *([MAP_T_ODOM] if who_knows != "the estimate" else []))
    found = map_objects(estimate, "a.hmap", truth, "b.hmap")
    assert found.frame_id == "map"
    assert centroids(found.objects) == pytest.approx(np.array([[10.0, 1.0]]))
    back = map_objects(truth, "b.hmap", estimate, "a.hmap")
    assert centroids(back.objects) == pytest.approx(np.array([[0.0, 9.0]]))


def test_unconnected_base_frames_are_an_error_that_names_both() -> None:
    with pytest.raises(FrameError) as raised:
        map_objects(one_cup("odom"), "a.hmap", one_cup("map"), "b.hmap")
    assert str(raised.value) == (
        "a.hmap is in the frame 'odom' and b.hmap in 'map', and neither map has a transform "
        "between the two; add it to the `transforms` of one of them"
    )


def test_a_layer_whose_frame_hangs_in_the_air_is_an_error_that_names_it() -> None:
    hypermap = Hypermap([occupancy_from_text(".."), *one_cup("lab")])
    message = "a.hmap: layer 'semantic': no transform has the frame 'lab'"
    with pytest.raises(FrameError, match=message):
        map_objects(hypermap, "a.hmap")


@pytest.mark.parametrize("layers", [[], [occupancy_from_text("..")]])
def test_a_map_without_a_semantic_layer_is_an_error(layers: list[SemanticLayer]) -> None:
    message = "a.hmap: the map has no layer of objects, so nothing can be compared"
    with pytest.raises(HypermapError, match=message):
        map_objects(Hypermap(layers), "a.hmap")
    with pytest.raises(HypermapError, match=message):
        map_objects(Hypermap(layers), "a.hmap", one_cup("map"), "b.hmap")


def test_only_the_truth_must_have_objects() -> None:
    nothing = Hypermap([SemanticLayer("semantic", "map")])
    with pytest.raises(HypermapError, match=r"b.hmap: the ground truth has no objects"):
        map_objects(nothing, "b.hmap")
    assert map_objects(nothing, "a.hmap", one_cup("map"), "b.hmap").objects == ()


def test_crossing_outlines_and_unread_entries_are_counted() -> None:
    bow_tie = SemanticObject("mat", shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]))
    broken = Rejected(2, "fan", "its shape is not well-known text", {})
    layer = SemanticLayer("semantic", "map", [bow_tie, square("cup", 0, 0)], rejected=[broken])
    found = map_objects(Hypermap([layer]), "a.hmap")
    assert (found.repaired, found.unread) == (1, 1)
    assert len(found.objects) == 2


def test_the_published_office_has_an_entry_that_cannot_be_read(shared_data) -> None:
    from hypermap.formats import open_map

    office = map_objects(open_map(shared_data / "maps" / "office.hmap"), "office.hmap")
    assert (len(office.objects), office.unread) == (34, 1)
