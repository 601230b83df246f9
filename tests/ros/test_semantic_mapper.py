"""The whole node on a real roscore: the map that it makes, what it publishes and serves."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.evaluation.metrics import evaluate
from hypermap.formats import open_map
from hypermap.perception.detectors.sources import detections_from_file
from hypermap.perception.frame import RgbdFrame
from hypermap.recordings import open_recording
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate
from hypermap.ros.ros1.messages import message_class, service_class
from hypermap.simulation import demo_world
from hypermap.simulation.truth import true_occupancy

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import (
    RAW,
    Given,
    Room,
    assert_same,
    drive,
    mapped,
    room,
    with_numbers,
    with_whole_pixels,
)

__all__ = ["drive", "room"]

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros")]


def test_raw_depth_and_darknet_give_the_map_of_the_recording(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.show_camera_info(drive[0])
    layer = node.map(drive)
    assert node.totals == {Fate.MAPPED: len(drive)}
    assert_same(layer.objects(), mapped([with_whole_pixels(frame) for frame in drive]))


def test_clouds_bring_their_own_camera(room: Callable[..., Room], drive: list[RgbdFrame]) -> None:
    frames = drive[:25]
    node = room(
        camera.DARKNET,
        camera.CLOUD,
        cloud_topic=camera.CLOUD,
        detections_topic=camera.DARKNET,
        tf_timeout=10.0,
    )
    layer = node.map(frames)
    assert_same(layer.objects(), mapped([with_whole_pixels(frame) for frame in frames]))


def test_compressed_depth_and_vision_msgs(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    frames = drive[:25]
    node = room(
        camera.INFO,
        camera.VISION,
        camera.COMPRESSED_DEPTH,
        depth_topic=camera.COMPRESSED_DEPTH,
        camera_info_topic=camera.INFO,
        detections_topic=camera.VISION,
        detections_type="vision_msgs/Detection2DArray",
        tf_timeout=10.0,
    )
    names = sorted({str(n) for f in frames if f.detections is not None for n in f.detections.names})
    node.camera.numbers = {name: number for number, name in enumerate(names)}
    node.show_camera_info(frames[0])
    found = [replace(item, tags=()) for item in node.map(frames).objects()]
    in_millimetres = [
        replace(frame, depth=(np.round(frame.depth * 1000) / 1000).astype(np.float32))
        for frame in frames
    ]
    # The messages have numbers for classes, and mapping knows some classes by name.
    assert_same(found, mapped([with_numbers(frame, names) for frame in in_millimetres]))


def test_poses_are_corrected_by_the_map_of_another_node(
    room: Callable[..., Room], rospy: Any, drive: list[RgbdFrame]
) -> None:
    truth = true_occupancy(demo_world())
    grid = message_class("nav_msgs/OccupancyGrid")()
    grid.header.frame_id = "map"
    grid.info.resolution = truth.grid.resolution
    grid.info.width, grid.info.height = truth.grid.width, truth.grid.height
    origin = grid.info.origin
    origin.position.x, origin.position.y = truth.grid.origin.x, truth.grid.origin.y
    origin.orientation.w = 1.0
    grid.data = truth.cells.ravel().tolist()
    publisher = rospy.Publisher("/floor", type(grid), queue_size=1, latch=True)
    publisher.publish(grid)
    frames = [off_by_centimetres(frame) for frame in drive[:25]]
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, map_topic="/floor")
    node.show_camera_info(frames[0])
    wait_for(lambda: "occupancy" in node.node.hypermap(), "the map")
    layer = node.map(frames)
    publisher.unregister()
    whole_pixels = [with_whole_pixels(frame) for frame in frames]
    assert_same(layer.objects(), mapped(whole_pixels, occupancy=truth))
    exact = mapped(drive[:25])
    as_given = evaluate(mapped(frames), exact).overall
    assert evaluate(layer.objects(), exact).overall.iou > as_given.iou + 0.05


def off_by_centimetres(frame: RgbdFrame) -> RgbdFrame:
    pose = frame.map_T_camera.copy()
    pose[:2, 3] += 0.05, -0.04
    return frame.moved_to(pose)


def test_a_file_of_detections_goes_by_the_stamps_of_color(
    room: Callable[..., Room], shared_data: Path
) -> None:
    """A color image that precedes its depth image may have to wait for the next one."""
    file = shared_data / "desk" / "detections.json"
    frames = list(islice(open_recording(shared_data / "desk").frames(), 0, 60, 2))
    node = room(
        camera.INFO,
        camera.COMPRESSED_COLOR,
        camera.DEPTH,
        depth_topic=camera.DEPTH,
        color_topic=camera.COMPRESSED_COLOR,
        detections_file=str(file),
        tf_timeout=10.0,
    )
    node.show_camera_info(frames[0])
    for number, frame in enumerate(frames):
        node.camera.show(frame)
        wait_for(lambda n=number: sum(node.totals.values()) >= n, f"frame {number}")  # type: ignore[misc]
    done = node.totals.get(Fate.MAPPED, 0) + node.totals.get(Fate.STILL, 0)
    assert done > 0.7 * len(frames), node.totals
    found, expected = node.semantic.objects(), mapped(frames, detections_from_file(file))
    score = evaluate(found, expected).overall
    assert len(expected) >= 3
    assert score.detection[1].f1 > 0.8


def test_what_is_published(room: Callable[..., Room], rospy: Any, drive: list[RgbdFrame]) -> None:
    got: dict[str, list[Any]] = {}
    name = rospy.get_name()
    topics = {
        "/semantic_map": "hypermap_msgs/SemanticMap",
        f"{name}/objects": "hypermap_msgs/ObjectStateArray",
        f"{name}/map": "nav_msgs/OccupancyGrid",
        f"{name}/semantic_markers": "visualization_msgs/MarkerArray",
        f"{name}/detected_shape": "geometry_msgs/PolygonStamped",
        f"{name}/observed_area": "geometry_msgs/PolygonStamped",
        "/diagnostics": "diagnostic_msgs/DiagnosticArray",
    }
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, publish_rate=10.0)
    listeners = [
        rospy.Subscriber(topic, message_class(kind), got.setdefault(topic, []).append)
        for topic, kind in topics.items()
    ]
    outputs = node.node._life.outputs  # type: ignore[union-attr]
    wait_for(lambda: outputs._shapes.listeners and outputs._area.listeners, "listeners")
    node.show_camera_info(drive[0])
    layer = node.map(drive[:20])
    names = sorted(str(n) for n in layer.names)
    assert len(names) > 3

    def last(topic: str) -> Any:
        return got[topic][-1] if got[topic] else None

    def says_all(topic: str) -> bool:
        message = last(topic)
        if message is None:
            return False
        objects = [getattr(item, "object", item) for item in message.objects]
        return sorted(item.name for item in objects) == names

    wait_for(lambda: says_all("/semantic_map"), "all objects")
    wait_for(lambda: says_all(f"{name}/objects"), "all that is known of them")
    assert last("/semantic_map").header.frame_id == "map"
    wait_for(lambda: last(f"{name}/map") and 100 in last(f"{name}/map").data, "obstacles")
    wait_for(lambda: last(f"{name}/semantic_markers"), "markers")
    wait_for(lambda: len(got[f"{name}/detected_shape"]) > 20, "shapes")
    assert node.totals == {Fate.MAPPED: 20}
    areas = got[f"{name}/observed_area"]
    wait_for(lambda: len(areas) == 20, f"an area for each frame, but {len(areas)} at first")
    area = last(f"{name}/observed_area")
    assert area.header.stamp.to_sec() == pytest.approx(drive[19].stamp)
    wait_for(lambda: last("/diagnostics") and "20" in diagnosed(last("/diagnostics")), "a report")
    for listener in listeners:
        listener.unregister()


def diagnosed(message: Any) -> list[str]:
    return [pair.value for pair in message.status[0].values if pair.key == "frames: mapped"]


def test_services_save_and_clear_the_map(
    room: Callable[..., Room], rospy: Any, drive: list[RgbdFrame], tmp_path: Path
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, map_directory=str(tmp_path))
    node.show_camera_info(drive[0])
    layer = node.map(drive[:15])
    name = rospy.get_name()
    save = rospy.ServiceProxy(f"{name}/save_map", service_class("hypermap_msgs/StoreMap"))
    assert save("live.hmap").success
    saved = open_map(tmp_path / "live.hmap")
    assert_same(list(saved["semantic"].objects()), layer.objects())  # type: ignore[attr-defined]
    for wrong in ("../out.hmap", "/tmp/out.hmap", "live.txt", ""):
        with pytest.raises(rospy.ServiceException):
            save(wrong)
    clear = rospy.ServiceProxy(f"{name}/clear", service_class("std_srvs/Trigger"))
    assert clear().message == f"{len(layer)} objects forgotten"
    assert len(node.semantic) == 0


def test_the_map_is_saved_by_itself_while_the_robot_drives(
    room: Callable[..., Room], drive: list[RgbdFrame], tmp_path: Path
) -> None:
    output = tmp_path / "live.hmap"
    output.write_text("an older map")
    asked = {**RAW, "save_to": str(output), "save_every": 0.1}
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **asked)
    assert node.logged(f"the map is saved in {output}, every 0.1 s and at the end")
    node.show_camera_info(drive[0])

    def is_saved() -> bool:
        used = node.node.hypermap().metadata["frames"]["used"]
        with contextlib.suppress(HypermapError):  # the older one still
            return bool(open_map(output).metadata["frames"]["used"] == used)
        return False

    layer = node.map(drive[:5])
    wait_for(is_saved, "the map of five frames")
    assert_same(list(open_map(output)["semantic"].objects()), layer.objects())  # type: ignore[attr-defined]
    backup = tmp_path / "live.hmap.bak"
    assert node.logged(f"{output} was there before; it stays as {backup}")
    node.camera.show(drive[5])
    node.wait_for(MAPPED=6)
    wait_for(is_saved, "the map of six frames")
    assert backup.read_text() == "an older map", "what the node made itself is no backup"
    node.node.deactivate()
    saved = open_map(output)
    assert node.logged(f"all is saved in {output}: {len(saved.semantic())} objects")
    assert saved.history is not None
    (revision,) = saved.history.revisions()
    assert revision.version > 1
    assert revision.is_beginning


def test_a_drive_that_the_map_has_already_is_said_at_the_end(
    room: Callable[..., Room], drive: list[RgbdFrame], tmp_path: Path
) -> None:
    output = tmp_path / "live.hmap"
    asked = {**RAW, "save_to": str(output), "save_every": 0.0}
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **asked)
    node.show_camera_info(drive[0])
    node.map(drive[:3])
    node.node.deactivate()
    again = room(camera.INFO, camera.DARKNET, camera.DEPTH, **asked, onto=str(output))
    again.show_camera_info(drive[0])
    for number, frame in enumerate(drive[:3], start=1):
        again.camera.show(frame)
        again.wait_for(REPEATED=number)
    again.node.deactivate()
    (said,) = again.logged("nothing was mapped, so nothing is saved")
    assert said.endswith("the map that is continued has 3 frames already")


def test_a_bag_that_waits_for_listeners_does_not_tell_its_map_too_early(port: Any) -> None:
    given = Given(port, {**RAW, "map_topic": "/map"})
    heard: list[str] = []

    def subscribe(topic: str, *arguments: Any, **options: Any) -> Any:
        heard.append(topic)
        return port.subscribe(topic, *arguments, **options)

    given.subscribe = subscribe  # type: ignore[attr-defined]
    node = SemanticMapper(given)  # type: ignore[arg-type]
    node.configure()
    node.activate()
    node.deactivate()
    assert heard[0] == "/map"
    assert camera.DEPTH in heard


def test_a_disk_that_was_full_is_tried_again(
    room: Callable[..., Room], drive: list[RgbdFrame], tmp_path: Path
) -> None:
    folder = tmp_path / "disk"
    folder.mkdir()
    output = folder / "live.hmap"
    node = room(
        camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, save_to=str(output), save_every=0.1
    )
    folder.rmdir()
    node.show_camera_info(drive[0])
    node.map(drive[:3])
    wait_for(lambda: node.logged("the map is not saved"), "a word about it")
    folder.mkdir()
    wait_for(output.exists, "the map")


def test_a_map_that_cannot_be_saved_at_the_end_is_saved_elsewhere(
    room: Callable[..., Room],
    drive: list[RgbdFrame],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "disk").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    save_to = str(tmp_path / "disk" / "live.hmap")
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, save_to=save_to, save_every=0.0)
    node.show_camera_info(drive[0])
    node.map(drive[:3])
    (tmp_path / "disk").rmdir()
    with pytest.raises(HypermapError, match="no such folder to save in; this map is in "):
        node.node.deactivate()
    (elsewhere,) = tmp_path.glob("hypermap-*/live.hmap")
    assert len(open_map(elsewhere).semantic())


def test_the_map_is_saved_when_one_asks_though_no_place_was_named(
    room: Callable[..., Room],
    rospy: Any,
    drive: list[RgbdFrame],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.show_camera_info(drive[0])
    node.map(drive[:3])
    save = rospy.ServiceProxy(
        f"{rospy.get_name()}/save_map", service_class("hypermap_msgs/StoreMap")
    )
    (tmp_path / "others.hmap").write_text("of someone else")
    for wrong in ("others.hmap", "../out.hmap", ""):
        with pytest.raises(rospy.ServiceException):
            save(wrong)
    for _ in range(2):  # the node's own file is replaced
        assert save("mine.hmap").success
    assert "semantic" in open_map(tmp_path / "mine.hmap")
    assert (tmp_path / "others.hmap").read_text() == "of someone else"
    node.node.deactivate()
    beside = tmp_path / "maps"
    beside.mkdir()
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, save_to=str(beside / "a.hmap"))
    assert save("b.hmap").success
    assert save("").success
    assert sorted(path.name for path in beside.iterdir()) == ["a.hmap", "b.hmap"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "give either depth_topic"),
        ({"depth_topic": "/depth"}, "there is no source of detections"),
        ({"depth_topic": "/d", "detector": "x.onnx"}, "the detector needs color images"),
        ({**RAW, "path_topic": "/p", "graph_topic": "/g"}, "by path_topic or by graph_topic, not"),
        (
            {"depth_topic": "/d", "detections_topic": "/o", "detections_file": "x.json"},
            "found detections_topic and detections_file",
        ),
        ({"depth_topic": "/d", "detections_file": "nowhere.json"}, "nowhere.json: there is no"),
        ({**RAW, "save_to": "/nowhere/map.hmap"}, "save_to: /nowhere: there is no such folder"),
        ({**RAW, "save_to": "map.yaml"}, "a map is saved as .hmap"),
        ({**RAW, "profile": "thseis"}, "did you mean 'thesis'?"),
        ({**RAW, "config": "nowhere.yaml"}, "nowhere.yaml"),
    ],
)
def test_what_does_not_go_together_is_an_error_that_says_so(
    port: Any, values: dict[str, Any], message: str
) -> None:
    with pytest.raises(HypermapError) as caught:
        SemanticMapper(Given(port, values)).configure()  # type: ignore[arg-type]
    assert message in str(caught.value)
