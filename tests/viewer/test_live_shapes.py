from __future__ import annotations

import json

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.frames import Pose2D
from hypermap.core.layer import Layer, ShapesPicture
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.testing import square
from hypermap.viewer.live.shapes import LayerShapes

from .live_tools import a_map, saved, serving

poses = st.builds(
    Pose2D, st.floats(-9, 9), st.floats(-9, 9), st.one_of(st.just(0.0), st.floats(-3, 3))
)


def some_shapes(seed: int, count: int) -> SemanticLayer:
    """Return stars and rings of all sizes, with ids out of order."""
    rng = np.random.default_rng(seed)
    things = []
    for number in rng.permutation(count).tolist():
        steps = rng.integers(4, 30)
        angles = (np.arange(steps) + rng.uniform(0, 0.8, steps)) * 2 * np.pi / steps
        radii = rng.uniform(0.2, 1.0, len(angles)) * 10 ** rng.uniform(-2, 0.5)
        corners = radii[:, np.newaxis] * np.column_stack([np.cos(angles), np.sin(angles)])
        shape = shapely.Polygon(corners + rng.uniform(-10, 10, 2))
        if number % 3 == 0:
            shape = shape.difference(shape.centroid.buffer(0.1 * np.sqrt(shape.area)))
        if shape.area > 0 and isinstance(shape, shapely.Polygon | shapely.MultiPolygon):
            things.append(SemanticObject(f"class {number % 4}", shape, id=number))
    return SemanticLayer("things", "lab", things)


def outline_of(feature: dict) -> shapely.MultiPolygon:
    parts = [shapely.Polygon(rings[0], rings[1:]) for rings in feature["polygons"]]
    return shapely.MultiPolygon(parts)


@given(
    seed=st.integers(0, 2**32 - 1),
    pose=poses,
    corner=st.tuples(st.floats(-12, 12), st.floats(-12, 12)),
    size=st.tuples(st.floats(0, 30), st.floats(0, 30)),
)
def test_what_is_shown_is_what_meets_the_view(seed, pose, corner, size):
    layer = some_shapes(seed, 40)
    x, y = pose.apply(corner)[0].tolist()
    bbox = (x, y, x + size[0], y + size[1])
    shown = json.loads(LayerShapes.of(layer).view(bbox, 0.01, pose))
    in_layer = pose.inverse().apply_geometry(shapely.box(*bbox))
    expected = {o.id for o in layer.objects() if o.footprint.intersects(in_layer)}
    assert {feature["id"] for feature in shown["features"]} == expected
    assert shown["total"] == shown["shown"] == len(expected)


@given(seed=st.integers(0, 2**32 - 1), pose=poses, resolution=st.floats(0.001, 1.0))
def test_outlines_stay_true_to_half_a_pixel_and_valid(seed, pose, resolution):
    layer = some_shapes(seed, 30)
    shapes = LayerShapes.of(layer)
    everything = (-100, -100, 100, 100)
    view = json.loads(shapes.view(everything, resolution, pose))
    assert view == json.loads(shapes.view(everything, resolution, pose)), "what is kept is the same"
    assert view["total"] == len(layer)
    for feature in view["features"]:
        exact = pose.apply_geometry(layer.get(feature["id"]).footprint)
        x0, y0, x1, y1 = pose.inverse().apply_geometry(exact).bounds
        side, is_point = max(x1 - x0, y1 - y0), "point" in feature
        assert is_point != ("polygons" in feature)
        assert side <= 2 * resolution if is_point else side >= resolution
        assert shapely.distance(exact, shapely.Point(feature["at"])) <= resolution
        if not is_point:
            off = shapely.hausdorff_distance(outline_of(feature), exact)
            assert off <= resolution  # half a pixel, and the rounding of the coordinates


def test_holes_and_parts_are_kept(tmp_path):
    with serving(saved(tmp_path)) as client:
        values = {"bbox": "-50,-50,50,50", "resolution": 0.01}
        features = client.get("/api/shapes/things", params=values).json()["features"]
    rug = next(feature for feature in features if feature["name"] == "rug")
    hypermap = a_map()
    pose = hypermap.frames.lookup("map", "lab")
    exact = pose.apply_geometry(hypermap["things"].get(rug["id"]).footprint)
    assert outline_of(rug).equals_exact(shapely.MultiPolygon([exact]), 1e-6) or (
        outline_of(rug).symmetric_difference(exact).area < 1e-9
    )
    assert rug["area"] == pytest.approx(12.0)
    # The middle of a ring is a hole; its label stands on the ring.
    assert shapely.distance(exact, shapely.Point(rug["at"])) < 1e-9


