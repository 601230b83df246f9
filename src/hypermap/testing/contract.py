"""The contract of every kind of layer, as a test suite that plug-ins inherit.

```python
class TestMyLayer(LayerContract):
    class_name = "MyLayer"

    @pytest.fixture
    def layer(self):
        return MyLayer("mine", "map", ...)
```
"""

# ruff: noqa: D102  (the name of a law says what it is)

from __future__ import annotations

import contextlib
import copy
import pickle
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Hits, Layer, RasterPicture, ShapesPicture
from hypermap.formats import open_map, save_map
from hypermap.formats.plugins import LayerPlugin, plugin_for
from hypermap.formats.store import MemoryStore
from hypermap.testing.comparing import assert_same_layer, assert_same_map
from hypermap.viewer.picture import render

ARCHIVE = "test_archive"  # what messages about files must name
FILE = "folder/file"  # what the configuration's key `file` says
NOWHERE = shapely.box(9e5, 9e5, 9e5 + 1, 9e5 + 1)  # an area and a place that no map reaches
NO_LABEL = "no layer knows this label"


class LayerContract:
    """The laws of layers.

    Attributes:
        class_name: the name of the entry point by which the plug-in is installed.
    """

    class_name: ClassVar[str]

    @pytest.fixture
    def layer(self) -> Layer:
        """An example that holds something, and answers differently in different places."""
        raise NotImplementedError

    @pytest.fixture
    def plugin(self) -> LayerPlugin:
        """The plug-in, as the package finds it."""
        plugin = plugin_for(self.class_name)
        assert plugin is not None, f"no entry point {self.class_name!r} is installed"
        return plugin

    @pytest.fixture
    def saved(self, plugin: LayerPlugin, layer: Layer) -> MemoryStore:
        """The example's files."""
        store = MemoryStore(where=ARCHIVE)
        plugin.save(layer, store, FILE)
        return store

    # Questions at points

    @pytest.mark.parametrize("count", [0, 1, 50])
    def test_there_is_one_answer_per_point(self, layer: Layer, count: int) -> None:
        points = _points(layer, count)
        labels, values = layer.label_at(points), layer.value_at(points)
        assert labels.shape == values.shape == (count,)
        assert labels.dtype == object
        assert all(type(label) is str for label in labels), "labels are plain str"
        assert np.issubdtype(values.dtype, np.number)

    def test_a_point_is_answered_alike_alone_and_among_others(self, layer: Layer) -> None:
        points = _points(layer, 50)
        labels, values = layer.label_at(points), layer.value_at(points)
        for point, label, value in zip(points, labels, values, strict=True):
            assert layer.label_at(point).tolist() == [label]
            np.testing.assert_array_equal(layer.value_at(point), [value])

    def test_the_example_answers_differently_in_different_places(self, layer: Layer) -> None:
        assert len(set(layer.label_at(_points(layer, 400)))) > 1

    def test_a_place_far_away_has_an_answer_too(self, layer: Layer) -> None:
        assert len(layer.label_at([[9e5, -9e5]])) == len(layer.value_at([[9e5, -9e5]])) == 1

    @pytest.mark.parametrize("points", [[[1.0, 2.0, 3.0]], [[np.nan, 0.0]], [[0.0, np.inf]]])
    def test_what_is_no_point_is_refused(self, layer: Layer, points: Any) -> None:
        for question in (layer.label_at, layer.value_at):
            with pytest.raises(ValueError, match="points must"):
                question(points)

    @pytest.mark.parametrize("kind", [shapely.Point, shapely.MultiPoint])
    def test_points_may_be_those_of_shapely(self, layer: Layer, kind: Any) -> None:
        places = _points(layer, 20)
        points: Any = shapely.MultiPoint(places)
        points = points if kind is shapely.MultiPoint else list(points.geoms)
        assert layer.label_at(points).tolist() == layer.label_at(places).tolist()

    # Copies

    @pytest.mark.parametrize("way", ["deepcopy", "pickle"])
    def test_a_copy_answers_alike(self, layer: Layer, way: str) -> None:
        layer.label_at(_points(layer, 1))  # what questions have computed does not hinder
        copied = copy.deepcopy(layer) if way == "deepcopy" else pickle.loads(pickle.dumps(layer))
        assert_same_layer(copied, layer)
        _assert_same_at_points(copied, layer)

    def test_it_says_what_it_is(self, layer: Layer) -> None:
        assert repr(layer.name) in repr(layer)
        assert layer.summary() in repr(layer)

    # Questions in areas

    def test_labels_and_values_of_an_area_have_the_same_places(self, layer: Layer) -> None:
        for area in _areas(layer):
            labels, values = layer.labels_in(area), layer.values_in(area)
            np.testing.assert_array_equal(labels.points_xy, values.points_xy)
            assert all(type(label) is str for label in labels.values)
            assert labels.points_xy.shape == (len(labels.values), 2)

    def test_the_extent_holds_every_hit(self, layer: Layer) -> None:
        extent = layer.extent()
        hits = layer.labels_in(extent)
        assert len(hits) > 0
        assert _near(extent, hits.points_xy).all()
        huge = layer.labels_in(shapely.box(-8e5, -8e5, 8e5, 8e5))
        np.testing.assert_array_equal(huge.points_xy, hits.points_xy)

    @pytest.mark.parametrize("area", [shapely.Polygon(), NOWHERE], ids=["empty", "elsewhere"])
    def test_there_is_nothing_where_the_layer_is_not(
        self, layer: Layer, area: BaseGeometry
    ) -> None:
        assert len(layer.labels_in(area)) == len(layer.values_in(area)) == 0

    def test_what_is_no_area_is_refused(self, layer: Layer) -> None:
        with np.errstate(invalid="ignore"):
            outline = shapely.Polygon([(0, 0), (np.nan, 1), (1, 1)])
        for question in (layer.labels_in, layer.values_in):
            with pytest.raises(ValueError, match="finite"):
                question(outline)
            with pytest.raises(TypeError):
                question("POLYGON((0 0, 1 0, 1 1))")  # type: ignore[arg-type]

    # Questions for something

    def test_find_gives_the_hits_that_are_equal(self, layer: Layer) -> None:
        for area in _areas(layer):
            for hits in (layer.labels_in(area), layer.values_in(area)):
                for what in _some_values(hits):
                    expected = hits.points_xy[hits.values == what]
                    np.testing.assert_array_equal(layer.find(what, area), expected)

    def test_find_without_an_area_looks_everywhere(self, layer: Layer) -> None:
        extent = layer.extent()
        for hits in (layer.labels_in(extent), layer.values_in(extent)):
            for what in _some_values(hits):
                np.testing.assert_array_equal(layer.find(what), layer.find(what, extent))

    def test_what_is_not_there_is_not_found(self, layer: Layer) -> None:
        for what in (NO_LABEL, 123456789.5):
            assert layer.find(what).shape == (0, 2)
            assert layer.find(what, NOWHERE).shape == (0, 2)

    def test_the_nearest_ones_come_first_and_are_found_too(self, layer: Layer) -> None:
        start = _points(layer, 1)[0]
        for what in _some_values(layer.labels_in(layer.extent())):
            everywhere = layer.find(what)
            places, distances = layer.nearest(what, start, k=len(everywhere) + 1)
            assert sorted(map(tuple, places)) == sorted(map(tuple, everywhere))
            assert (np.diff(distances) >= 0).all()
            first, distance = layer.nearest(what, start)
            np.testing.assert_array_equal(first, places[:1])
            np.testing.assert_array_equal(distance, distances[:1])
        assert layer.nearest(NO_LABEL, start)[0].shape == (0, 2)
        with pytest.raises(ValueError, match="k must"):
            layer.nearest(NO_LABEL, start, k=0)

    # Files

    def test_a_saved_layer_is_the_same_again(
        self, plugin: LayerPlugin, layer: Layer, saved: MemoryStore
    ) -> None:
        again = plugin.load(saved, FILE, layer.name, layer.frame_id, layer.settings)
        assert isinstance(layer, type(again)), "one that is kept elsewhere may be of a subclass"
        assert again.class_name == self.class_name
        assert_same_layer(again, layer)
        _assert_same_at_points(again, layer)

    def test_the_same_layer_gives_the_same_files(
        self, plugin: LayerPlugin, layer: Layer, saved: MemoryStore
    ) -> None:
        again = plugin.load(saved, FILE, layer.name, layer.frame_id, layer.settings)
        for one in (layer, again):
            store = MemoryStore()
            plugin.save(one, store, FILE)
            assert store.files == saved.files

    def test_the_files_have_names_of_their_own(self, saved: MemoryStore) -> None:
        assert saved.files
        assert list(saved.files) == saved.names_of(FILE), "use FILE, FILE.* and FILE/* alone"

    def test_a_missing_file_is_named(
        self, plugin: LayerPlugin, layer: Layer, saved: MemoryStore
    ) -> None:
        for name in saved.files:
            others = {key: value for key, value in saved.files.items() if key != name}
            with pytest.raises(FormatError, match=ARCHIVE):
                plugin.load(MemoryStore(others, ARCHIVE), FILE, layer.name, "map", {})

    @pytest.mark.parametrize("garbage", [b"\x00\xff\xfe garbage", b"{[", b"!!python/none"])
    def test_a_foreign_file_is_named(
        self, plugin: LayerPlugin, layer: Layer, saved: MemoryStore, garbage: bytes
    ) -> None:
        for name in saved.files:
            broken = MemoryStore({**saved.files, name: garbage}, ARCHIVE)
            with pytest.raises(FormatError, match=ARCHIVE):
                plugin.load(broken, FILE, layer.name, "map", {})

    def test_a_damaged_file_gives_a_layer_or_one_clear_error(
        self, plugin: LayerPlugin, layer: Layer, saved: MemoryStore
    ) -> None:
        for name, content in saved.files.items():
            for damaged in _damaged(content):
                broken = MemoryStore({**saved.files, name: damaged}, ARCHIVE)
                with contextlib.suppress(HypermapError):
                    plugin.load(broken, FILE, layer.name, "map", {})

    # The empty layer

    def test_an_empty_layer_answers(self, plugin: LayerPlugin) -> None:
        empty = plugin.empty("nothing", "map", {"key": "value"})
        assert (empty.class_name, empty.name, empty.frame_id) == (self.class_name, "nothing", "map")
        assert empty.settings == {"key": "value"}
        points = np.zeros((3, 2))
        assert empty.label_at(points).shape == empty.value_at(points).shape == (3,)
        area = shapely.box(-1, -1, 1, 1)
        assert len(empty.labels_in(area)) == len(empty.values_in(area)) == 0
        assert empty.find(NO_LABEL).shape == empty.find(0, area).shape == (0, 2)
        assert empty.nearest(NO_LABEL, [0, 0])[1].shape == (0,)
        assert empty.extent().is_empty

    def test_an_empty_layer_can_be_saved(self, plugin: LayerPlugin, tmp_path: Path) -> None:
        hypermap = Hypermap([plugin.empty("nothing", "map", {})])
        save_map(hypermap, tmp_path / "empty.hmap")
        (again,) = open_map(tmp_path / "empty.hmap").layers
        assert again.class_name == self.class_name
        assert again.extent().is_empty

    # The whole way

    def test_an_archive_keeps_the_layer(self, layer: Layer, tmp_path: Path) -> None:
        save_map(Hypermap([layer]), tmp_path / "first.hmap")
        first = open_map(tmp_path / "first.hmap")
        save_map(first, tmp_path / "second.hmap")
        assert_same_map(open_map(tmp_path / "second.hmap"), first)
        assert (tmp_path / "first.hmap").read_bytes() == (tmp_path / "second.hmap").read_bytes()
        _assert_same_at_points(first[layer.name], layer)

    def test_a_picture_shows_the_layer(self, layer: Layer, tmp_path: Path) -> None:
        picture = layer.picture()
        if isinstance(picture, RasterPicture):
            assert picture.rgba.shape == (*picture.grid.shape, 4)
            assert picture.rgba.dtype == np.uint8
        elif isinstance(picture, ShapesPicture):
            assert picture.names.shape == picture.shapes.shape
        else:
            assert picture is None
            return
        render(Hypermap([layer]), tmp_path / "layer.png", size=300)
        assert (tmp_path / "layer.png").read_bytes().startswith(b"\x89PNG")


