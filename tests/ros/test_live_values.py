"""What other sensors measure becomes layers of a live map."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.trajectory import pose_from_rpy
from hypermap.core.value_layer import ValueLayer
from hypermap.formats import open_map
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.measured_layers import MeasuredLayers
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.ros1.messages import message_class

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import RAW, Room, drive, room
from .test_live_corrections import ros_path

__all__ = ["drive", "room"]

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros")]


def reading(frame: RgbdFrame) -> Any:
    """What a thermometer at the camera says: warmer toward +x."""
    message = message_class("sensor_msgs/Temperature")()
    message.header = camera.new(camera.DEPTH, frame.stamp).header
    message.temperature = 18.0 + frame.map_T_camera[0, 3]
    return message


def layer_of(hypermap: Any, name: str = "temperature") -> ValueLayer:
    layer = hypermap[name]
    assert isinstance(layer, ValueLayer)
    assert layer.samples is not None
    return layer


def test_samples_become_a_layer_that_moves_with_a_loop_closure(
    room: Callable[..., Room], rospy: Any, port: Any, drive: list[RgbdFrame], tmp_path: Path
) -> None:
    frames, saved = drive[:8], tmp_path / "warm.hmap"
    off = pose_from_rpy(0.4, -0.3, 0, 0, 0, 0.05)
    drifted = [frame.moved_to(off @ frame.map_T_camera) for frame in frames]
    publish = {
        topic: rospy.Publisher(topic, message_class(kind), queue_size=100, latch=topic != "/warm")
        for topic, kind in (
            ("/warm", "sensor_msgs/Temperature"),
            ("/odd", "std_msgs/String"),
            ("/slam/path", "nav_msgs/Path"),
        )
    }
    node = room(
        *(camera.INFO, camera.DARKNET, camera.DEPTH),
        **RAW,
        values=["/warm,unit=degF", "/odd:data", "/never", "/warm"],
        save_to=str(saved),
        path_topic="/slam/path",
        base_frame=camera.FRAME,
    )
    node.show_camera_info(frames[0])
    wait_for(publish["/warm"].get_num_connections, "a listener for the samples")
    node.map(drifted)
    for frame in drifted:
        publish["/warm"].publish(reading(frame))
        publish["/warm"].publish(reading(frame))  # too soon after the one before
    wait_for(lambda: len(node.live_map.values.layers[0]) == len(frames), "all samples")
    assert node.logged("there is a layer 'temperature' already")
    publish["/odd"].publish("warm")
    wait_for(lambda: node.logged("/odd: --field 'data': is not a number"), "what is wrong there")

    grids: list[Any] = []
    topic = f"{port.node_name}/temperature_grid_map"
    listener = rospy.Subscriber(topic, message_class("grid_map_msgs/GridMap"), grids.append)
    wait_for(
        lambda: grids and grids[-1].layers == ["value", "deviation"], "the layer as a grid map"
    )
    listener.unregister()
    places = np.array([frame.map_T_camera[:2, 3] for frame in drifted])
    layer = layer_of(node.node.hypermap())
    np.testing.assert_allclose(layer.samples.points_xy, places, atol=1e-6)
    np.testing.assert_allclose(layer.samples.values, 32 + 1.8 * (18 + places[:, 0]), atol=1e-6)
    assert (layer.unit, layer.made_by["method"]) == ("°F", "gmrf")

    stamps, poses = node.live_map.logged_poses()
    publish["/slam/path"].publish(ros_path(stamps, np.linalg.inv(off) @ poses))
    wait_for(lambda: any("corrected the poses of" in text for _, text in node.lines), "a new map")
    node.node.deactivate()
    after = layer_of(open_map(saved))
    expected = np.array([frame.map_T_camera[:2, 3] for frame in frames])
    np.testing.assert_allclose(after.samples.points_xy, expected, atol=0.02)
    assert np.isfinite(after.cells).any()
    for publisher in publish.values():
        publisher.unregister()


def test_a_wrong_text_is_refused_at_the_start() -> None:
    given = {"depth_topic": "/depth", "detections_topic": "/found", "values": ["/warm,unit"]}
    with pytest.raises(HypermapError, match="unit needs a text"):
        LiveSettings.of(given, {}, "/semantic_mapper")


def test_a_layer_goes_on_after_a_pause_of_the_node() -> None:
    values = MeasuredLayers("map", None)
    layer = values.begin("temperature", "temperature", "°C")
    with pytest.raises(HypermapError, match="there is a layer 'temperature' already"):
        values.begin("temperature", "temperature", "°C")
    values.end("temperature")
    assert values.begin("temperature", "temperature", "°C") is layer
    assert values.layers == [layer]
