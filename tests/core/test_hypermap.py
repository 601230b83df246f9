from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import example, given

from hypermap.core.errors import FrameError, HypermapError, LayerNotFound
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Found, Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.testing import assert_same_map, occupancy_from_text, square
from hypermap.testing.strategies import points, poses, semantic_layers

# The lab's frame stands at (10, 0) in the map, turned left by 90 degrees:
# (x, y) in the lab is (10 - y, x) in the map.
FRAMES = [
    Transform("map", "lab", Pose2D(10.0, 0.0, math.pi / 2)),
    Transform("moon", "crater", Pose2D()),
]


def building() -> Hypermap:
    return Hypermap(
        [
            occupancy_from_text("##\n.?", name="occupancy", frame_id="map"),
            SemanticLayer(
                "lab",
                "lab",
                [
                    SemanticObject("room B", shapely.box(0, 0, 6, 6)),
                    square("sink", 1, 1),
                    square("chair", 3, 1),
                    square("chair", 1, 7),
                    square("chair", 5.5, 5.5, 2),  # reaches out of the room
                ],
            ),
            SemanticLayer("hall", "map", [square("chair", 0, 0), square("sink", 0, -2.5)]),
            SemanticLayer("crater", "crater", [square("rock", 0, 0)]),
        ],
        FrameTree(FRAMES),
        {"made by": "hand"},
    )


def near_building() -> Hypermap:
    hypermap = building()
    hypermap.remove("crater")
    return hypermap


# Layers and frames


def test_a_map_says_what_is_in_it() -> None:
    assert repr(building()) == (
        "<Hypermap in frame 'map': 4 layers>\n"
        "  occupancy  OccupancyLayer  2 x 2 cells of 1 m (2 x 2 m)\n"
        "  lab        SemanticLayer   5 objects (3 chair, 1 room B, 1 sink), in frame 'lab'\n"
        "  hall       SemanticLayer   2 objects (1 chair, 1 sink)\n"
        "  crater     SemanticLayer   1 object (1 rock), in frame 'crater'"
    )
    assert repr(Hypermap()) == "<Hypermap in frame 'map': 0 layers>"


def test_layers_are_had_as_what_they_are() -> None:
    hypermap = building()
    assert hypermap.semantic("lab") is hypermap["lab"]
    assert hypermap.occupancy() is hypermap.occupancy("occupancy") is hypermap["occupancy"]
    assert Hypermap([hypermap["lab"]]).semantic() is hypermap["lab"]
    rooms = SemanticLayer("rooms", hypermap["lab"].frame_id)
    assert Hypermap([rooms, hypermap["lab"]]).semantic() is hypermap["lab"]  # rooms are found later
    assert Hypermap([rooms]).semantic() is rooms
    with pytest.raises(HypermapError) as error:
        hypermap.semantic("occupancy")
    assert str(error.value) == (
        "layer 'occupancy' is of the kind OccupancyLayer, not SemanticLayer"
    )
    with pytest.raises(HypermapError, match="3 semantic layers; name one of lab, hall, cr"):
        hypermap.semantic()
    with pytest.raises(HypermapError, match="the map has no occupancy layer"):
        Hypermap().occupancy()
    with pytest.raises(LayerNotFound, match="did you mean 'hall'"):
        hypermap.semantic("hal")


def test_what_is_no_layer_or_object_is_refused_by_its_type() -> None:
    cup = SemanticObject("cup", shapely.box(0, 0, 1, 1))
    layer = SemanticLayer("objects", "map", [cup])
    with pytest.raises(TypeError, match="a map consists of layers, got SemanticObject"):
        Hypermap(layer)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="a layer holds SemanticObjects, got str"):
        layer.add([cup, "mug"])  # type: ignore[list-item]
    with pytest.raises(TypeError, match="a layer holds SemanticObjects, got str"):
        layer.update(0, "mug")  # type: ignore[arg-type]
    assert layer.names.tolist() == ["cup"]
    with pytest.raises(TypeError, match="'float' object cannot be interpreted as an integer"):
        Hypermap([layer]).nearest("cup", [0, 0], k=1.5)  # type: ignore[arg-type]