def test_of_too_many_the_largest_are_shown():
    things = [square("cup", i % 10, i // 10, 0.1 + 0.001 * i) for i in range(100)]
    shapes = LayerShapes.of(SemanticLayer("things", "map", things))
    view = json.loads(shapes.view((-1, -1, 11, 11), 0.01, Pose2D(), most=10))
    assert (view["total"], view["shown"]) == (100, 10)
    assert [feature["id"] for feature in view["features"]] == list(range(99, 89, -1))


def test_of_too_many_of_one_size_those_that_are_shown_lie_all_over_the_map():
    corners = np.mgrid[0:40, 0:40].reshape(2, -1).T * 2.5 + 0.1
    objects = [SemanticObject("box", shapely.box(x, y, x + 0.4, y + 0.4)) for x, y in corners]
    shapes = LayerShapes.of(SemanticLayer("objects", "map", objects))
    answer = json.loads(shapes.view((-1, -1, 101, 101), 0.1, Pose2D(), most=400))
    shown = np.array([feature["at"] for feature in answer["features"]]) > 50
    for quarter in ([0, 0], [0, 1], [1, 0], [1, 1]):
        assert 80 <= (shown == quarter).all(axis=1).sum() <= 120


def test_classes_can_be_chosen(tmp_path):
    with serving(saved(tmp_path)) as client:
        values = {"bbox": "-50,-50,50,50", "resolution": 0.01, "name": ["cup", "rug"]}
        view = client.get("/api/shapes/things", params=values).json()
    assert {feature["name"] for feature in view["features"]} == {"cup", "rug"}
    assert view["total"] == 2


def test_an_outline_that_crosses_itself_is_shown_as_questions_see_it():
    bow = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    shapes = LayerShapes.of(SemanticLayer("things", "map", [SemanticObject("bow", bow)]))
    (feature,) = json.loads(shapes.view((-1, -1, 3, 3), 0.01, Pose2D()))["features"]
    assert len(feature["polygons"]) == 2
    assert outline_of(feature).area == pytest.approx(2.0)


class Wires(Layer):
    """A plug-in's layer of lines, which has shapes but no objects."""

    class_name = "WireLayer"

    def picture(self) -> ShapesPicture:
        lines = [shapely.LineString([(0, 0), (5, 0)]), shapely.box(0, 0, 1, 1)]
        return ShapesPicture(np.array(["wire", "box"], dtype=object), np.array(lines, dtype=object))

    def label_at(self, points_xy):
        raise NotImplementedError

    value_at = labels_in = values_in = find = extent = label_at


def test_the_shapes_of_another_kind_of_layer_are_counted_as_ids():
    shapes = LayerShapes.of(Wires("wires", "map"))
    view = json.loads(shapes.view((-1, -1, 9, 9), 0.01, Pose2D()))
    assert [(f["id"], f["name"]) for f in view["features"]] == [(1, "box"), (0, "wire")]
    assert view["features"][1]["point"] == pytest.approx([2.5, 0.0])  # a line has no inside


def test_an_empty_layer_shows_nothing():
    shapes = LayerShapes.of(SemanticLayer("s", "map"))
    view = json.loads(shapes.view((0, 0, 1, 1), 0.01, Pose2D()))
    assert view == {"total": 0, "shown": 0, "features": []}


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"bbox": "0,0,1", "resolution": "1"}, "bbox: expected xmin,ymin,xmax,ymax, got '0,0,1'"),
        ({"bbox": "0,0,nan,1", "resolution": "1"}, "bbox: a number within 1e+09 m is expected"),
        ({"bbox": "2,0,1,1", "resolution": "1"}, "bbox: expected xmin,ymin,xmax,ymax"),
        ({"bbox": "0,0,1,1"}, "resolution: a number within 1e+09 m is expected, got None"),
        ({"bbox": "0,0,1,1", "resolution": "0"}, "resolution: must be above 0 m, got 0"),
    ],
)
def test_a_view_that_is_none_is_refused(tmp_path, values, reason):
    with serving(saved(tmp_path)) as client:
        answer = client.get("/api/shapes/things", params=values)
        assert answer.status_code == 400
        assert reason in answer.json()["error"]
        assert client.get("/api/shapes/occupancy", params=values).status_code == 404


def test_every_object_of_a_real_map_is_sent(shared_data):
    with serving(shared_data / "maps" / "lab.hmap") as client:
        values = {"bbox": "-50,-50,50,50", "resolution": 0.001}
        view = client.get("/api/shapes/semantic", params=values).json()
        assert view["total"] == 28
        sink = next(f for f in view["features"] if f["name"] == "sink")
        assert list(outline_of(sink).centroid.coords[0]) == pytest.approx([3.259, 2.378], abs=2e-3)
        values = {"bbox": "2,-2,3,-1", "resolution": 0.001}
        view = client.get("/api/shapes/semantic", params=values).json()
        assert sorted(f["name"] for f in view["features"]) == ["chair", "table", "tvmonitor"]