def _points(layer: Layer, count: int) -> NDArray[np.float64]:
    """Return points in and around a layer, the same each time."""
    x0, y0, x1, y1 = layer.extent().buffer(0.5).bounds
    return np.random.default_rng(1).uniform((x0, y0), (x1, y1), (count, 2))


def _areas(layer: Layer) -> list[BaseGeometry]:
    """Return areas of many kinds in and around a layer."""
    extent = layer.extent()
    x0, y0, x1, y1 = extent.bounds
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    half = shapely.box(x0, y0, x, y1)
    triangle = shapely.Polygon([(x0, y), (x1 + 1, y0), (x, y1 + 1)])
    ring = shapely.Point(x, y).buffer((x1 - x0) / 2).difference(shapely.Point(x, y).buffer(0.3))
    corners = shapely.MultiPolygon([shapely.box(x0, y0, x, y), shapely.box(x, y, x1, y1)])
    bow_tie = shapely.Polygon([(x0, y0), (x1, y1), (x1, y0), (x0, y1)])
    return [extent, half, triangle, ring, corners, bow_tie]


def _some_values(hits: Hits) -> list[Any]:
    """Return up to five different values that can be looked for."""
    values: list[Any] = [value for value in hits.values.tolist() if value == value]  # no NaN
    return list(dict.fromkeys(values))[:5]


def _near(area: BaseGeometry, points_xy: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(shapely.dwithin(area, shapely.points(points_xy), 1e-6))


def _assert_same_at_points(actual: Layer, expected: Layer) -> None:
    points = _points(expected, 50)
    assert actual.label_at(points).tolist() == expected.label_at(points).tolist()
    np.testing.assert_array_equal(actual.value_at(points), expected.value_at(points))


def _damaged(content: bytes) -> list[bytes]:
    """Return a file cut short at some places, and with some bytes changed."""
    rng = np.random.default_rng(2)
    cut = [content[: len(content) * i // 8] for i in range(8)]
    changed = []
    for position in rng.integers(0, len(content), 24):
        bytes_ = bytearray(content)
        bytes_[position] ^= int(rng.integers(1, 256))
        changed.append(bytes(bytes_))
    return cut + changed
