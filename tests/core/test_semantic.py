from __future__ import annotations

import copy
import math
import pickle
import threading
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from hypermap.core.errors import ObjectNotFound
from hypermap.core.evidence import EvidenceTable
from hypermap.core.pictures import START_OF_JPEG, ObjectPicture
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.testing import assert_same_objects, square
from hypermap.testing.strategies import areas, coordinates, points, semantic_layers


def desk() -> SemanticLayer:
    """A cup on a table, a chair that touches it, and a sofa with a hole far away."""
    sofa = shapely.box(10, 0, 14, 4).difference(shapely.box(11, 1, 13, 3))
    return SemanticLayer(
        "semantic",
        "map",
        [
            SemanticObject("table", shapely.box(0, 0, 2, 1), id=7),
            square("cup", 0.5, 0.5, 0.1),
            SemanticObject("chair", shapely.box(2, 0, 2.5, 0.5)),
            SemanticObject("sofa", sofa),
            square("chair", -3, 0.5, id=2),
        ],
    )


@pytest.mark.parametrize(
    ("point", "label", "value"),
    [
        ((1, 0.5), "table", 7),
        ((0.5, 0.5), "cup", 8),  # the smallest of the two that are there
        ((0.55, 0.5), "cup", 8),  # its border belongs to it
        ((2, 0.25), "chair", 9),  # on the border of two: the smaller one
        ((12, 2), "Empty", -1),  # in the sofa's hole
        ((10.5, 2), "sofa", 10),
        ((-3, 0.5), "chair", 2),
        ((50, 50), "Empty", -1),
    ],
)
def test_a_point_belongs_to_the_smallest_object_there(point, label: str, value: int) -> None:
    assert desk().label_at(point).tolist() == [label]
    assert desk().value_at(point).tolist() == [value]


def test_of_objects_of_equal_size_the_one_added_first_answers() -> None:
    layer = SemanticLayer("s", "map", [square("b", 0, 0, id=5), square("a", 0, 0, id=3)])
    assert layer.label_at([0, 0]).tolist() == ["b"]
    assert layer.value_at([0, 0]).tolist() == [5]


@pytest.mark.parametrize(
    ("area", "ids"),
    [
        (shapely.box(1.9, 0.4, 2.1, 0.6), [7, 9]),
        (shapely.box(2.5, 0.5, 3, 1), [9]),  # one point in common
        (shapely.box(11.1, 1.1, 12.9, 2.9), []),  # in the sofa's hole
        (shapely.box(-100, -100, 100, 100), [7, 8, 9, 10, 2]),
        (shapely.MultiPolygon([shapely.box(-3, 0, -2, 1), shapely.box(13, 0, 14, 1)]), [10, 2]),
        (shapely.Polygon(), []),
    ],
)
def test_an_area_holds_the_objects_that_meet_it(area: Any, ids: list[int]) -> None:
    layer = desk()
    values, labels = layer.values_in(area), layer.labels_in(area)
    assert values.values.tolist() == ids
    assert labels.values.tolist() == [layer.get(number).name for number in ids]
    for hits in (values, labels):
        expected = [layer.get(number).footprint.centroid for number in ids]
        np.testing.assert_allclose(hits.points_xy, shapely.get_coordinates(expected))


@pytest.mark.parametrize(
    ("what", "area", "places"),
    [
        ("chair", None, [(2.25, 0.25), (-3, 0.5)]),
        ("chair", shapely.box(0, 0, 5, 5), [(2.25, 0.25)]),
        (7, None, [(1, 0.5)]),
        (7.0, shapely.box(0, 0, 5, 5), [(1, 0.5)]),
        (7, shapely.box(3, 3, 5, 5), []),
        (7.5, None, []),
        (99, None, []),
        ("Chair", None, []),
        ("Empty", None, []),
        ("7", None, []),
    ],
)
def test_objects_are_found_by_name_or_id(what: Any, area: Any, places: list[Any]) -> None:
    found = desk().find(what, area)
    assert found.shape == (len(places), 2)
    np.testing.assert_allclose(found, np.reshape(places, (-1, 2)), atol=1e-12)


