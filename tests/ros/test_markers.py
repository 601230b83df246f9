"""Semantic layers as markers, read again as rviz gets them."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from hypermap.colors import class_colors
from hypermap.core.arrays import as_objects
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.ros.messages.marker_array import MarkerStyle, marker_array, tint
from hypermap.ros.server.markers import LayerMarkers
from hypermap.testing import occupancy_from_text, square
from hypermap.testing.strategies import areas, semantic_layers
from hypermap.triangles import label_points, ring_segments, triangles

from .strict_messages import StrictTypes, humble_store, jazzy_store

SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
FILL, OUTLINE, FIRST_LABEL = 0, 1, 2  # ids within a class
DELETE_ALL = 3  # visualization_msgs/Marker
RING = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 3, 3))
BOW_TIE = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])


def shown(layer: SemanticLayer, types: Any, **style: Any) -> dict[str, dict[int, Any]]:
    """What rviz gets of a layer: by class and id."""
    array = types.sent(marker_array(layer, class_colors(layer.names), types, MarkerStyle(**style)))
    return by_class(array)


def by_class(array: Any) -> dict[str, dict[int, Any]]:
    first, *others = array.markers
    assert first.action == DELETE_ALL
    found: dict[str, dict[int, Any]] = defaultdict(dict)
    for marker in others:
        assert marker.action == 0
        assert marker.id not in found[marker.ns]
        found[marker.ns][marker.id] = marker
    return dict(found)


def corners(marker: Any) -> np.ndarray:
    return np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)


def area_of(points_xy: np.ndarray) -> float:
    a, b, c = points_xy.reshape(-1, 3, 2).transpose(1, 0, 2)
    (x1, y1), (x2, y2) = (b - a).T, (c - a).T
    return float(np.abs(x1 * y2 - x2 * y1).sum() / 2)


# Shapes


@given(shape=areas())
@example(shape=RING)
@example(shape=shapely.MultiPolygon([RING, shapely.box(10, 0, 11, 1)]))
@example(shape=shapely.GeometryCollection([shapely.box(0, 0, 1, 1), shapely.Point(5, 5)]))
@example(shape=shapely.affinity.translate(RING, 5e8, 5e8))
def test_triangles_cover_a_shape_and_no_more(shape: Any) -> None:
    found = triangles(as_objects([shape]))
    assert area_of(found.points_xy) == pytest.approx(shape.area, rel=1e-6, abs=1e-9)
    tried = [shapely.Polygon(part) for part in found.points_xy.reshape(-1, 3, 2)]
    assert shapely.union_all(shapely.make_valid(tried)).symmetric_difference(
        shape
    ).area == pytest.approx(0, abs=1e-6 * shape.area + 1e-9)


@given(shapes=st.lists(areas(), max_size=5))
def test_each_corner_belongs_to_its_shape(shapes: list[Any]) -> None:
    for found, size in ((triangles(as_objects(shapes)), 3), (ring_segments(as_objects(shapes)), 2)):
        assert len(found.points_xy) == len(found.owners)
        assert len(found.owners) % size == 0
        for shape, owner in zip(shapes, range(len(shapes)), strict=True):
            own = shapely.points(found.points_xy[found.owners == owner])
            assert len(own)
            assert shapely.distance(own, shape).max() < 1e-6


@given(shape=areas())
def test_outlines_are_as_long_as_all_rings(shape: Any) -> None:
    ends = ring_segments(as_objects([shape])).points_xy.reshape(-1, 2, 2)
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(shape.length)


@given(shape=areas())
@example(shape=RING)
def test_a_name_stands_within_its_shape(shape: Any) -> None:
    centroid = shapely.get_coordinates(shape.centroid)
    (point,) = label_points(as_objects([shape]), centroid)
    assert shape.distance(shapely.Point(point)) < 1e-9
    if shape.contains(shape.centroid):
        assert np.array_equal(point, centroid[0])


def test_nothing_has_no_corners() -> None:
    assert len(triangles(as_objects([])).points_xy) == 0
    assert len(ring_segments(as_objects([])).points_xy) == 0
    assert len(triangles(as_objects([shapely.LineString([(0, 0), (1, 1)])])).points_xy) == 0


# Messages


@SHARED
@given(layer=semantic_layers())
def test_rviz_gets_what_the_layer_holds(types: Any, layer: SemanticLayer) -> None:
    got = shown(layer, types)
    colors = class_colors(layer.names)
    assert set(got) == set(layer.names)
    for name, markers in got.items():
        rows = layer.table.names == name
        fill, outline = markers[FILL], markers[OUTLINE]
        assert area_of(corners(fill)[:, :2]) == pytest.approx(
            layer.table.areas[rows].sum(), rel=1e-6, abs=1e-9
        )
        assert fill.header.frame_id == outline.header.frame_id == layer.frame_id
        color = outline.color
        assert (color.r, color.g, color.b, color.a) == pytest.approx((*colors[name], 1), abs=1e-6)
        assert (fill.color.r, fill.color.g, fill.color.b) == pytest.approx(
            tint(colors[name]), abs=1e-6
        )
        assert len(fill.colors) * 3 == len(fill.points)
        labels = [marker for number, marker in markers.items() if number >= FIRST_LABEL]
        assert [label.text for label in labels] == [name] * rows.sum()
        places = [(label.pose.position.x, label.pose.position.y) for label in labels]
        for place, shape in zip(places, layer.table.shapes[rows], strict=True):
            assert shape.distance(shapely.Point(place)) < 5 * MarkerStyle().label_height


def test_hostile_names_are_short_labels_in_namespaces_of_their_own(types: Any) -> None:
    names = ["n" * 10**6, "n" * 10**6 + "m", "a\x1b[31m\n\u202eb", "\x07"]
    things = [square(name, 3 * i, 0) for i, name in enumerate(names)]
    got = shown(SemanticLayer("s", "map", things), types)
    assert len(got) == 4
    assert all(len(name) < 300 for name in got)
    texts = [markers[FIRST_LABEL].text for markers in got.values() if FIRST_LABEL in markers]
    assert sorted(texts) == ["a [31m b", "n" * 59 + "…", "n" * 59 + "…"]


def test_outlines_follow_what_was_drawn_and_fills_what_it_means(types: Any) -> None:
    got = shown(SemanticLayer("s", "map", [SemanticObject("bow", BOW_TIE)]), types)["bow"]
    assert area_of(corners(got[FILL])[:, :2]) == pytest.approx(2.0)
    assert len(got[OUTLINE].points) == 8  # four sides, which cross


def test_small_objects_lie_on_large_ones(types: Any) -> None:
    things = [square("cup", 0, 0, 0.1), square("table", 0, 0, 2), square("plate", 0, 0, 0.3)]
    got = shown(SemanticLayer("s", "map", things), types, marker_height=1.0)
    order = sorted(got, key=lambda name: corners(got[name][FILL])[0, 2])
    assert order == ["table", "plate", "cup"]
    for markers in got.values():
        assert corners(markers[FILL])[0, 2] < corners(markers[OUTLINE])[0, 2]
    tops = max(corners(markers[OUTLINE])[0, 2] for markers in got.values())
    assert all(m[FIRST_LABEL].pose.position.z > tops >= 1.0 for m in got.values())


def label_boxes(got: Mapping[str, Mapping[int, Any]]) -> list[Any]:
    """Where labels are seen, a little smaller than they are."""
    return [
        shapely.box(x - 0.2 * w * h, y - 0.45 * h, x + 0.2 * w * h, y + 0.45 * h)
        for markers in got.values()
        for number, text in markers.items()
        if number >= FIRST_LABEL
        for x, y in [(text.pose.position.x, text.pose.position.y)]
        for w, h in [(len(text.text), text.scale.z)]
    ]


def test_labels_of_things_that_stand_on_one_another_can_be_read(types: Any) -> None:
    things = [
        square("cup", 0, 0, 0.1),
        square("table", 0, 0, 2),
        square("plate", 0, 0.05, 0.3),
        square("cup", 0.02, 0, 0.1),
        square("shelf", 9, 9),
    ]
    got = shown(SemanticLayer("s", "map", things), types)
    boxes = label_boxes(got)
    assert len(boxes) == len(things)
    assert not any(a.intersects(b) for n, a in enumerate(boxes) for b in boxes[:n])
    for name, place in (("table", things[1]), ("shelf", things[4])):  # which need not give way
        at = got[name][FIRST_LABEL].pose.position
        assert (at.x, at.y) == pytest.approx(place.footprint.centroid.coords[0])


@pytest.mark.parametrize(("asked", "given"), [(1.0, 0.3), (0.25, 0.25)])
def test_grids_and_zones_show_through_the_fills_of_rooms(
    types: Any, asked: float, given: float
) -> None:
    objects = [square("kitchen", 0, 0, 4)]
    for name, opacity in (("rooms", given), ("semantic", asked)):
        fill = shown(SemanticLayer(name, "map", objects), types, fill_opacity=asked)["kitchen"][
            FILL
        ]
        assert fill.color.a == fill.colors[0].a == pytest.approx(opacity)
        outline = shown(SemanticLayer(name, "map", objects), types)["kitchen"][OUTLINE]
        assert outline.color.a == 1


def test_what_is_shown_and_how(types: Any) -> None:
    layer = SemanticLayer("s", "map", [square("cup", 0, 0), square("table", 3, 0, 2)])
    assert set(shown(layer, types, show_fill=False)["cup"]) == {OUTLINE, FIRST_LABEL}
    assert set(shown(layer, types, show_outlines=False)["cup"]) == {FILL, FIRST_LABEL}
    assert set(shown(layer, types, show_labels=False)["cup"]) == {FILL, OUTLINE}
    assert set(shown(layer, types, hidden_classes=["cup"])) == {"table"}
    assert set(shown(layer, types, shown_classes=["cup"])) == {"cup"}
    assert shown(layer, types, shown_classes=["cup"], hidden_classes=["cup"]) == {}
    few = shown(layer, types, max_labels=1)
    assert (FIRST_LABEL in few["table"], FIRST_LABEL in few["cup"]) == (True, False)
    styled = shown(layer, types, label_height=0.5, fill_opacity=0.25, outline_width=0.125)["cup"]
    assert styled[FIRST_LABEL].scale.z == 0.5
    assert styled[FILL].color.a == styled[FILL].colors[0].a == 0.25
    assert styled[OUTLINE].scale.x == 0.125


def test_what_has_no_name_gets_no_text_which_rviz_would_report_as_an_error(types: Any) -> None:
    names = ["", " ", "\t", "cup"]
    layer = SemanticLayer("s", "map", [square(name, 3 * i, 0) for i, name in enumerate(names)])
    got = shown(layer, types)
    assert {name: sorted(markers) for name, markers in got.items()} == {
        **{blank: [FILL, OUTLINE] for blank in names[:3]},
        "cup": [FILL, OUTLINE, FIRST_LABEL],
    }
    assert list(shown(layer, types, max_labels=1)["cup"]) == [FILL, OUTLINE, FIRST_LABEL]


@pytest.mark.parametrize("store", [humble_store, jazzy_store])
def test_rclpy_takes_every_field(store: Any) -> None:
    layer = SemanticLayer("s", "map", [SemanticObject("sofa", RING), square("cup", 9, 9)])
    types: Any = StrictTypes(store())
    types.stamp = lambda nanoseconds: types.message("builtin_interfaces/Time")()
    array = marker_array(layer, class_colors(layer.names), types, MarkerStyle())
    assert [marker.ns for marker in array.markers] == ["", *["cup"] * 3, *["sofa"] * 3]
    assert types.to_cdr(array)


# The part of a node


class Listening:
    """A port that keeps what is published last on each topic, as a latched topic does."""

    def __init__(self, types: Any) -> None:
        self.message, self.stamp, self.sent = types.message, types.stamp, types.sent
        self.topics: dict[str, Any] = {}
        self.count: dict[str, int] = defaultdict(int)
        self.open: set[str] = set()

    def publisher(self, topic: str, type_name: str, *, latched: bool = False) -> Any:
        assert (type_name, latched) == ("visualization_msgs/MarkerArray", True)
        self.open.add(topic)
        return _Publisher(self, topic)

    def classes(self, topic: str) -> set[str]:
        return set(by_class(self.topics[topic]))


class _Publisher:
    def __init__(self, port: Listening, topic: str) -> None:
        self.port, self.topic = port, topic

    def publish(self, message: Any) -> None:
        self.port.topics[self.topic] = self.port.sent(message)
        self.port.count[self.topic] += 1

    def close(self) -> None:
        self.port.open.discard(self.topic)


def building(layers: Mapping[str, Iterable[str]]) -> Hypermap:
    grid = occupancy_from_text("..", name="occupancy")
    return Hypermap(
        [
            grid,
            *(
                SemanticLayer(name, "map", [square(what, 2 * i, 0) for i, what in enumerate(names)])
                for name, names in layers.items()
            ),
        ]
    )


def test_a_topic_per_semantic_layer_and_none_for_grids(types: Any) -> None:
    port = Listening(types)
    LayerMarkers(port).show(building({"things": ["cup"], "2nd floor": ["bed", "cup"]}))
    assert port.open == {"things_markers", "layer_2nd_floor_markers"}
    assert port.classes("layer_2nd_floor_markers") == {"bed", "cup"}


def test_only_changed_layers_are_published_again(types: Any) -> None:
    port, hypermap = Listening(types), building({"a": ["cup"], "b": ["bed"]})
    markers = LayerMarkers(port)
    markers.show(hypermap)
    hypermap["a"].add([square("bed", 9, 9)])  # type: ignore[attr-defined]
    markers.show(hypermap, ["a"])
    assert port.count == {"a_markers": 2, "b_markers": 1}
    assert port.classes("a_markers") == {"cup", "bed"}


def test_a_color_that_another_layer_takes_changes_everywhere(types: Any) -> None:
    wanted = class_colors(["zebra"])["zebra"]
    rival = next(n for n in map("a{}".format, range(9999)) if class_colors([n])[n] == wanted)
    port, hypermap = Listening(types), building({"a": ["zebra"], "b": []})
    markers = LayerMarkers(port)
    markers.show(hypermap)
    hypermap["b"].add([square(rival, 0, 0)])  # type: ignore[attr-defined]
    markers.show(hypermap, ["b"])
    outline = by_class(port.topics["a_markers"])["zebra"][OUTLINE].color
    expected = class_colors(["zebra", rival])["zebra"]
    assert expected != wanted
    assert (outline.r, outline.g, outline.b) == pytest.approx(expected, abs=1e-6)


def test_a_layer_that_is_gone_vanishes_from_the_screen(types: Any) -> None:
    port = Listening(types)
    markers = LayerMarkers(port)
    markers.show(building({"a": ["cup"], "b": ["bed"]}))
    markers.show(building({"a": ["cup"]}))
    assert port.open == {"a_markers"}
    assert port.classes("b_markers") == set()
    markers.close()
    assert port.open == set()
    assert port.classes("a_markers") == set()


def test_parameters_that_change_show_at_once(types: Any) -> None:
    port = Listening(types)
    markers = LayerMarkers(port)
    markers.set({p.name: p.default for p in LayerMarkers.PARAMETERS})
    assert port.topics == {}
    markers.show(building({"a": ["cup", "bed"]}))
    markers.set({"hidden_classes": ["cup"], "label_height": 0.5, "of_another_part": 1})
    got = by_class(port.topics["a_markers"])
    assert set(got) == {"bed"}
    assert got["bed"][FIRST_LABEL].scale.z == 0.5
    before = dict(port.count)
    markers.set({"of_another_part": 2})
    assert port.count == before


def test_defaults_of_parameters_and_of_the_style_are_the_same() -> None:
    defaults = {p.name: p.default for p in LayerMarkers.PARAMETERS}
    assert defaults == vars(MarkerStyle())
    assert all(p.changes for p in LayerMarkers.PARAMETERS)


def test_changes_from_several_threads_leave_the_last_state(types: Any) -> None:
    port, hypermap = Listening(types), building({"a": []})
    markers = LayerMarkers(port)

    def add(name: str) -> None:
        hypermap["a"].add([square(name, 0, 0)])  # type: ignore[attr-defined]
        markers.show(hypermap, ["a"])

    threads = [threading.Thread(target=add, args=(f"class{i}",)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert port.classes("a_markers") == {f"class{i}" for i in range(8)}
