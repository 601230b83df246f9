"""`hypermap live` next to a bag that is played."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from hypermap.core.semantic import SemanticLayer
from hypermap.evaluation.metrics import evaluate
from hypermap.formats import open_map
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.perception.frame import RgbdFrame
from hypermap.recordings import open_recording
from hypermap.ros.ros1.messages import message_class

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import mapped, with_whole_pixels

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros")]


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


def fates(report: Any) -> dict[str, int]:
    """How many frames met each fate, by the diagnostics."""
    values = report.status[0].values
    return {pair.key: int(pair.value) for pair in values if pair.key.startswith("frames: ")}


def test_the_command_maps_a_played_bag_and_saves_on_ctrl_c(
    rospy: Any, sim_time: None, start: Callable[..., Any], shared_data: Path, tmp_path: Path
) -> None:
    rosbag = pytest.importorskip("rosbag")
    bag, output = tmp_path / "desk.bag", tmp_path / "desk.hmap"
    frames = desk_bag(rosbag, shared_data / "desk", bag, 30)
    topics = ["--depth-topic", camera.DEPTH, "--detections-topic", camera.DARKNET]
    own = ["--param", "slop=0.05", "--param", "tf_timeout=1.0", "__name:=live_desk"]
    own += ["--save-every", "0.5"]
    live = start("hypermap", "live", "--ros1", *topics, *own, "-o", output)
    live.expect("waiting for")
    reports: list[Any] = []
    listener = rospy.Subscriber(
        "/diagnostics", message_class("diagnostic_msgs/DiagnosticArray"), reports.append
    )
    # At half its speed, so that a machine with other work does not drop most frames.
    options = ["--clock", "--wait-for-subscribers", "--delay=1", "--rate=0.5"]
    player = start("rosbag", "play", *options, bag)
    player.popen.wait(240)
    ended = len(reports)

    def is_done() -> bool:
        """All frames have met their fate; or no more do, where the middleware lost some."""
        counts = [sum(fates(report).values()) for report in reports[ended:]]
        return len(frames) in counts[-1:] or (len(counts) > 5 and len(set(counts[-5:])) == 1)

    wait_for(is_done, "all frames")
    listener.unregister()
    counts = fates(reports[-1])
    mapped_so_far = counts["frames: mapped"]
    wait_for(
        lambda: output.exists() and open_map(output).metadata["frames"]["used"] == mapped_so_far,
        "the map of all frames, which would be there if the node were killed now",
    )
    assert live.stop(signal.SIGINT) == 0, live.output
    saved = open_map(output)
    assert isinstance(saved["semantic"], SemanticLayer)
    used = saved.metadata["frames"]["used"]
    assert used == counts["frames: mapped"]
    assert used > len(frames) / 2, counts
    score = evaluate(saved["semantic"].objects(), mapped(frames)).overall
    assert score.detection[0].recall == 1, counts  # at an IoU of 0.25
    assert "occupancy" in saved


def test_a_killed_mapper_goes_on_with_what_it_has_saved(
    rospy: Any, sim_time: None, start: Callable[..., Any], shared_data: Path, tmp_path: Path
) -> None:
    rosbag = pytest.importorskip("rosbag")
    bag, output = tmp_path / "desk.bag", tmp_path / "desk.hmap"
    frames = desk_bag(rosbag, shared_data / "desk", bag, 16)
    topics = ["--depth-topic", camera.DEPTH, "--detections-topic", camera.DARKNET]
    own = ["--param", "slop=0.05", "--param", "tf_timeout=1.0", "--save-every", "0.2"]
    command = ["hypermap", "live", "--ros1", *topics, *own, "--onto", output, "-o", output]
    options = ["--clock", "--wait-for-subscribers", "--delay=1", "--rate=0.5"]

    def used() -> int:
        return open_map(output).metadata["frames"]["used"] if output.exists() else 0

    first = start(*command, "__name:=killed")
    first.expect("starts empty")
    first.expect("waiting for")
    player = start("rosbag", "play", *options, bag)
    wait_for(lambda: used() > 4, "a map of some frames")
    os.killpg(first.popen.pid, signal.SIGKILL)
    first.popen.wait(60)
    saved = open_map(output)
    before = saved.metadata["frames"]["used"]
    player.stop(signal.SIGINT)

    second = start(*command, "__name:=goes_on")
    second.expect(f"continues {output}, which has {len(saved['semantic'])} objects")
    second.expect("waiting for")
    start("rosbag", "play", *options, bag).popen.wait(240)
    wait_for(lambda: used() > before, "more frames than were saved")
    assert second.stop(signal.SIGINT) == 0, second.output
    whole = open_map(output)
    assert [drive["name"] for drive in whole.metadata["drives"]] == ["live", "live"]
    counts = whole.metadata["frames"]
    assert before < counts["used"] <= len(frames), counts  # none counts twice
    assert counts["repeated"] > 0, counts