@pytest.mark.parametrize(
    ("what", "point", "k", "ids", "distances"),
    [
        ("chair", (3, 0.25), 1, [9], [0.5]),
        ("chair", (3, 0.25), 5, [9, 2], [0.5, 5.5]),
        ("table", (1, 0.2), 1, [7], [0]),  # inside
        ("table", (5, 5), 1, [7], [5]),  # a 3-4-5 triangle from the corner (2, 1)
        ("sofa", (12, 2), 1, [10], [1]),  # in its hole
        (2, (0, 0.5), 3, [2], [2.5]),
        ("lamp", (0, 0), 3, [], []),
    ],
)
def test_the_nearest_objects_are_measured_to_their_shapes(what, point, k, ids, distances) -> None:
    objects, to_shapes = desk().nearest_objects(what, point, k)
    assert [item.id for item in objects] == ids
    np.testing.assert_allclose(to_shapes, distances)
    places, also = desk().nearest(what, point, k)
    np.testing.assert_array_equal(also, to_shapes)
    np.testing.assert_allclose(
        places, shapely.get_coordinates([x.footprint.centroid for x in objects])
    )


def test_of_equally_near_objects_the_one_with_the_nearer_centroid_comes_first() -> None:
    large, small = square("rug", 0, 0, 8), square("rug", 1, 1, 4)
    layer = SemanticLayer("s", "map", [large, small])
    assert [x.id for x in layer.nearest_objects("rug", [1, 1], 2)[0]] == [1, 0]
    assert [x.id for x in layer.nearest_objects("rug", [-0.5, 0], 2)[0]] == [0, 1]


def test_one_object_is_the_nearest_unless_more_are_asked_for() -> None:
    assert [item.id for item in desk().nearest_objects("chair", [3, 0.25])[0]] == [9]
    assert len(desk().nearest("chair", [3, 0.25])[0]) == 1


def test_the_nearest_of_none_is_an_error() -> None:
    with pytest.raises(ValueError, match="k must be at least 1, got 0"):
        desk().nearest_objects("chair", [0, 0], 0)
    with pytest.raises(ValueError, match="expected a single point, got 2"):
        desk().nearest("chair", [[0, 0], [1, 1]])


@given(semantic_layers(), points(min_size=1, max_size=5), st.data())
def test_all_answers_agree_with_looking_at_each_object(layer, xy, data: st.DataObject) -> None:
    area = data.draw(areas())
    objects = layer.objects()
    for point, value, label in zip(xy, layer.value_at(xy), layer.label_at(xy), strict=True):
        there = [item for item in objects if item.footprint.intersects(shapely.Point(point))]
        smallest = min(there, key=lambda item: item.footprint.area, default=None)
        assert value == (-1 if smallest is None else smallest.id)
        assert label == ("Empty" if smallest is None else smallest.name)
    meeting = [item.id for item in objects if item.footprint.intersects(area)]
    assert layer.values_in(area).values.tolist() == meeting
    for name in set(layer.names):
        mine = [item for item in objects if item.name == name]
        places = [item.footprint.centroid for item in mine]
        np.testing.assert_array_equal(layer.find(name), shapely.get_coordinates(places))
        _, distances = layer.nearest_objects(name, xy[0], len(objects))
        expected = sorted(item.footprint.distance(shapely.Point(xy[0])) for item in mine)
        np.testing.assert_allclose(distances, expected)


@given(semantic_layers())
def test_the_extent_covers_every_object(layer: SemanticLayer) -> None:
    assert layer.extent().is_empty == (len(layer) == 0)
    for geometry in layer.geometries:
        assert layer.extent().covers(shapely.box(*geometry.bounds))


# Objects whose outline crosses itself

BOW_TIE = shapely.Polygon([(0, 0), (4, 2), (4, 0), (0, 2)])


def test_an_outline_that_crosses_itself_is_kept_and_answered_by_its_repaired_copy() -> None:
    layer = SemanticLayer("s", "map", [SemanticObject("kite", BOW_TIE)])
    assert layer.label_at([[0.5, 1], [3.5, 1], [2, 0.2]]).tolist() == ["kite", "kite", "Empty"]
    assert layer.find("kite").tolist() == [[2, 1]]
    assert len(layer.labels_in(shapely.box(1.9, 0, 2.1, 0.5))) == 0
    assert layer.nearest("kite", [2, 0])[1] == pytest.approx(2 / math.sqrt(5))
    assert layer.get(0).footprint.equals_exact(BOW_TIE)
    assert layer.picture().shapes[0].equals_exact(BOW_TIE)


def test_an_outline_without_area_is_found_where_it_is() -> None:
    line = shapely.Polygon([(0, 0), (4, 0), (2, 0)])
    layer = SemanticLayer("s", "map", [SemanticObject("wire", line), square("rug", 0, 0, 9)])
    assert layer.label_at([[1, 0], [1, 1]]).tolist() == ["wire", "rug"]
    assert layer.nearest("wire", [2, 3])[1].tolist() == [3]


