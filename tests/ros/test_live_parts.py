"""The parts of the semantic mapper that need no ROS."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.trajectory import pose_from_rpy
from hypermap.formats import open_map, save_map
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.ros.mapper.diagnostics import diagnostic_array
from hypermap.ros.mapper.frames import FrameMaker
from hypermap.ros.mapper.inputs import QueuedFrame
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.mailbox import Mailbox
from hypermap.ros.mapper.saving import Saving
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.settings import PARAMETERS, LiveSettings
from hypermap.ros.mapper.statistics import WINDOW, Fate, State, Statistics
from hypermap.ros.mapper.synchronizer import MatchedMessages
from hypermap.ros.mapper.worker import Worker
from hypermap.ros.parameters import checked
from hypermap.ros.server.map_directory import archive_within
from hypermap.ros.throttle import Throttle

from .conftest import wait_for


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def counted(clock: Clock, *fates: Fate) -> Statistics:
    """Statistics of frames that came within the last second."""
    statistics = Statistics(clock)
    clock.now += 1
    for number, fate in enumerate(fates):
        statistics.count(fate, latency=0.01 * number)
    return statistics


@pytest.mark.parametrize(
    ("fates", "state", "message"),
    [
        ([], State.WARN, "no frames; waiting for /depth"),
        ([Fate.MAPPED] * 5, State.OK, "mapping"),
        ([Fate.MAPPED, Fate.STILL, Fate.RATE], State.OK, "mapping"),
        ([Fate.STILL] * 5, State.OK, "mapping"),
        (
            [Fate.MAPPED, Fate.MAPPED, Fate.BUSY],
            State.OK,
            "mapping; dropped, busy: 1 of 3 frames",
        ),
        (
            [Fate.MAPPED, Fate.BUSY, Fate.BUSY, Fate.NO_TF],
            State.WARN,
            "most frames are dropped; busy: 2 of 4 frames",
        ),
        (
            [Fate.NO_TF, Fate.NO_TF, Fate.BUSY],
            State.ERROR,
            "nothing is mapped; no tf: 2 of 3 frames",
        ),
    ],
)
def test_how_serious_it_is(fates: list[Fate], state: State, message: str) -> None:
    report = counted(Clock(), *fates).report("/depth")
    assert (report.state, report.message) == (state, message)


def test_rates_and_latencies_are_those_of_the_last_seconds() -> None:
    clock = Clock()
    statistics = Statistics(clock)
    for number in range(400):
        clock.now += 0.1
        statistics.count(Fate.MAPPED if number % 2 else Fate.STILL, latency=number / 1000)
    report = statistics.report("/depth")
    assert report.totals == {Fate.MAPPED: 200, Fate.STILL: 200}
    assert report.frame_rate == pytest.approx(10, rel=0.02)
    median, late = report.latency
    assert median == pytest.approx(0.35, abs=0.002)
    assert late == pytest.approx(0.395, abs=0.002)
    clock.now += WINDOW + 1
    assert statistics.report("/depth").state is State.WARN


def test_diagnostics_of_ros_1_and_ros_2(types: Any) -> None:
    report = counted(Clock(), Fate.MAPPED, Fate.BUSY, Fate.BUSY).report("/depth")
    message = types.sent(diagnostic_array(report, 7, "/mapper", types, 1_500_000_000))
    [status] = message.status
    assert int(status.level) == 1
    assert status.name == "mapper: mapping"
    values = {pair.key: pair.value for pair in status.values}
    assert (values["objects in the map"], values["frames: busy"]) == ("7", "2")
    assert values["latency, median [ms]"] == "0"


def test_a_line_that_repeats_is_held_back_and_counted() -> None:
    clock, lines = Clock(), []
    throttle = Throttle(lambda level, text: lines.append((level, text)), 10.0, clock)
    for _ in range(25):
        throttle.log("warning", "tf", "no tf")
        clock.now += 1
    throttle.log("warning", "color", "no color")
    assert lines == [
        ("warning", "no tf"),
        ("warning", "no tf (9 more like it before)"),
        ("warning", "no tf (9 more like it before)"),
        ("warning", "no color"),
    ]


def test_a_mailbox_gives_the_newest_to_the_one_who_waits() -> None:
    box, taken = Mailbox[int](), []
    waiter = threading.Thread(target=lambda: taken.append(box.take(timeout=240)))
    waiter.start()
    box.put(1)
    waiter.join()
    assert taken == [1]
    assert box.take(timeout=0.0) is None
    assert [box.put(number) for number in (2, 3)] == [None, 2]
    assert box.take() == 3


@pytest.mark.parametrize(
    ("topics", "kind", "info"),
    [
        ({"depth_topic": "/c/depth/image_raw"}, "sensor_msgs/Image", "/c/depth/camera_info"),
        (
            {"depth_topic": "/c/depth/image_raw/compressedDepth"},
            "sensor_msgs/CompressedImage",
            "/c/depth/camera_info",
        ),
        ({"depth_topic": "/d", "camera_info_topic": "/i"}, "sensor_msgs/Image", "/i"),
        ({"cloud_topic": "/points"}, "sensor_msgs/PointCloud2", ""),
    ],
)
def test_types_and_the_camera_info_follow_from_the_names(
    topics: dict[str, str], kind: str, info: str
) -> None:
    settings = LiveSettings(**topics, detections_topic="/boxes")
    assert (settings.geometry_type, settings.info_topic) == (kind, info)


def test_topics_without_a_slash_are_in_the_namespace_of_the_node() -> None:
    given = {
        "depth_topic": "camera/depth/image_raw",
        "color_topic": "/camera/color/image_raw",
        "detections_topic": "~boxes",
        "values": ["wifi:rssi,unit=dBm"],
    }
    settings = LiveSettings.of(given, {}, "/robot1/semantic_mapper")
    assert settings.depth_topic == "/robot1/camera/depth/image_raw"
    assert settings.info_topic == "/robot1/camera/depth/camera_info"
    assert settings.color_topic == "/camera/color/image_raw"
    assert settings.detections_topic == "/robot1/semantic_mapper/boxes"
    assert settings.values == ["/robot1/wifi:rssi,unit=dBm"]
    assert settings.cloud_topic == ""


def test_every_parameter_is_described_and_fits_itself() -> None:
    for parameter in SemanticMapper.PARAMETERS:
        assert parameter.description.endswith("."), parameter
        checked(parameter, parameter.default)
    assert len({p.name for p in SemanticMapper.PARAMETERS}) == len(SemanticMapper.PARAMETERS)
    assert {p.name for p in PARAMETERS} == set(LiveSettings.__dataclass_fields__) - {"origins"}


@pytest.mark.parametrize(
    "name",
    ["../a.hmap", "/a.hmap", "a.txt", "", "link/a.hmap", "x" * 300 + ".hmap", "caf\ud83d.hmap"],
)
def test_a_client_cannot_name_a_file_elsewhere(tmp_path: Any, name: str) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "link").symlink_to(tmp_path)
    with pytest.raises(HypermapError):
        archive_within(tmp_path / "maps", name)


def test_octets_of_messages_are_read_however_they_are_carried() -> None:
    from array import array

    from hypermap.recordings.messages.header import octets

    for data in (b"\x01\xff", bytearray(b"\x01\xff"), array("B", [1, 255]), np.array([1, 255])):
        np.testing.assert_array_equal(octets(data), np.array([1, 255], np.uint8))


# The worker


def test_a_frame_from_before_a_jump_of_the_clock_does_not_make_those_after_it_old(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    has_taken, may_go_on, take = threading.Event(), threading.Event(), Mailbox.take

    def slow_to_wake_up(box: Mailbox[Any], timeout: float | None = None) -> Any:
        item = take(box, timeout)
        if item is not None and not has_taken.is_set():
            has_taken.set()
            assert may_go_on.wait(120)
        return item

    monkeypatch.setattr(Mailbox, "take", slow_to_wake_up)
    statistics = Statistics()
    anything: Any = MagicMock()
    anything.lacks_camera_info = True  # what is not too old comes as far as this
    settings = LiveSettings(depth_topic="/d", detections_topic="/b")
    worker = Worker(
        anything, settings, anything, anything, anything, statistics, Throttle(lambda *_: None)
    )
    worker.put(QueuedFrame(MatchedMessages(53, {"": anything}, {}), 0.0))
    assert has_taken.wait(120)
    worker.jump()
    may_go_on.set()
    wait_for(lambda: sum(statistics.totals.values()) == 1, "the first frame")
    worker.put(QueuedFrame(MatchedMessages(1, {"": anything}, {}), 0.0))
    wait_for(lambda: sum(statistics.totals.values()) == 2, "the second frame")
    worker.close()
    assert statistics.totals == {Fate.NO_CAMERA_INFO: 2}


def test_a_map_of_another_node_is_a_change_and_outlives_what_was_seen() -> None:
    live = LiveMap(LiveSettings(depth_topic="/depth", detections_topic="/boxes", map_topic="/map"))
    assert "occupancy" not in live.hypermap()
    given = OccupancyLayer("occupancy", "map", GridGeometry(2, 2, 1.0), np.zeros((2, 2), np.int8))
    before = live.revision
    live.give_occupancy(given)
    assert live.revision > before  # else it would not be saved at the end
    live.clear()
    assert live.hypermap()["occupancy"] is given


def test_a_pause_does_not_replace_the_backup_of_the_users_map(tmp_path: Path) -> None:
    file = tmp_path / "office.hmap"
    users = Hypermap()
    users.metadata["note"] = "the user's"
    save_map(users, file)
    settings = LiveSettings(
        depth_topic="/depth", detections_topic="/boxes", save_to=str(file), save_every=0.0
    )
    live = LiveMap(settings)
    versions = []
    for _ in range(2):  # activated, deactivated and activated again
        saving = Saving(MagicMock(), settings, live, Throttle(lambda *_: None))
        saving.store("")
        saving.close()
        versions.append(open_map(file).metadata["map_version"])
    assert open_map(tmp_path / "office.hmap.bak").metadata["note"] == "the user's"
    assert versions == [versions[0], versions[0] + 1]


def test_others_are_answered_while_a_detector_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    is_looking, may_go_on = threading.Event(), threading.Event()

    def look(_frame: RgbdFrame) -> Detections:
        is_looking.set()
        assert may_go_on.wait(120)
        return Detections.of([], [])

    monkeypatch.setattr(
        "hypermap.ros.mapper.live_map.sources.detections_from_recording", lambda: look
    )
    live = LiveMap(LiveSettings(depth_topic="/depth", detections_topic="/boxes"))
    camera = Camera.from_intrinsics(60.0, 60.0, 31.5, 23.5, 64, 48)
    frame = RgbdFrame(0.0, np.full((48, 64), 2.0, np.float32), camera, np.eye(4))
    fates: list[Fate] = []
    adding = threading.Thread(target=lambda: fates.append(live.add(frame)[0]), daemon=True)
    adding.start()
    assert is_looking.wait(120)
    answers: list[int] = []
    asking = threading.Thread(
        target=lambda: answers.extend([len(live), len(live.hypermap().layers)]), daemon=True
    )
    asking.start()
    wait_for(lambda: answers == [0, 2], "the answers")
    may_go_on.set()
    adding.join()
    assert (fates, live.frames) == ([Fate.MAPPED], 1)


@pytest.mark.parametrize(
    ("profile", "score", "expected"),
    [
        ("default", -1.0, 0.3),
        ("default", 0.0, 0.0),
        ("default", 0.7, 0.7),
        ("thesis", -1.0, 0.0),
        ("thesis", 0.2, 0.2),
    ],
)
def test_a_score_of_nought_is_one_too(profile: str, score: float, expected: float) -> None:
    settings = LiveSettings(
        depth_topic="/depth", detections_topic="/boxes", profile=profile, score=score
    )
    assert LiveMap(settings).config.perception.min_score == expected


def message(pixels: np.ndarray, encoding: str) -> Any:
    """An image as any middleware hands it over."""
    data = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    return SimpleNamespace(
        header=SimpleNamespace(frame_id="camera"),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=data.shape[1],
        data=data.tobytes(),
    )


def info(width: int, height: int, focal: float) -> Any:
    K = [focal, 0, (width - 1) / 2, 0, focal, (height - 1) / 2, 0, 0, 1]
    return SimpleNamespace(width=width, height=height, K=K, D=[], P=[])


@pytest.mark.parametrize(
    ("convention", "aside"), [("optical", (0.1, 0, 0)), ("body", (0, -0.1, 0))]
)
def test_depth_is_registered_to_color_and_frames_are_turned_where_that_is_set(
    convention: str, aside: tuple[float, float, float]
) -> None:
    settings = LiveSettings(
        depth_topic="/depth/image", color_topic="/color/image", register=True, rotate=90,
        detector="network.onnx", pose_convention=convention,
    )  # fmt: skip
    assert settings.color_info_topic == "/color/camera_info"
    frames = FrameMaker(settings, pytest.fail)
    frames.camera_info = info(32, 24, 26.0)
    assert frames.lacks_camera_info
    frames.color_info = info(64, 48, 52.0)
    assert not frames.lacks_camera_info
    color = message(np.zeros((48, 64, 3), np.uint8), "rgb8")
    match = MatchedMessages(10**9, {"": None, "color": color}, {})
    depth = message(np.full((24, 32), 2.0, np.float32), "32FC1")
    frame = frames.frame(match, depth, np.eye(4), pose_from_rpy(*aside, 0, 0, 0))
    assert frame.depth.shape == (64, 48)
    assert np.nanmax(frame.depth) == 2.0
    np.testing.assert_allclose(frame.map_T_camera[:3, 3], np.negative(aside), atol=1e-12)


def test_a_simulator_may_name_the_body_of_its_camera() -> None:
    topics = {"depth_topic": "/depth", "detections_topic": "/boxes"}
    frames = FrameMaker(LiveSettings(**topics, pose_convention="body"), pytest.fail)
    frames.camera_info = info(32, 24, 26.0)
    depth = message(np.full((24, 32), 2.0, np.float32), "32FC1")
    frame = frames.frame(MatchedMessages(10**9, {"": None}, {}), depth, np.eye(4))
    np.testing.assert_array_equal(frame.map_T_camera[:3, 2], [1, 0, 0])  # looks along x
    np.testing.assert_array_equal(frame.map_T_camera[:3, 1], [0, 0, -1])


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"register": True}, "give color_topic"),
        ({"rotate": 45}, "rotate must be 0, 90, 180 or 270 degrees, got 45"),
        ({"frontiers": True, "occupancy": False}, "frontiers need an occupancy map"),
        ({"sensor_min_range": 4.0}, "sensor_min_range must be below sensor_range, got 4 and 4"),
    ],
)
def test_settings_that_do_not_go_together_are_reported(values: dict[str, Any], words: str) -> None:
    with pytest.raises(HypermapError, match=words):
        LiveSettings(depth_topic="/depth", detections_topic="/boxes", **values)


class Entities:
    """A port of which one entity cannot be made; keeps those that are open."""

    def __init__(self, values: dict[str, Any], broken: str) -> None:
        self.node_name, self.open, self.broken = "/mapper", [], broken
        self._values = values

    def parameters(self, parameters: Any, _: Any) -> dict[str, Any]:
        return {p.name: checked(p, self._values.get(p.name, p.default)) for p in parameters}

    def origins(self) -> dict[str, str]:
        return {}

    def now(self) -> int:
        return 0

    def lookup(self, *_: object) -> Any:
        raise FrameError("there is no tf")

    def log(self, *_: str) -> None:
        pass

    def _made(self, what: object, *_: object, **__: object) -> Any:
        if what == self.broken:
            raise HypermapError(f"{what} cannot be made")
        self.open.append(what)
        return SimpleNamespace(close=lambda: self.open.remove(what), listeners=0)

    publisher = subscribe = service = timer = _made


@pytest.mark.parametrize("broken", ["save_map", "/map", "/depth_info", "/found", "/depth", "/path"])
def test_an_activation_that_fails_leaves_nothing_behind(tmp_path: Path, broken: str) -> None:
    values = {
        "depth_topic": "/depth",
        "camera_info_topic": "/depth_info",
        "detections_topic": "/found",
        "map_topic": "/map",
        "path_topic": "/path",
        "frontiers": True,
        "save_to": str(tmp_path / "office.hmap"),
    }
    port = Entities(values, broken)
    node = SemanticMapper(port)  # type: ignore[arg-type]
    node.configure()
    before = set(threading.enumerate())
    with pytest.raises(HypermapError, match=f"{broken} cannot be made"):
        node.activate()
    assert port.open == []
    assert set(threading.enumerate()) <= before
    node.deactivate()  # as ROS 2 does then
    port.broken = ""
    node.activate()
    assert "/depth" in port.open
    node.deactivate()
    assert port.open == []