def test_a_layer_is_renamed_in_its_place() -> None:
    hypermap = building()
    layer = hypermap["lab"]
    hypermap.rename("lab", "laboratory")
    assert [layer.name for layer in hypermap] == ["occupancy", "laboratory", "hall", "crater"]
    assert hypermap["laboratory"] is layer
    assert "lab" not in hypermap
    assert ids(hypermap.objects("room B", layer="laboratory")) == [("laboratory", 0)]
    hypermap.rename("hall", "hall")
    for wrong, error in (("hall", HypermapError), ("", ValueError)):
        with pytest.raises(error):
            hypermap.rename("laboratory", wrong)
    with pytest.raises(LayerNotFound):
        hypermap.rename("lab", "x")
    assert [layer.name for layer in hypermap] == ["occupancy", "laboratory", "hall", "crater"]


def test_a_deep_copy_and_a_pickle_are_the_same_map_apart() -> None:
    original = building()
    for again in (copy.deepcopy(original), pickle.loads(pickle.dumps(original))):
        assert_same_map(again, original)
        again.semantic("lab").add(square("lamp", 0, 0))
        again.frames.add(Transform("map", "attic", Pose2D()))
        again.metadata["made by"] = "copy"
    assert_same_map(original, building())


def test_a_copy_has_layers_of_its_own_to_add_and_remove() -> None:
    original = building()
    again = copy.copy(original)
    assert again.layers == original.layers
    again.remove("lab")
    assert "lab" in original


def test_points_may_be_those_of_shapely_in_any_frame() -> None:
    hypermap = near_building()
    points = [shapely.Point(9, 1), shapely.Point(9, 3)]
    for frame in (None, "lab"):
        expected = hypermap.label_at("lab", [(9, 1), (9, 3)], frame_id=frame).tolist()
        assert hypermap.label_at("lab", points, frame_id=frame).tolist() == expected
    (nearest,) = hypermap.nearest("chair", shapely.Point(9, 2.5))
    assert ids([nearest]) == [("lab", 2)]


def test_a_layer_stands_in_place_of_another_in_a_new_map():
    old, new = building(), SemanticLayer("lab", "map", [square("plant", 0, 0)])
    changed = old.with_layer(new)
    assert [layer.name for layer in changed] == [layer.name for layer in old]
    assert (changed["lab"], old["lab"].frame_id) == (new, "lab")
    assert (changed.frames, changed.metadata) == (old.frames, old.metadata)
    with pytest.raises(LayerNotFound):
        old.with_layer(SemanticLayer("attic", "map"))


def test_layers_keep_their_order_and_the_first_ones_frame_is_the_base() -> None:
    hypermap = building()
    assert [layer.name for layer in hypermap.layers] == ["occupancy", "lab", "hall", "crater"]
    assert [layer.name for layer in hypermap] == ["occupancy", "lab", "hall", "crater"]
    assert hypermap.base_frame == "map"
    assert "lab" in hypermap
    assert "cellar" not in hypermap
    hypermap.remove("occupancy")
    assert hypermap.base_frame == "lab"
    hypermap.add(OccupancyLayer("occupancy", "map"))
    assert [layer.name for layer in hypermap.layers] == ["lab", "hall", "crater", "occupancy"]


def test_an_empty_map_has_a_base_frame_and_nothing_else() -> None:
    hypermap = Hypermap()
    assert hypermap.base_frame == "map"
    assert hypermap.layers == hypermap.objects() == hypermap.nearest("chair", [0, 0]) == []


def test_two_layers_cannot_have_one_name() -> None:
    message = "there are two layers with the name 'a'; names must be unique"
    with pytest.raises(HypermapError) as caught:
        Hypermap([OccupancyLayer("a", "map"), SemanticLayer("a", "map")])
    assert str(caught.value) == message