# Ids and changes


def test_ids_are_given_in_order_and_never_twice() -> None:
    layer = SemanticLayer("s", "map", [square("a", 0, 0), square("b", 0, 0, id=5)])
    assert layer.ids.tolist() == [6, 5]
    assert layer.add([square("c", 0, 0), square("d", 0, 0)]) == [7, 8]
    layer.remove([8, 6])
    assert layer.ids.tolist() == [5, 7]
    assert layer.names.tolist() == ["b", "c"]
    assert layer.add([square("e", 0, 0)]) == [9]
    assert layer.add([square("f", 0, 0, id=6)]) == [6]  # only who asks for it gets it again


@pytest.mark.parametrize(
    ("objects", "message"),
    [
        ([square("x", 0, 0, id=3), square("y", 0, 0, id=3)], "two objects have the id 3"),
        ([square("x", 0, 0, id=3), square("y", 0, 0, id=7)], "two objects have the id 7"),
        ([square("x", 0, 0, id=2**31 - 1), square("y", 0, 0)],
         "an object's id must be between 0 and 2147483647, got 2147483648"),
    ],
)  # fmt: skip
def test_a_change_that_is_refused_changes_nothing(objects: Any, message: str) -> None:
    layer = desk()
    with pytest.raises(ValueError, match=message):
        layer.add(objects)
    assert layer.ids.tolist() == [7, 8, 9, 10, 2]
    with pytest.raises(ObjectNotFound, match="layer 'semantic' has no object with id 99"):
        layer.remove([7, 99])
    with pytest.raises(ObjectNotFound, match="layer 'semantic' has no object with id 99"):
        layer.update(99, square("x", 0, 0))
    with pytest.raises(ValueError, match="an object keeps its id: 7 cannot become 8"):
        layer.update(7, square("x", 0, 0, id=8))
    with pytest.raises(ObjectNotFound, match="layer 'semantic' has no object with id 99"):
        layer.get(99)
    assert_same_objects(layer.objects(), desk().objects())


def test_an_update_keeps_the_id_and_the_place_in_the_order() -> None:
    layer = desk()
    layer.update(9, square("stool", 20, 20))
    assert layer.ids.tolist() == [7, 8, 9, 10, 2]
    assert layer.names.tolist() == ["table", "cup", "stool", "sofa", "chair"]
    assert layer.label_at([[20, 20], [2.25, 0.25]]).tolist() == ["stool", "Empty"]
    assert layer.find("chair").tolist() == [[-3, 0.5]]


def test_many_updates_are_made_at_once_or_not_at_all() -> None:
    one, many = desk(), desk()
    changes = {9: square("stool", 20, 20), 7: square("desk", 30, 0, id=7)}
    for number, item in changes.items():
        one.update(number, item)
    many.update_many(changes)
    assert_same_objects(many.objects(), one.objects())
    assert many.label_at([[20, 20], [30.2, 0.2], [2.25, 0.25]]).tolist() == [
        "stool",
        "desk",
        "Empty",
    ]
    for wrong in ({8: square("x", 0, 0), 99: square("x", 1, 1)}, {8: square("x", 0, 0, id=7)}):
        with pytest.raises((ObjectNotFound, ValueError)):
            many.update_many(wrong)
        assert_same_objects(many.objects(), one.objects())


@pytest.mark.parametrize("number", [0.7, "0", None, 1.0])
def test_what_is_no_id_is_not_rounded_to_one(number: Any) -> None:
    layer = SemanticLayer("s", "map", [square("a", 0, 0), square("b", 5, 0)])
    for wrong in (
        lambda: layer.get(number),
        lambda: layer.evidence_of(number),
        lambda: layer.remove([1, number]),
        lambda: layer.update(number, square("c", 9, 9)),
    ):
        with pytest.raises(TypeError, match="cannot be interpreted as an integer"):
            wrong()
    assert layer.names.tolist() == ["a", "b"]
    layer.remove(np.array([0]))
    assert layer.names.tolist() == ["b"]


def test_removing_nothing_and_everything() -> None:
    layer = desk()
    layer.remove([])
    assert len(layer) == 5
    layer.remove(layer.ids)
    assert len(layer) == 0
    assert layer.extent().is_empty
    assert layer.label_at([0.5, 0.5]).tolist() == ["Empty"]
    assert layer.objects() == []


def test_a_table_taken_before_a_change_stays_as_it_was() -> None:
    layer = desk()
    before = layer.table
    layer.remove([7])
    assert before.ids.tolist() == [7, 8, 9, 10, 2]
    assert layer.table.ids.tolist() == [8, 9, 10, 2]


