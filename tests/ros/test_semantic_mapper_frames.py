"""Which frames the node maps, and what becomes of the others."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hypermap.core.trajectory import compose, pose_from_rpy
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper import statistics
from hypermap.ros.mapper.statistics import Fate

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import RAW, Room, at, drive, room

__all__ = ["drive", "room"]

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros")]


def test_every_frame_that_is_not_mapped_is_counted_with_its_reason(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    first, second, third, fourth, *_ = drive
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **{**RAW, "tf_timeout": 0.1})
    node.camera.show(first, camera.DEPTH, camera.DARKNET, camera.TF)
    node.wait_for(NO_CAMERA_INFO=1)
    node.show_camera_info(second)
    node.camera.show(second, camera.DEPTH, camera.DARKNET)
    node.wait_for(NO_TF=1)
    wait_for(lambda: node.logged("no tf"), "the line about it")
    assert len(node.logged("no tf")) == 1
    node.camera.show(third, camera.DEPTH)  # and the detector says nothing
    node.show_tf(fourth)
    node.camera.show(fourth, camera.DARKNET, camera.DEPTH)
    node.wait_for(NO_DETECTIONS=1, MAPPED=1)
    still = replace(fourth, stamp=fourth.stamp + 0.1, color_stamp=fourth.stamp + 0.1)
    node.show_tf(still)
    node.camera.show(still)
    node.wait_for(STILL=1)
    blind = replace(drive[6], depth=np.full_like(fourth.depth, np.nan))
    node.show_tf(blind)
    node.camera.show(blind)
    node.wait_for(UNUSABLE=1)
    wait_for(lambda: node.logged("its depth image is empty"), "the line about it")


def test_a_foreign_frame_is_logged_once_and_counted(
    room: Callable[..., Room], drive: list[RgbdFrame], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(statistics, "WINDOW", 1000.0)  # s; all frames are in it
    node = room(
        camera.INFO, camera.DARKNET, camera.DEPTH, **{**RAW, "tf_timeout": 0.0, "map_frame": "moon"}
    )
    node.show_camera_info(drive[0])
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
    node.show_camera_info(drive[0])
    node.camera.show(drive[0], camera.DARKNET, camera.DEPTH)
    time.sleep(0.3)  # the robot's localization is late
    assert node.totals == {}
    node.camera.show(drive[0], camera.TF)
    node.wait_for(MAPPED=1)


def test_after_a_jump_back_of_the_clock_the_map_goes_on(
    room: Callable[..., Room], drive: list[RgbdFrame]
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.show_camera_info(drive[0])
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
    seen: list[int] = []
    is_done = threading.Semaphore(0)

    class Slow:
        def detect(self, color: Any) -> Detections:
            seen.append(int(color[0, 0, 0]))
            assert is_done.acquire(timeout=240)
            return Detections.of([], [])

    monkeypatch.setattr("hypermap.ros.mapper.live_map.load_detector", lambda *_, **__: Slow())
    node = room(
        camera.INFO,
        camera.COLOR,
        camera.DEPTH,
        depth_topic=camera.DEPTH,
        color_topic=camera.COLOR,
        detector="slow.onnx",
        tf_timeout=10.0,
    )
    node.show_camera_info(drive[0])

    def show(numbers: range) -> None:
        for number in numbers:
            color = np.full_like(drive[number].color, number)
            node.camera.show(replace(drive[number], color=color))
            node.wait_until_matched(drive[number])

    show(range(1))
    wait_for(lambda: seen == [0], "the first frame at the detector")
    for count in range(1, 6):  # one frame waits while one is worked on, and no more: the newest
        show(range(8 * count - 7, 8 * count + 1))
        node.wait_for(BUSY=7 * count)
        is_done.release()
        wait_for(lambda newest=8 * count: seen[-1] == newest, "the newest frame at the detector")  # type: ignore[misc]
    is_done.release()
    node.wait_for(MAPPED=6)
    assert node.totals == {Fate.MAPPED: 6, Fate.BUSY: 35}
    assert seen == [0, 8, 16, 24, 32, 40]


def test_max_rate_takes_some_frames_only(room: Callable[..., Room], drive: list[RgbdFrame]) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, max_rate=0.25)
    node.show_camera_info(drive[0])
    node.map(drive[:13])  # a frame in each second
    assert node.totals == {Fate.MAPPED: 4, Fate.RATE: 9}


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ((0, 0, 0, 0, 0, 0), None),
        ((0, 0, 0, 0.2, 0, 0), "its floor is tilted by 11 degrees"),
        ((0, 0, -0.5, 0, 0, 0), "is at z = -0.50 m instead of z = 0 ('map')"),
    ],
    ids=["level", "tilted", "low"],
)
def test_a_floor_that_is_off_is_reported_once(
    room: Callable[..., Room],
    drive: list[RgbdFrame],
    pose: tuple[float, ...],
    words: str | None,
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.show_camera_info(drive[0])
    wrong = pose_from_rpy(*pose)
    node.map([frame.moved_to(compose(wrong, frame.map_T_camera)) for frame in drive[:12]])
    node.node.deactivate()
    node.node.deactivate()
    assert len(node.logged("the floor must be level")) == (words is not None)
    assert words is None or node.logged(words)