AREA = shapely.box(0, 0, 1, 1)
QUESTIONS: dict[str, Any] = {
    "label_at": lambda m, layer, frame: m.label_at(layer=layer, points_xy=[0, 0], frame_id=frame),
    "value_at": lambda m, layer, frame: m.value_at(layer=layer, points_xy=[0, 0], frame_id=frame),
    "labels_in": lambda m, layer, frame: m.labels_in(layer=layer, area=AREA, frame_id=frame),
    "values_in": lambda m, layer, frame: m.values_in(layer=layer, area=AREA, frame_id=frame),
    "find": lambda m, layer, frame: m.find(layer=layer, what="chair", area=AREA, frame_id=frame),
    "nearest": lambda m, layer, frame: m.nearest("chair", [0, 0], layer=layer, frame_id=frame),
}


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize(
    ("layer", "frame", "error", "message"),
    [
        ("hal", None, LayerNotFound, "there is no layer 'hal'; did you mean 'hall'?"),
        ("hall", "laab", FrameError, "frame 'laab' is unknown to the map; did you mean 'lab'?"),
        ("hall", "zoo", FrameError,
         "frame 'zoo' is unknown to the map; known: map, lab, crater, moon"),
        ("hall", "crater", FrameError,
         "no transform connects the frame 'crater' with the frame 'map'"),
        ("crater", None, FrameError,
         "no transform connects the frame 'map' with the frame 'crater'"),
    ],
)  # fmt: skip
def test_a_question_to_an_unknown_layer_or_frame_is_an_error(
    question: str, layer: str, frame: str | None, error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        QUESTIONS[question](building(), layer, frame)
    expected = {message, message.replace("'map' with the frame 'crater'",
                                         "'crater' with the frame 'map'")}  # fmt: skip
    assert str(caught.value) in expected


def test_a_layer_in_a_frame_without_transforms_can_be_asked_if_all_are_in_it() -> None:
    hypermap = Hypermap([SemanticLayer("s", "odom", [square("cup", 1, 1)])])
    assert hypermap.label_at("s", [1, 1]).tolist() == ["cup"]
    assert hypermap.label_at("s", [1, 1], "odom").tolist() == ["cup"]


# Questions to one layer


@pytest.mark.parametrize(
    ("layer", "point", "frame", "label", "value"),
    [
        ("occupancy", (0.5, 1.5), None, "Occupied", 100),
        ("occupancy", (0.5, 0.5), "map", "Free", 0),
        ("occupancy", (1.5, 8.5), "lab", "Occupied", 100),  # (1.5, 1.5) in the map
        ("occupancy", (0.5, 8.5), "lab", "Unknown", -1),  # (1.5, 0.5)
        ("lab", (9, 1), None, "sink", 1),
        ("lab", (1, 1), "lab", "sink", 1),
        ("lab", (1, 1), "map", "Empty", -1),
    ],
)
def test_points_are_turned_into_the_layers_frame(layer, point, frame, label, value) -> None:
    assert building().label_at(layer, point, frame).tolist() == [label]
    assert building().value_at(layer, point, frame).tolist() == [value]


def test_answers_about_areas_are_in_the_base_frame() -> None:
    hypermap = building()
    in_lab = shapely.box(0.6, 0.6, 3, 3)
    in_map = shapely.box(7, 0.6, 9.4, 3)  # the same place
    for area, frame in ((in_lab, "lab"), (in_map, None), (in_map, "map")):
        labels = hypermap.labels_in("lab", area, frame)
        assert labels.values.tolist() == ["room B", "sink", "chair"]
        np.testing.assert_allclose(labels.points_xy, [(7, 3), (9, 1), (9, 3)], atol=1e-12)
        assert hypermap.values_in("lab", area, frame).values.tolist() == [0, 1, 2]
        np.testing.assert_allclose(hypermap.find("lab", "chair", area, frame), [(9, 3)])
        np.testing.assert_allclose(hypermap.find("lab", 1, area, frame), [(9, 1)])
    assert hypermap.find("occupancy", "Free").tolist() == [[0.5, 0.5]]


ON_A_CORNER = SemanticLayer(
    "semantic",
    "map",
    [
        SemanticObject("chair", shapely.Polygon([(100, 0), (-50, 87), (-25, -43)])),
        SemanticObject("chair", shapely.Polygon([(1, 0), (-2.5, 4.3), (-2.5, -4.3)])),
    ],
)


@given(semantic_layers(), poses, points(min_size=1))
@example(ON_A_CORNER, Pose2D(0.0, 1.0, 1.0), np.array([[1.0, 0.0]]))
def test_a_frame_changes_where_things_are_but_not_what_they_are(layer, pose, xy) -> None:
    first = OccupancyLayer("first", "map")
    other = SemanticLayer("semantic", "lab", layer.objects())
    moved = Hypermap([first, other], FrameTree([Transform("map", "lab", pose)]))
    assert moved.label_at("semantic", xy, "lab").tolist() == layer.label_at(xy).tolist()
    for name in set(layer.names):
        np.testing.assert_allclose(
            moved.find("semantic", name), pose.apply(layer.find(name)), atol=1e-9
        )
        found = moved.nearest(name, xy[0], 3, frame_id="lab")
        _, distances = layer.nearest(name, xy[0], 3)
        np.testing.assert_allclose([f.distance for f in found], distances, atol=1e-9)
        # Of objects that are equally near but for rounding, either may come first.
        for hit in found:
            assert hit.object is not None
            shape = layer.get(hit.object.id).footprint
            assert shape.distance(shapely.Point(xy[0])) == pytest.approx(hit.distance, abs=1e-9)
            place = pose.apply([shape.centroid.coords[0]])[0]
            np.testing.assert_allclose(hit.point_xy, place, atol=1e-9)


# Questions across layers


def ids(found: list[Found]) -> list[tuple[str, int | None]]:
    return [(item.layer, item.object and item.object.id) for item in found]


def test_the_nearest_objects_of_all_layers_come_first() -> None:
    found = near_building().nearest("chair", [9, 2.5], k=3)
    assert ids(found) == [("lab", 2), ("lab", 4), ("lab", 3)]
    distances = [item.distance for item in found]
    np.testing.assert_allclose(distances, [0, math.hypot(3.5, 2), math.hypot(5.5, 1)])
    assert found[0].object is not None
    assert (
        found[0].object.footprint.symmetric_difference(shapely.box(8.5, 2.5, 9.5, 3.5)).area < 1e-9
    )
    np.testing.assert_allclose(found[0].point_xy, [9, 3])
    from_hall = near_building().nearest("chair", [-1, 0], k=2)  # whose layer comes after the lab's
    assert ids(from_hall) == [("hall", 0), ("lab", 3)]
    assert ids(near_building().nearest("chair", [-1, 0])) == [("hall", 0)]
    in_hall = near_building().nearest("chair", [9, 2.5], k=3, layer="hall")
    assert ids(in_hall) == [("hall", 0)]


def test_of_objects_equally_near_to_a_place_the_one_with_the_nearer_centroid_comes_first() -> None:
    boxes = [shapely.box(0, 0, 9, 9), shapely.box(0, 0, 3, 3), shapely.box(0, 0, 5, 5)]
    room = SemanticLayer("room", "map", [SemanticObject("rug", box) for box in boxes])
    found = Hypermap([room]).objects("rug", near=[1, 1])
    assert ids(found) == [("room", 1), ("room", 2), ("room", 0)]
    assert [item.distance for item in found] == [0, 0, 0]


def test_the_nearest_cells_of_a_grid_are_places_without_an_object() -> None:
    (found,) = building().nearest("Free", [0.5, 5.5], layer="occupancy", frame_id="lab")
    # The point is (4.5, 0.5) in the map.
    assert found.object is None
    assert found.point_xy.tolist() == [0.5, 0.5]
    assert found.distance == pytest.approx(4)


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ({"name": "chair"}, [("lab", 2), ("lab", 3), ("lab", 4), ("hall", 0)]),
        ({"name": "lamp"}, []),
        ({"name": "chair", "near": "lamp"}, []),
        ({"name": "chair", "inside": "lamp"}, []),
        ({"name": "chair", "near": shapely.Polygon()}, []),
        ({"name": "chair", "inside": shapely.Polygon()}, []),
        ({"name": "chair", "area": shapely.Polygon()}, []),
        ({"name": "chair", "inside": "room B"}, [("lab", 2), ("lab", 4)]),
        ({"inside": "room B"}, [("lab", 1), ("lab", 2), ("lab", 4)]),  # not in itself
        ({"name": "chair", "inside": shapely.box(-1, -1, 4, 4)}, [("lab", 3), ("hall", 0)]),
        ({"name": "chair", "area": shapely.box(0.5, 0, 3, 1)}, [("lab", 3), ("hall", 0)]),
        ({"name": "chair", "area": shapely.box(0, 6.9, 9, 9), "frame_id": "lab"}, [("lab", 3)]),
    ],
)
def test_objects_are_chosen_by_name_and_place(question: Any, expected: Any) -> None:
    found = near_building().objects(**question)
    assert ids(found) == expected
    assert all(item.distance is None for item in found)


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ({"name": "chair", "near": "sink", "within": 2}, [("lab", 2, 1.0), ("hall", 0, 1.5)]),
        ({"name": "chair", "near": "sink", "within": 1}, [("lab", 2, 1.0)]),
        ({"name": "chair", "near": "sink", "within": 0.999}, []),
        ({"name": "chair", "near": "sink", "within": 2, "inside": "room B"}, [("lab", 2, 1.0)]),
        ({"name": "chair", "near": "chair"},
         [("lab", 3, 2), ("hall", 0, 2), ("lab", 4, 3), ("lab", 2, math.sqrt(10))]),
        ({"name": "room B", "near": "room B"}, []),  # there is no other one
        ({"near": [0, 0], "within": 3, "frame_id": "lab"},
         [("lab", 0, 0), ("lab", 1, math.sqrt(0.5)), ("lab", 2, math.hypot(2.5, 0.5))]),
        ({"name": "sink", "near": shapely.box(0, -1.5, 1, 9), "within": 0.5}, [("hall", 1, 0.5)]),
    ],
)  # fmt: skip
def test_objects_near_something_come_with_their_distances(question: Any, expected: Any) -> None:
    found = near_building().objects(**question)
    assert ids(found) == [(layer, number) for layer, number, _ in expected]
    distances = [item.distance for item in found]
    np.testing.assert_allclose(distances, [distance for *_, distance in expected], atol=1e-12)