def test_readers_see_each_change_as_a_whole() -> None:
    pair = [square("left", 0, 0), square("right", 5, 0)]
    layer = SemanticLayer("s", "map", pair)
    stop = threading.Event()

    def write() -> None:
        while not stop.is_set():
            layer.remove(layer.ids)
            layer.add(pair)

    writer = threading.Thread(target=write)
    writer.start()
    try:
        seen = {len(layer.labels_in(shapely.box(-9, -9, 9, 9))) for _ in range(1500)}
    finally:
        stop.set()
        writer.join()
    assert seen <= {0, 2}


class Changes(RuleBasedStateMachine):
    """Any sequence of changes leaves what a plain dictionary would hold."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = SemanticLayer("s", "map")
        self.model: dict[int, tuple[str, float, float]] = {}

    @rule(items=st.lists(st.tuples(st.sampled_from("abc"), coordinates, coordinates), max_size=40))
    def add(self, items: list[tuple[str, float, float]]) -> None:
        ids = self.layer.add([square(*item) for item in items])
        assert not set(ids) & set(self.model)
        self.model.update(zip(ids, items, strict=True))

    @rule(data=st.data())
    def remove(self, data: st.DataObject) -> None:
        ids = data.draw(st.sets(st.sampled_from([*self.model]))) if self.model else set()
        self.layer.remove(ids)
        for number in ids:
            del self.model[number]

    @rule(data=st.data(), name=st.sampled_from("abc"), x=coordinates, y=coordinates)
    def update(self, data: st.DataObject, name: str, x: float, y: float) -> None:
        if self.model:
            number = data.draw(st.sampled_from([*self.model]))
            self.layer.update(number, square(name, x, y))
            self.model[number] = (name, x, y)

    @invariant()
    def the_layer_holds_the_same(self) -> None:
        assert self.layer.ids.tolist() == list(self.model)
        assert self.layer.names.tolist() == [name for name, _, _ in self.model.values()]
        expected = [i for i, (_, x, y) in self.model.items() if abs(x) <= 10 and abs(y) <= 10]
        assert self.layer.values_in(shapely.box(-9.5, -9.5, 9.5, 9.5)).values.tolist() == expected


TestChanges = Changes.TestCase
TestChanges.settings = settings(max_examples=25, stateful_step_count=20)


def test_a_copy_goes_its_own_way_and_gives_out_no_id_again():
    layer = desk()
    layer.remove([layer.ids[-1]])
    other = layer.copy()
    other.remove([7])
    (new,) = other.add([square("cup", 9, 9)])
    assert layer.get(7).name == "table"
    assert new not in desk().ids
    assert (other.name, other.frame_id) == (layer.name, layer.frame_id)


def test_pictures_are_of_the_objects_that_are_there() -> None:
    layer = SemanticLayer("semantic", "map", [square("table", n, 0, id=n) for n in (7, 3, 5)])
    pictures = {n: (ObjectPicture(START_OF_JPEG, n, 0, 1, 1),) for n in (3, 4, 7)}
    layer.kept_pictures = pictures | {5: ()}
    assert list(layer.pictures_by_id().items()) == [(7, pictures[7]), (3, pictures[3])]


def test_a_layer_with_other_objects_keeps_all_else() -> None:
    layer = SemanticLayer("semantic", "map", [square("table", 0, 0, 2, id=7)], {"color": "red"})
    layer.kept_pictures = {7: ()}
    other = layer.with_objects([square("cup", 5, 5, id=3)])
    assert other.label_at([[0, 0], [5, 5]]).tolist() == ["Empty", "cup"]
    assert (other.settings, other.kept_pictures) == ({"color": "red"}, {7: ()})
    assert layer.ids.tolist() == [7]
    with pytest.raises(ValueError, match="two objects have the id 3"):
        layer.with_objects([square("cup", 5, 5, id=3)] * 2)


def test_a_layer_of_columns_answers_and_changes_like_any_other():
    given = desk()
    layer = SemanticLayer.of_table("semantic", "map", given.table)
    assert layer.label_at([[0.45, 0.45]]).tolist() == given.label_at([[0.45, 0.45]]).tolist()
    (new,) = layer.add([square("cup", 9, 9)])
    assert new == max(given.ids) + 1
    assert layer.label_at([[9, 9]]).tolist() == ["cup"]
    assert len(given) == len(layer) - 1


# As a collection


def test_a_layer_says_what_is_in_it() -> None:
    assert repr(desk()) == (
        "<SemanticLayer 'semantic' in frame 'map': 5 objects (2 chair, 1 table, 1 cup, 1 sofa)>"
    )
    many = SemanticLayer("s", "lab", [square(name, 0, 0) for name in "abcdef"])
    assert repr(many).endswith("6 objects (1 a, 1 b, 1 c, 1 d, ...)>")
    one = SemanticLayer("s", "lab", [square("a\x1b[31m\nb", 0, 0)])
    assert repr(one) == r"<SemanticLayer 's' in frame 'lab': 1 object (1 'a\x1b[31m\nb')>"
    assert repr(SemanticLayer("s", "lab")) == "<SemanticLayer 's' in frame 'lab': 0 objects>"


def test_an_object_says_what_it_is_and_where() -> None:
    cup = square("cup", 1, 2, 0.1, id=7, tags=("mug", "bowl"))
    assert repr(cup) == "<SemanticObject 7 'cup' at (1.00, 2.00), 0.01 m^2, tags 'mug', 'bowl'>"
    assert repr(square("cup", 1, 2)) == "<SemanticObject 'cup' at (1.00, 2.00), 1 m^2>"
    line = SemanticObject("line", shapely.Polygon([(0, 0), (1e-200, 0), (0, 0)]))
    assert "'line'" in repr(line)


def test_a_layer_is_a_collection_of_its_objects_by_id() -> None:
    assert all(number in desk() for number in (7, 8, 9, 10, 2))
    layer = desk()
    assert [item.id for item in layer] == [7, 8, 9, 10, 2]
    assert layer[8].name == "cup"
    assert layer[np.int64(8)].name == "cup"
    assert 8 in layer
    assert layer[8] in layer
    for other in (3, -1, 8.0, "cup", None, square("cup", 0.5, 0.5, 0.1)):
        assert other not in layer
    with pytest.raises(ObjectNotFound, match="layer 'semantic' has no object with id 3"):
        layer[3]
    for item in layer:  # what was there when it began
        layer.remove(item.id)
    assert len(layer) == 0


def test_one_object_is_added_and_removed_like_several() -> None:
    layer = desk()
    assert layer.add(square("lamp", 0, 0)) == 11
    assert layer.add([square("lamp", 0, 0)]) == [12]
    layer.remove(11)
    layer.remove(np.int64(12))
    layer.remove([7, 8])
    layer.remove(number for number in (9, 10))
    assert layer.ids.tolist() == [2]
    with pytest.raises(ObjectNotFound):
        layer.remove(7)
    with pytest.raises(TypeError):
        layer.remove("2")
    assert layer.ids.tolist() == [2]


def test_objects_are_renamed_and_stay_what_they_were() -> None:
    layer = desk()
    layer.rename(8, "mug")
    assert (layer[8].name, layer[8].footprint) == ("mug", desk()[8].footprint)
    layer.rename([9, 2], "stool")
    assert layer.names.tolist() == ["table", "mug", "stool", "sofa", "stool"]
    assert layer.ids.tolist() == desk().ids.tolist()
    with pytest.raises(ObjectNotFound):
        layer.rename([7, 3], "desk")
    with pytest.raises(TypeError):
        layer.rename(7, 3)
    assert layer.find("table").shape == (1, 2)


# Copies


@pytest.mark.parametrize("way", ["deepcopy", "pickle"])
def test_a_deep_copy_knows_the_same_and_changes_alone(way: str) -> None:
    layer = desk()
    layer.add(square("box", 5, 5, attributes={"colors": ["red"]}))
    layer.remove([7, 11])
    number = layer.add(square("box", 5, 5, attributes={"colors": ["red"]}))
    layer.label_at([[5, 5]] * 40)  # what questions compute is no part of it
    again = copy.deepcopy(layer) if way == "deepcopy" else pickle.loads(pickle.dumps(layer))
    assert_same_objects(again, layer)
    again[number].attributes["colors"].append("blue")
    assert layer[number].attributes == {"colors": ["red"]}
    assert again.add(square("lamp", 0, 0)) == number + 1  # no id is given out again
    assert number + 1 not in layer
    again.settings["key"] = 1
    assert layer.settings == {}


def test_evidence_that_is_read_when_asked_for_travels_too() -> None:
    layer = SemanticLayer("s", "map", [], evidence=lambda: EvidenceTable.empty())
    for again in (copy.deepcopy(layer), pickle.loads(pickle.dumps(layer))):
        evidence = again.evidence()
        assert evidence is not None
        assert len(evidence) == 0
