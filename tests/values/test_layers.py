"""From samples to a layer of a map, and the questions to it in all of the map's frames."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from hypermap.core.errors import HypermapError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.value_layer import ValueLayer
from hypermap.values import (
    Samples,
    nearest_where,
    summaries_of,
    summary_in,
    value_layer_called,
    value_layer_of,
    where,
)

ROOM = OccupancyLayer("walls", "floor", GridGeometry(40, 40, 0.1), np.zeros((40, 40), np.int8))


def few(stamps=None) -> Samples:
    return Samples.of([[1, 1], [1.05, 1.05], [3, 3]], [20, 22, 25], stamps=stamps)


def test_a_layer_knows_what_it_was_made_of():
    layer = value_layer_of(
        "warmth", few([5.0, 9.0, np.nan]), ROOM, quantity="temperature", unit="°C", method="nearest"
    )
    assert (layer.name, layer.frame_id, layer.quantity, layer.unit) == (
        "warmth",
        "floor",
        "temperature",
        "°C",
    )
    assert layer.made_by == {"method": "nearest", "noise": 0.0, "occupancy": "walls"}
    assert layer.samples is not None
    assert layer.samples.values.tolist() == [20, 22, 25]
    np.testing.assert_array_equal(layer.stamp_at([[1.1, 1.1], [3.1, 3.1]]), [9.0, np.nan])
    np.testing.assert_array_equal(layer.value_at([[0.6, 0.6], [3.1, 3.1]]), [20, 25])
    assert layer.decimals == 2
    # Each sample's nearest other one is 2, 2 and 3 off.
    assert layer.deviation_at([3.1, 3.1])[0] == pytest.approx(math.sqrt(17 / 3))


def test_nothing_is_said_far_from_samples_or_off_the_floor():
    layer = value_layer_of("warmth", few(), ROOM, method="nearest")
    assert np.isnan(layer.value_at([[3.5, 0.5], [-0.5, 1.0]])).all()
    assert layer.stamps is None


def test_samples_off_the_map_are_left_out_and_all_of_them_are_an_error():
    some = few().joined(Samples.of([[50, 50]], [99]))
    layer = value_layer_of("warmth", some, ROOM, method="nearest")
    assert layer.samples is not None
    assert len(layer.samples) == 3
    with pytest.raises(HypermapError, match=r"no sample of 1 is on the map, which reaches from"):
        value_layer_of("warmth", Samples.of([[50, 50]], [99]), ROOM, method="nearest")


def test_one_sample_makes_a_layer_by_the_nearest_without_a_deviation():
    layer = value_layer_of("warmth", Samples.of([[1, 1]], [20]), ROOM, method="nearest")
    assert layer.value_at([1.1, 1.1])[0] == 20
    assert np.isnan(layer.deviation_at([1.1, 1.1])[0])


def test_the_same_samples_and_settings_make_the_same_layer_again():
    random = np.random.default_rng(3)
    points = random.uniform(0.2, 3.8, (40, 2))
    layer = value_layer_of("x", Samples.of(points, points[:, 0] + random.normal(0, 0.1, 40)), ROOM)
    assert layer.samples is not None
    again = value_layer_of("x", layer.samples, ROOM)
    np.testing.assert_array_equal(again.cells, layer.cells)
    assert again.made_by == layer.made_by


@pytest.fixture
def turned() -> Hypermap:
    """Values in a lab whose x axis is the map's y axis; they are 0, 1, 2, 3 along it."""
    values = ValueLayer("noise", "lab", GridGeometry(4, 1, 1.0), [[0, 1, 2, 3]], "dB")
    things = SemanticLayer(
        "things",
        "map",
        [
            SemanticObject("pump", shapely.box(-0.9, 2.4, -0.8, 2.6)),
            SemanticObject("pump", shapely.box(20, 20, 21, 21)),
        ],
    )
    rooms = SemanticLayer("rooms", "map", [SemanticObject("hall", shapely.box(-1, 0, 0, 2))])
    frames = FrameTree([Transform("map", "lab", Pose2D(yaw=math.pi / 2))])
    return Hypermap([things, rooms, values], frames)


def test_places_and_areas_are_in_the_frame_of_the_question(turned):
    (place,) = where(turned, above=1.5)
    np.testing.assert_allclose(place.bounds, (-1, 2, 0, 4), atol=1e-9)
    (place,) = where(turned, above=1.5, area=shapely.box(-1, 0, 0, 3))
    np.testing.assert_allclose(place.bounds, (-1, 2, 0, 3), atol=1e-9)
    assert summary_in(turned, "noise", shapely.box(-1, 0, 0, 2), below=0.5).share == 0.5
    assert summary_in(turned, None, shapely.box(0, 0, 2, 1), frame_id="lab").mean == 0.5
    (found,) = nearest_where(turned, "noise", (-0.5, 0.2), above=1.5)
    np.testing.assert_allclose(found.point_xy, (-0.5, 2.5), atol=1e-9)
    assert found.distance == pytest.approx(2.3)


def test_an_object_has_the_values_around_it_and_a_room_those_in_it(turned):
    near, far = summaries_of(turned, "noise", turned.objects("pump"))
    assert (near.least, near.most, far.count) == (2, 2, 0)
    (hall,) = summaries_of(turned, "noise", turned.objects(layer="rooms"))
    assert (hall.mean, hall.count) == (0.5, 2)


def test_one_layer_of_values_needs_no_name_and_several_do(turned):
    assert value_layer_called(turned).name == "noise"
    with pytest.raises(HypermapError, match="'things' is of class SemanticLayer, which holds no"):
        value_layer_called(turned, "things")
    turned.add(ValueLayer("light", "map"))
    with pytest.raises(HypermapError, match="several layers of measured values: noise, light"):
        value_layer_called(turned)
    with pytest.raises(HypermapError, match="`hypermap values` makes one"):
        value_layer_called(Hypermap())