def test_objects_of_several_names_come_in_the_order_of_the_layers() -> None:
    hypermap = near_building()
    layer = hypermap.semantic("lab")
    layer.update(2, square("chair", 3, 1))  # stays in its place
    both = [("lab", 1), ("lab", 2), ("lab", 3), ("lab", 4), ("hall", 0), ("hall", 1)]
    for names in (["chair", "sink"], ("sink", "chair", "chair"), {"sink", "chair"}):
        assert ids(hypermap.objects(names)) == both
        assert ids(hypermap.objects(name for name in names)) == both
    assert ids(hypermap.objects(["sink", "sofa"], area=shapely.box(-1, -3, 1, 3))) == [("hall", 1)]
    found = hypermap.objects(["chair", "room B"], near="sink", limit=2)
    assert ids(found) == [("lab", 0), ("lab", 2)]
    assert hypermap.objects([]) == hypermap.objects(["sofa"]) == []


def test_objects_are_chosen_by_tags_and_the_first_of_them_by_a_limit() -> None:
    seats = [
        square("chair", 1, 0, tags=("chair", "stool")),
        square("sofa", 3, 0, tags=("chair", "sofa")),
        square("chair", 2, 0, tags=("chair", "stool")),
    ]
    hypermap = Hypermap([SemanticLayer("seats", "map", seats)])
    assert ids(hypermap.objects(tags=["chair"])) == [("seats", 0), ("seats", 1), ("seats", 2)]
    assert ids(hypermap.objects(tags=["stool", "chair"])) == [("seats", 0), ("seats", 2)]
    assert ids(hypermap.objects(tags="stool")) == [("seats", 0), ("seats", 2)]
    assert ids(hypermap.objects(tags=["bench"])) == []
    assert ids(hypermap.objects(tags=["chair"], limit=2)) == [("seats", 0), ("seats", 1)]
    nearest = hypermap.objects(near=[3, 0], tags=["stool"], limit=1)
    assert ids(nearest) == [("seats", 2)]
    assert nearest[0].distance == 0.5
    with pytest.raises(ValueError, match="limit must be at least 1"):
        hypermap.objects(limit=0)


