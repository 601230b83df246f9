"""The whole node on a real roscore, fed by a simulated camera or with a real recording."""

from __future__ import annotations

import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.evaluation.metrics import evaluate
from hypermap.formats import open_map
from hypermap.mapping import map_recording, profile
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.perception.detectors.sources import detections_from_file, detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.recordings import open_recording
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate
from hypermap.ros.parameters import checked
from hypermap.ros.ros1.messages import message_class, service_class
from hypermap.simulation import SimulatedRecording, demo_world

from . import live_camera as camera
from .conftest import ROSPY_SOCKETS, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros"), ROSPY_SOCKETS]

START = 1_600_000_000  # s; ROS takes a stamp of 0 for none
RAW = {"depth_topic": camera.DEPTH, "detections_topic": camera.DARKNET, "tf_timeout": 5.0}


class Given:
    """A port whose node has these parameters."""

    def __init__(self, port: Any, values: dict[str, Any]) -> None:
        self._port, self._values = port, values

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    def parameters(self, parameters: Any, on_change: Any = None) -> dict[str, Any]:
        assert set(self._values) <= {p.name for p in parameters}
        return {p.name: checked(p, self._values.get(p.name, p.default)) for p in parameters}


class Camera:
    """Publishes frames, one kind of message on each topic."""

    def __init__(self, rospy: Any, *topics: str) -> None:
        self.numbers: dict[str, int] = {}
        self._make = {
            camera.TF: camera.tf,
            camera.INFO: camera.camera_info,
            camera.DEPTH: camera.depth,
            camera.COMPRESSED_DEPTH: camera.compressed_depth,
            camera.CLOUD: camera.cloud,
            camera.COLOR: camera.color,
            camera.COMPRESSED_COLOR: camera.compressed_color,
            camera.DARKNET: camera.darknet,
            camera.VISION: lambda frame: camera.vision(frame, self.numbers),
        }
        self._publishers = {
            topic: rospy.Publisher(topic, message_class(camera.TYPES[topic]), queue_size=100)
            for topic in topics
        }

    def wait_for_listeners(self) -> None:
        for topic, publisher in self._publishers.items():
            wait_for(publisher.get_num_connections, f"a listener on {topic}")

    def show(self, frame: RgbdFrame, *topics: str) -> None:
        """Publish what belongs to a frame, on all topics or on these."""
        for topic in topics or self._publishers:
            self._publishers[topic].publish(self._make[topic](frame))

    def close(self) -> None:
        for publisher in self._publishers.values():
            publisher.unregister()


class Room:
    """A node in this process, a camera, and what was logged."""

    def __init__(self, rospy: Any, port: Any, topics: tuple[str, ...], values: Any) -> None:
        self.lines: list[tuple[str, str]] = []
        given = Given(port, values)
        given.log = lambda level, text: self.lines.append((level, text))  # type: ignore[attr-defined]
        self.node = SemanticMapper(given)  # type: ignore[arg-type]
        self.camera = Camera(rospy, camera.TF, *topics)
        self.node.configure()
        self.node.activate()
        self.camera.wait_for_listeners()

    @property
    def totals(self) -> dict[Fate, int]:
        report = self.node.report()
        assert report is not None
        return report.totals

    def wait_for(self, **counts: int) -> None:
        wanted = {Fate[name]: count for name, count in counts.items()}
        wait_for(lambda: wanted.items() <= self.totals.items(), f"{counts}, not {self.totals}")

    def map(self, frames: list[RgbdFrame]) -> SemanticLayer:
        """Show frames one after the other, each when the last is done, and return the objects."""
        for number, frame in enumerate(frames, start=1):
            self.camera.show(frame)
            wait_for(lambda n=number: sum(self.totals.values()) >= n, f"frame {number}")  # type: ignore[misc]
        return self.semantic

    @property
    def semantic(self) -> SemanticLayer:
        layer = self.node.hypermap()["semantic"]
        assert isinstance(layer, SemanticLayer)
        return layer

    def logged(self, text: str) -> list[str]:
        return [line for _, line in self.lines if text in line]


