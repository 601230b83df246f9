"""The strict messages refuse what rclpy refuses, or would send as garbage."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
import pytest

from .strict_messages import StrictTypes, humble_store, jazzy_store


@pytest.fixture(scope="module", params=[humble_store, jazzy_store])
def types(request: pytest.FixtureRequest) -> StrictTypes:
    return StrictTypes(request.param())


REFUSED = [
    ("geometry_msgs/Point", "x", 1),
    ("geometry_msgs/Point", "x", np.float32(1)),
    ("geometry_msgs/Point32", "x", 1e39),
    ("nav_msgs/MapMetaData", "width", 1.0),
    ("nav_msgs/MapMetaData", "width", np.int64(1)),
    ("nav_msgs/MapMetaData", "width", -1),
    ("nav_msgs/OccupancyGrid", "data", np.zeros(2, np.int8)),
    ("nav_msgs/OccupancyGrid", "data", array.array("B", [1])),
    ("nav_msgs/OccupancyGrid", "data", [200]),
    ("std_msgs/Header", "frame_id", b"map"),
    ("std_msgs/Header", "stamp", 1.5),
    ("diagnostic_msgs/DiagnosticStatus", "level", 1),
    ("hypermap_msgs/LayerMetaData", "subscribe_mode", np.True_),
    ("hypermap_msgs/LayerMetaData", "subscribe_mode", 1),
    ("hypermap_msgs/SemanticObject", "tags", "chair"),
    ("hypermap_msgs/SemanticObject", "confidence", [1]),
    ("hypermap_msgs/SemanticMap", "objects", [None]),
    ("sensor_msgs/CameraInfo", "k", [1.0] * 8),
]
ACCEPTED = [
    ("geometry_msgs/Point", "x", np.float64(1)),
    ("geometry_msgs/Point", "x", float("nan")),
    ("nav_msgs/OccupancyGrid", "data", array.array("b", [-1, 100])),
    ("nav_msgs/OccupancyGrid", "data", [-1, 100]),
    ("diagnostic_msgs/DiagnosticStatus", "level", b"\2"),
    ("hypermap_msgs/SemanticObject", "tags", ("a", "b")),
    ("sensor_msgs/Image", "data", b"\0\1"),
    ("sensor_msgs/CameraInfo", "k", np.eye(3).ravel()),
]


@pytest.mark.parametrize(("kind", "field", "value"), REFUSED)
def test_a_wrong_type_is_refused(types: StrictTypes, kind: str, field: str, value: Any) -> None:
    message = types.message(kind)()
    with pytest.raises(AssertionError):
        setattr(message, field, value)


@pytest.mark.parametrize(("kind", "field", "value"), ACCEPTED)
def test_a_right_type_goes_over_the_wire(
    types: StrictTypes, kind: str, field: str, value: Any
) -> None:
    message = types.message(kind)(**{field: value})
    received = types.from_cdr(types.to_cdr(message), message.TYPE_NAME)
    np.testing.assert_array_equal(getattr(received, field), getattr(message, field))
    assert type(getattr(received, field)) in (type(getattr(message, field)), list, float)


def test_what_was_put_into_a_list_is_checked_when_it_is_sent(types: StrictTypes) -> None:
    message = types.message("hypermap_msgs/SemanticMap")()
    message.objects.append(types.message("geometry_msgs/Point")())
    with pytest.raises(AssertionError):
        types.to_cdr(message)


def test_unknown_fields_are_refused(types: StrictTypes) -> None:
    with pytest.raises(AssertionError, match="seq"):
        types.message("std_msgs/Header")(seq=1)