def test_the_objects_in_an_area_are_found_by_the_index_alone(monkeypatch) -> None:
    crowd = [square("cup", x, y, 0.5) for x in range(30) for y in range(30)]
    layer = SemanticLayer("crowd", "lab", crowd)
    layer.update(31, square("cup", 1, 1, 0.4, id=31))  # lies in the small tree of what is new
    hypermap = Hypermap([OccupancyLayer("grid", "map"), layer], FrameTree(FRAMES))
    moved: list[int] = []
    apply = Pose2D.apply_geometries

    def counting(pose: Pose2D, shapes: Any) -> Any:
        moved.append(len(shapes))
        return apply(pose, shapes)

    monkeypatch.setattr(Pose2D, "apply_geometries", counting)
    area = shapely.box(9.2, -0.3, 10.2, 1.2)  # in the lab: x from -0.3 to 1.2, y from -0.2 to 0.8
    assert ids(hypermap.objects("cup", area=area)) == [("crowd", n) for n in (0, 1, 30, 31)]
    assert max(moved) == 4


def test_found_objects_stand_in_the_base_frame() -> None:
    (sink, _) = near_building().objects("sink")
    assert sink.object is not None
    np.testing.assert_allclose(sink.object.footprint.bounds, (8.5, 0.5, 9.5, 1.5))
    np.testing.assert_allclose(sink.point_xy, (9, 1))