@pytest.fixture
def room(rospy: Any, port: Any) -> Iterator[Callable[..., Room]]:
    opened: list[Room] = []

    def make(*topics: str, **values: Any) -> Room:
        port.forget_transforms()  # of the test before
        opened.append(Room(rospy, port, topics, values))
        return opened[-1]

    yield make
    for each in opened:
        each.node.deactivate()
        each.node.cleanup()
        each.camera.close()


@pytest.fixture(scope="module")
def drive() -> list[RgbdFrame]:
    """A drive through the demo's room, a frame in each second."""
    return at(START, list(SimulatedRecording(demo_world(), rate=1.0).frames()))


def at(start: float, frames: list[RgbdFrame]) -> list[RgbdFrame]:
    """The same frames, beginning at another time [s]."""
    shift = start - frames[0].stamp
    return [
        replace(frame, stamp=frame.stamp + shift, color_stamp=frame.color_stamp + shift)
        for frame in frames
        if frame.color_stamp is not None
    ]


class Frames:
    """Frames as a recording."""

    path, frame_id = Path("frames"), "map"

    def __init__(self, frames: list[RgbdFrame]) -> None:
        self._frames = frames

    def __len__(self) -> int:
        return len(self._frames)

    def frames(self) -> Iterator[RgbdFrame]:
        return iter(self._frames)

    def occupancy(self) -> None:
        return None


def mapped(frames: list[RgbdFrame], source: Any = None) -> list[SemanticObject]:
    """What `map_recording` finds in frames."""
    source = source or detections_from_recording()
    layer = map_recording(Frames(frames), source, profile("default"))["semantic"]  # type: ignore[arg-type]
    assert isinstance(layer, SemanticLayer)
    return layer.objects()


def with_whole_pixels(frame: RgbdFrame) -> RgbdFrame:
    """The frame with boxes as darknet_ros has them."""
    found = frame.detections
    assert found is not None
    boxes = [[round(side) for side in box] for box in found.xyxy.tolist()]
    return replace(frame, detections=Detections.of(boxes, list(found.names), found.scores))


def assert_same(objects: list[SemanticObject], expected: list[SemanticObject]) -> None:
    """All objects are there, at the same place and of the same shape but for rounding."""
    assert Counter(o.name for o in objects) == Counter(o.name for o in expected)
    score = evaluate(objects, expected).overall
    assert len(expected) > 5
    assert score.iou > 0.97
    assert score.detection[1].f1 == 1  # at an IoU of 0.5


def test_raw_depth_and_darknet_give_the_map_of_the_recording(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.camera.show(drive[0], camera.INFO)
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
        tf_timeout=5.0,
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
        tf_timeout=5.0,
    )
    names = sorted({str(n) for f in frames if f.detections is not None for n in f.detections.names})
    node.camera.numbers = {name: number for number, name in enumerate(names)}
    node.camera.show(frames[0], camera.INFO)
    found = [
        replace(item, name=names[int(item.name)], tags=()) for item in node.map(frames).objects()
    ]
    in_millimetres = [
        replace(frame, depth=(np.round(frame.depth * 1000) / 1000).astype(np.float32))
        for frame in frames
    ]
    assert_same(found, mapped(in_millimetres))


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
        tf_timeout=5.0,
    )
    node.camera.show(frames[0], camera.INFO)
    for number, frame in enumerate(frames):
        node.camera.show(frame)
        wait_for(lambda n=number: sum(node.totals.values()) >= n, f"frame {number}")  # type: ignore[misc]
    done = node.totals.get(Fate.MAPPED, 0) + node.totals.get(Fate.STILL, 0)
    assert done > 0.7 * len(frames), node.totals
    found, expected = node.semantic.objects(), mapped(frames, detections_from_file(file))
    score = evaluate(found, expected).overall
    assert len(expected) >= 3
    assert score.detection[1].f1 > 0.8


