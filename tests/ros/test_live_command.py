"""`hypermap live` next to a recording that is played."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice, pairwise
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
from .conftest import wait_for, wait_for_listener
from .semantic_mapper_tools import Camera, mapped, with_whole_pixels

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros")]


def desk(folder: Path, count: int) -> list[RgbdFrame]:
    """Frames of the desk with their detections."""
    known = RecordedDetections.load(folder / "detections.json")
    frames = []
    for frame in islice(open_recording(folder).frames(), count):
        assert frame.color_stamp is not None
        found = replace(frame, detections=known.at(frame.color_stamp))
        frames.append(with_whole_pixels(found))
    return frames


class Player:
    """Plays frames to a node, with the clock of their time, as fast as the node maps them.

    `rosbag play` goes on by itself, and a node on a busy machine then drops frames.
    """

    def __init__(self, rospy: Any, node: str) -> None:
        self.reports: list[Any] = []
        self._areas: list[Any] = []  # one for each frame that is mapped
        self._shown = 0
        self._listeners = [
            rospy.Subscriber(topic, message_class(kind), heard.append)
            for topic, kind, heard in (
                ("/diagnostics", "diagnostic_msgs/DiagnosticArray", self.reports),
                (f"/{node}/observed_area", "geometry_msgs/PolygonStamped", self._areas),
            )
        ]
        self._camera = Camera(rospy, camera.TF, camera.INFO, camera.DEPTH, camera.DARKNET)
        self._camera.wait_for_listeners()
        self._time = message_class("rosgraph_msgs/Clock")
        self._clock = rospy.Publisher("/clock", self._time, queue_size=10)
        wait_for_listener(self._clock, "a listener of the clock")

    @property
    def counts(self) -> dict[str, int]:
        """How many frames met each fate, by the last report."""
        return fates(self.reports[-1]) if self.reports else {}

    def show(self, frames: list[RgbdFrame]) -> None:
        """Show frames one after the other, each when the one before is done, but for the last one.

        Of that, there are the boxes: those of the next frame tell that no others fit better.
        """
        self._camera.show(frames[0], camera.DARKNET)
        for frame, following in pairwise(frames):
            before = len(self._areas)
            self._clock.publish(self._time(camera.new(camera.DEPTH, frame.stamp).header.stamp))
            self._camera.show(frame, camera.TF, camera.INFO, camera.DEPTH)
            self._camera.show(following, camera.DARKNET)
            self._shown += 1
            wait_for(
                lambda before=before: len(self._areas) > before or self.is_reported, "the frame"
            )
        wait_for(lambda: self.is_reported, "a report of all frames")

    @property
    def is_reported(self) -> bool:
        """Whether the node has reported the fates of all frames."""
        return sum(self.counts.values()) >= self._shown

    def close(self) -> None:
        for listener in self._listeners:
            listener.unregister()
        self._camera.close()
        self._clock.unregister()


@pytest.fixture
def sim_time(rospy: Any) -> Iterator[None]:
    """Nodes that start now go by the clock of what is played."""
    rospy.set_param("/use_sim_time", True)
    yield
    rospy.delete_param("/use_sim_time")


def fates(report: Any) -> dict[str, int]:
    """How many frames met each fate, by the diagnostics."""
    values = report.status[0].values
    return {pair.key: int(pair.value) for pair in values if pair.key.startswith("frames: ")}


def test_the_command_maps_what_is_played_and_saves_on_ctrl_c(
    rospy: Any, sim_time: None, start: Callable[..., Any], shared_data: Path, tmp_path: Path
) -> None:
    output = tmp_path / "desk.hmap"
    frames = desk(shared_data / "desk", 31)
    topics = ["--depth-topic", camera.DEPTH, "--detections-topic", camera.DARKNET]
    own = ["--param", "slop=0.05", "--param", "tf_timeout=10.0", "__name:=live_desk"]
    own += ["--save-every", "0.5"]
    live = start("hypermap", "live", "--ros1", *topics, *own, "-o", output)
    live.expect("waiting for")
    player = Player(rospy, "live_desk")
    player.show(frames)
    player.close()
    counts = player.counts
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
    assert counts["frames: busy"] == 0
    assert used > 0.8 * len(frames), counts
    score = evaluate(saved["semantic"].objects(), mapped(frames[:-1])).overall
    assert score.detection[0].recall == 1, counts  # at an IoU of 0.25
    assert "occupancy" in saved


def test_a_killed_mapper_goes_on_with_what_it_has_saved(
    rospy: Any, sim_time: None, start: Callable[..., Any], shared_data: Path, tmp_path: Path
) -> None:
    output = tmp_path / "desk.hmap"
    frames = desk(shared_data / "desk", 16)
    topics = ["--depth-topic", camera.DEPTH, "--detections-topic", camera.DARKNET]
    own = ["--param", "slop=0.05", "--param", "tf_timeout=10.0", "--save-every", "0.2"]
    command = ["hypermap", "live", "--ros1", *topics, *own, "--onto", output, "-o", output]

    def used() -> int:
        return open_map(output).metadata["frames"]["used"] if output.exists() else 0

    first = start(*command, "__name:=killed")
    first.expect("starts empty")
    first.expect("waiting for")
    player = Player(rospy, "killed")
    player.show(frames[:8])  # on a busy machine, the first come before the camera info
    player.close()
    wait_for(lambda: used() > 4, "a map of some frames")
    os.killpg(first.popen.pid, signal.SIGKILL)
    first.popen.wait(240)
    saved = open_map(output)
    before = saved.metadata["frames"]["used"]

    second = start(*command, "__name:=goes_on")
    second.expect(f"continues {output}, which has {len(saved['semantic'])} objects")
    second.expect("waiting for")
    player = Player(rospy, "goes_on")
    player.show(frames)
    player.close()
    wait_for(lambda: used() > before, "more frames than were saved")
    assert second.stop(signal.SIGINT) == 0, second.output
    whole = open_map(output)
    assert [drive["name"] for drive in whole.metadata["drives"]] == ["live", "live"]
    counts = whole.metadata["frames"]
    assert before < counts["used"] <= len(frames), counts  # none counts twice
    assert counts["repeated"] > 0, counts