@pytest.mark.parametrize(
    ("question", "error", "message"),
    [
        ({"within": 2}, ValueError, "within needs near: a distance from what?"),
        ({"near": "sink", "within": -1}, ValueError, "within must not be negative, got -1"),
        ({"near": "sink", "within": math.nan}, ValueError, "within must not be negative, got nan"),
        ({"near": [[0, 0], [1, 1]]}, ValueError, "expected a single point, got 2"),
        ({"area": [0, 0, 1, 1]}, TypeError, "an area must be a shapely geometry, got list"),
        ({"near": [0, 0], "frame_id": "laab"}, FrameError,
         "frame 'laab' is unknown to the map; did you mean 'lab'?"),
        ({"near": "sink", "frame_id": "laab"}, FrameError,
         "frame 'laab' is unknown to the map; did you mean 'lab'?"),
    ],
)  # fmt: skip
def test_a_question_that_makes_no_sense_is_refused(
    question: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        near_building().objects("chair", **question)
    assert str(caught.value) == message


def test_all_that_lies_at_a_point_is_reported_the_smallest_first() -> None:
    lab = near_building()
    layer = lab["lab"]
    layer.add([SemanticObject("table", shapely.box(0, 0, 3, 2)), square("tap", 1, 1, 0.2)])
    names = ["tap", "sink", "table", "room B"]
    assert [item.name for item in layer.objects_at([1, 1])] == names
    assert layer.labels_at([1, 1]).tolist() == names
    assert lab.labels_at("lab", [9, 1]).tolist() == names
    assert lab.labels_at("lab", [1, 1], "lab").tolist() == names
    assert [found.object.name for found in lab.objects_at([9, 1]) if found.object] == names
    assert lab.label_at("lab", [9, 1]).tolist() == names[:1]
    assert layer.labels_at([-50, 1]).tolist() == ["Empty"]
    assert layer.objects_at([-50, 1]) == []
    assert lab.labels_at("occupancy", [0.1, 1.1]).tolist() == ["Occupied"]


@given(semantic_layers(), points(1))
def test_the_first_of_all_at_a_point_is_the_one_that_is_reported(layer, asked) -> None:
    point = asked[0]
    there = layer.objects_at(point)
    assert layer.value_at(point).tolist() == ([item.id for item in there] or [-1])[:1]
    assert layer.labels_at(point)[0] == layer.label_at(point)[0]
    around = layer.values_in(shapely.Point(point)).values.tolist()
    assert sorted(item.id for item in there) == sorted(around)


def test_objects_may_have_one_of_several_names() -> None:
    lab = near_building()
    both = lab.objects(["chair", "sink"], near=[0, 0])
    each = lab.objects("chair", near=[0, 0]) + lab.objects("sink", near=[0, 0])
    assert sorted(map(key_of, both)) == sorted(map(key_of, each))
    assert [found.distance for found in both] == sorted(found.distance for found in both)
    found = lab.objects(["sink", "chair", "sink"], layer="lab")
    assert [hit.object.id for hit in found if hit.object] == [1, 2, 3, 4]
    assert lab.objects([]) == []


def key_of(found: Found) -> tuple[str, int]:
    assert found.object is not None
    return found.layer, found.object.id or 0


def test_a_layer_that_no_transform_connects_is_left_out_and_said_to_be(caplog) -> None:
    lab, whole = building(), near_building()
    for _ in range(2):
        assert list(map(key_of, lab.objects())) == list(map(key_of, whole.objects()))
    assert len(lab.nearest("chair", [0, 0], k=9)) == len(whole.nearest("chair", [0, 0], k=9)) == 4
    assert len(lab.objects("chair", near="sink", layer="hall")) == 1
    assert len(lab.objects_at([9, 1])) == len(whole.objects_at([9, 1])) == 2
    assert caplog.messages == [
        "layer 'crater' is left out: no transform connects the frame 'crater' with the frame 'map'"
    ]
    for ask in (
        lambda: lab.objects(layer="crater"),
        lambda: lab.objects(near="sink", layer="crater"),
        lambda: lab.nearest("rock", [0, 0], layer="crater"),
        lambda: lab.objects_at([0, 0], layer="crater"),
    ):
        with pytest.raises(FrameError, match="no transform connects the frame 'crater'"):
            ask()


def test_a_layer_without_objects_is_not_asked_for_them() -> None:
    lab = near_building()
    for ask in (lab.objects, lambda layer: lab.objects_at([0, 0], layer)):
        with pytest.raises(HypermapError) as caught:
            ask(layer="occupancy")
        message = "layer 'occupancy' is of the kind OccupancyLayer, which has no objects"
        assert str(caught.value) == message


def test_a_map_is_the_same_as_one_made_alike_and_no_other() -> None:
    assert_same_map(building(), building())
    other = building()
    other.metadata["made by"] = "robot"
    with pytest.raises(AssertionError, match="the metadata differ"):
        assert_same_map(other, building())
    with pytest.raises(AssertionError, match="the layers differ"):
        assert_same_map(near_building(), building())
    other = building()
    layer = other["hall"]
    assert isinstance(layer, SemanticLayer)
    layer.update(0, square("chair", 0, 1e-12))
    with pytest.raises(AssertionError, match="object 0 'chair': footprint differ"):
        assert_same_map(other, building())


def test_the_objects_of_one_layer_may_be_near_to_those_of_another() -> None:
    def chair(x: float) -> SemanticObject:
        return SemanticObject("chair", shapely.box(x, 0, x + 1, 1))

    sink = SemanticObject("sink", shapely.box(0, 0, 1, 1))
    hypermap = Hypermap(
        [
            SemanticLayer("seats", "map", [chair(3)]),
            SemanticLayer("fixtures", "map", [sink, chair(2)]),
            SemanticLayer("lost", "nowhere", [chair(1)]),
        ]
    )
    (found,) = hypermap.objects("chair", near="sink", layer="seats")
    assert (found.layer, found.distance) == ("seats", 2.0)
    with pytest.raises(LayerNotFound):
        hypermap.objects("chair", layer="seat")


def test_matches_are_counted_and_only_the_wanted_ones_made_into_objects() -> None:
    hypermap = near_building()
    matches = hypermap.matching("chair", near="sink")
    whole = hypermap.objects("chair", near="sink")
    assert len(matches) == len(whole) > 2
    assert ids(matches.first(2)) == ids(whole)[:2]
    assert [found.distance for found in matches.first()] == [found.distance for found in whole]
    assert hypermap.matching("sofa bed").first(3) == []