def test_every_frame_that_is_not_mapped_is_counted_with_its_reason(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    first, second, third, fourth, *_ = drive
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **{**RAW, "tf_timeout": 0.1})
    node.camera.show(first, camera.DEPTH, camera.DARKNET, camera.TF)
    node.wait_for(NO_CAMERA_INFO=1)
    node.camera.show(second, camera.INFO, camera.DEPTH, camera.DARKNET)
    node.wait_for(NO_TF=1)
    assert len(node.logged("no tf")) == 1
    node.camera.show(third, camera.DEPTH)  # and the detector says nothing
    node.camera.show(fourth, camera.TF, camera.DARKNET, camera.DEPTH)
    node.wait_for(NO_DETECTIONS=1, MAPPED=1)
    still = replace(fourth, stamp=fourth.stamp + 0.1, color_stamp=fourth.stamp + 0.1)
    node.camera.show(still)
    node.wait_for(STILL=1)
    blind = replace(drive[6], depth=np.full_like(fourth.depth, np.nan))
    node.camera.show(blind)
    node.wait_for(UNUSABLE=1)
    assert node.logged("its depth image is empty")


def test_a_foreign_frame_is_logged_once_and_counted(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    node = room(
        camera.INFO, camera.DARKNET, camera.DEPTH, **{**RAW, "tf_timeout": 0.0, "map_frame": "moon"}
    )
    node.camera.show(drive[0], camera.INFO)
    for number, frame in enumerate(drive[:5], start=1):
        node.camera.show(frame)
        node.wait_for(NO_TF=number)
    assert len(node.logged("moon")) == 1
    report = node.node.report()
    assert report is not None
    assert report.state.value == "ERROR"
    assert report.message == "nothing is mapped; no tf: 5 of 5 frames"


def test_tf_that_comes_late_is_waited_for(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.camera.show(drive[0], camera.INFO, camera.DARKNET, camera.DEPTH)
    time.sleep(0.3)  # the robot's localisation is late
    assert node.totals == {}
    node.camera.show(drive[0], camera.TF)
    node.wait_for(MAPPED=1)


def test_after_a_jump_back_of_the_clock_the_map_goes_on(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.camera.show(drive[0], camera.INFO)
    later = at(drive[0].stamp + 500, drive)
    node.map(later[:15])
    before = len(node.semantic)
    assert before > 0
    node.camera.show(drive[20], camera.DEPTH)  # what tells of the jump
    wait_for(lambda: node.logged("the clock has jumped back"), "the line about the jump")
    for number, frame in enumerate(drive[21:36], start=16):
        node.camera.show(frame)
        node.wait_for(MAPPED=number)
    assert len(node.logged("jumped back")) == 1
    assert len(node.semantic) > before


def test_a_slow_detector_drops_frames_and_does_not_lag(
    room: Callable[..., Room], drive: list[RgbdFrame], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[float] = []
    shown: list[float] = []

    class Slow:
        def detect(self, color: Any) -> Detections:
            seen.append(float(color[0, 0, 0]))
            time.sleep(0.25)
            return Detections.of([], [])

    monkeypatch.setattr("hypermap.ros.mapper.live_map.load_detector", lambda *_, **__: Slow())
    node = room(
        camera.INFO,
        camera.COLOR,
        camera.DEPTH,
        depth_topic=camera.DEPTH,
        color_topic=camera.COLOR,
        detector="slow.onnx",
        tf_timeout=5.0,
    )
    node.camera.show(drive[0], camera.INFO)
    for number, frame in enumerate(drive[:40]):
        color = np.full_like(frame.color, number)
        node.camera.show(replace(frame, color=color))
        shown.append(number)
        time.sleep(0.05)
    wait_for(lambda: sum(node.totals.values()) == 40, "all frames")
    totals = node.totals
    assert set(totals) == {Fate.MAPPED, Fate.BUSY}
    assert totals[Fate.BUSY] > 20
    assert seen[-1] == 39  # the newest frame is mapped in the end
    assert seen == sorted(seen)
    report = node.node.report()
    assert report is not None
    assert report.latency[1] < 1.5  # s: one frame waits while one is worked on, and no more


def test_max_rate_takes_some_frames_only(room: Callable[..., Room], drive: list[RgbdFrame]) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, max_rate=0.25)
    node.camera.show(drive[0], camera.INFO)
    time.sleep(1.0)  # else the first depth image may overtake it on its way
    node.map(drive[:13])  # a frame in each second
    assert node.totals == {Fate.MAPPED: 4, Fate.RATE: 9}


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
    node.camera.show(drive[0], camera.INFO)
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
    assert len(got[f"{name}/detected_shape"]) > 20
    assert len(got[f"{name}/observed_area"]) == 20
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
    node.camera.show(drive[0], camera.INFO)
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
    assert clear().message == f"{len(layer)} objects are forgotten"
    assert len(node.semantic) == 0


def desk_bag(rosbag: Any, folder: Path, path: Path, count: int) -> list[RgbdFrame]:
    """Write frames of the desk with their detections as a bag, and return them."""
    known = RecordedDetections.load(folder / "detections.json")
    frames = []
    with rosbag.Bag(str(path), "w") as bag:
        for frame in islice(open_recording(folder).frames(), count):
            assert frame.color_stamp is not None
            found = replace(frame, detections=known.at(frame.color_stamp))
            frames.append(with_whole_pixels(found))
            messages = [camera.tf(found), camera.camera_info(found), camera.depth(found)]
            topics = [camera.TF, camera.INFO, camera.DEPTH]
            for topic, message in zip(topics, messages, strict=True):
                bag.write(topic, message, camera.new(camera.DEPTH, frame.stamp).header.stamp)
            boxes = camera.darknet(found)
            late = camera.new(camera.DEPTH, frame.stamp + 0.15).header.stamp  # a network's time
            bag.write(camera.DARKNET, boxes, late)
    return frames


@pytest.fixture
def sim_time(rospy: Any) -> Iterator[None]:
    """Nodes that start now go by the clock of a bag."""
    rospy.set_param("/use_sim_time", True)
    yield
    rospy.delete_param("/use_sim_time")


def test_the_command_maps_a_played_bag_and_saves_on_ctrl_c(
    rospy: Any, sim_time: None, start: Callable[..., Any], shared_data: Path, tmp_path: Path
) -> None:
    rosbag = pytest.importorskip("rosbag")
    bag, output = tmp_path / "desk.bag", tmp_path / "desk.hmap"
    frames = desk_bag(rosbag, shared_data / "desk", bag, 30)
    topics = ["--depth-topic", camera.DEPTH, "--detections-topic", camera.DARKNET]
    own = ["--param", "slop=0.05", "--param", "tf_timeout=1.0", "__name:=live_desk"]
    live = start("hypermap", "live", "--ros1", *topics, *own, "-o", output)
    live.expect("waiting for", timeout=60)
    reports: list[Any] = []
    listener = rospy.Subscriber(
        "/diagnostics", message_class("diagnostic_msgs/DiagnosticArray"), reports.append
    )
    player = start("rosbag", "play", "--clock", "--wait-for-subscribers", "-d", "1", bag)
    player.popen.wait(60)
    last = len(reports)
    wait_for(lambda: len(reports) > last + 1, "a report after the end")
    listener.unregister()
    counts = {pair.key: pair.value for pair in reports[-1].status[0].values}
    assert live.stop(signal.SIGINT) == 0, live.output
    saved = open_map(output)
    assert isinstance(saved["semantic"], SemanticLayer)
    used = saved.metadata["frames"]["used"]
    assert used == int(counts["frames: mapped"])
    assert used > len(frames) / 2, counts
    score = evaluate(saved["semantic"].objects(), mapped(frames)).overall
    assert score.detection[0].recall == 1, counts  # at an IoU of 0.25
    assert "occupancy" in saved


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "give either depth_topic"),
        ({"depth_topic": "/depth"}, "something must say what the camera sees"),
        ({"depth_topic": "/d", "detector": "x.onnx"}, "the detector needs color images"),
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
