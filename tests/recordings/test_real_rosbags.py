"""Bags that ROS 1 itself has recorded, where it is installed: roscore, rospy, `rosbag record`."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.recordings import open_recording
from hypermap.recordings.bag.file import BagFile

from ..roscore import free_port, roscore_command

COUNT = 3
TOPICS = [
    "/tf",
    "/tf_static",
    "/camera/depth/image",
    "/camera/depth/camera_info",
    "/camera/rgb/image_color",
]
RECORDERS: list[tuple[Any, ...]] = [  # file, signal that ends it, options
    ("plain.bag", signal.SIGINT),
    ("bz2.bag", signal.SIGINT, "--bz2"),
    ("lz4.bag", signal.SIGINT, "--lz4"),
    ("parts/desk", signal.SIGINT, "--split", "--size=2"),
    ("killed.bag", signal.SIGKILL),
]
ROS_PYTHON = "/usr/bin/python3"  # ROS lives in the system's Python, not in ours
NEEDS = "rospy, rosbag, numpy, PIL, sensor_msgs.msg, tf2_msgs.msg"

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("rosbags")]


def has_ros() -> bool:
    if not (shutil.which("roscore") and shutil.which("rosbag")):
        return False
    command = [ROS_PYTHON, "-c", f"import {NEEDS}"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@contextmanager
def running(command: list[str], environment: dict[str, str], stop: int) -> Iterator[int]:
    """Run a command in a process group of its own, which gets a signal at the end; yield its id."""
    process = subprocess.Popen(
        command,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield process.pid
    finally:
        os.killpg(process.pid, stop)
        process.wait(timeout=240)
        # `rosbag record` is done before its child, which still compresses and renames the bag.
        wait_for(lambda: states_of([process.pid]) <= {"Z"}, f"the end of {command}")


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory, shared_data: Path) -> Path:
    """A folder of bags recorded at the same time, in several ways."""
    if not has_ros():
        pytest.skip("ROS 1 is not here (on Debian 12, as root: make ros1)")
    folder = tmp_path_factory.mktemp("bags")
    (folder / "parts").mkdir()
    port = free_port()
    environment = os.environ | {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_HOSTNAME": "127.0.0.1",
        "ROS_HOME": str(folder / "home"),
    }
    player = [ROS_PYTHON, str(Path(__file__).parent / "ros_player.py")]
    with ExitStack() as stack:
        stack.enter_context(running(roscore_command(port), environment, signal.SIGINT))
        wait_for_port(port)
        recorders = []
        for name, stop, *options in RECORDERS:
            flag = "-o" if name.startswith("parts") else "-O"
            command = ["rosbag", "record", *options, flag, str(folder / name), *TOPICS]
            recorders.append(stack.enter_context(running(command, environment, stop)))
        player += [str(shared_data / "desk"), str(COUNT), str(len(RECORDERS))]
        with subprocess.Popen(
            player,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        ) as playing:
            assert playing.stdout is not None
            assert playing.stdout.readline() == b"played\n"
            wait_until_idle([playing.pid, *recorders])
        assert playing.returncode == 0
    return folder


def wait_until_idle(groups: list[int]) -> None:
    """Wait until all threads of some process groups are asleep, in five looks in a row."""
    looks: list[bool] = []

    def is_idle() -> bool:
        looks.append(states_of(groups) == {"S"})
        return looks[-5:] == [True] * 5

    wait_for(is_idle, "the player to have sent all, and the recorders to have written it")


def states_of(groups: list[int]) -> set[str]:
    """Return the states of all threads of some process groups: "S" is asleep, "Z" has ended."""
    found = set()
    for file in Path("/proc").glob("[0-9]*/task/*/stat"):
        with suppress(OSError):  # it has ended
            state, _, group = file.read_text().rpartition(")")[2].split()[:3]
            if int(group) in groups:
                found.add(state)
    return found


def wait_for(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + 240
    while not condition():
        assert time.monotonic() < end, f"timed out waiting for {what}"
        time.sleep(0.1)


def wait_for_port(port: int) -> None:
    def is_open() -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0

    wait_for(is_open, "the roscore")


@pytest.mark.parametrize("name", ["plain.bag", "bz2.bag", "lz4.bag", "parts"])
def test_a_recorded_bag_gives_the_frames_of_the_folder_that_was_played(
    bags: Path, shared_data: Path, name: str
) -> None:
    recording = open_recording(bags / name)
    info = recording.info()
    assert (info.format, info.frames, info.missing) == ("ROS 1 bag", COUNT, ())
    folder_frames = open_recording(shared_data / "desk").frames()
    for ours, theirs in zip(recording.frames(), folder_frames, strict=False):
        np.testing.assert_array_equal(ours.depth, theirs.depth)
        np.testing.assert_array_equal(ours.color, theirs.color)
        np.testing.assert_array_equal(ours.camera.K, theirs.camera.K)
        np.testing.assert_allclose(ours.map_T_camera, theirs.map_T_camera, atol=1e-5)
        assert ours.stamp == pytest.approx(theirs.stamp, abs=1e-6)


def test_a_bag_in_parts_has_several(bags: Path) -> None:
    assert len(list((bags / "parts").glob("desk_*.bag"))) > 1


def test_a_bag_whose_recording_was_killed_is_read_as_far_as_rosbag_reads_it(
    bags: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(bags / "killed.bag.active", tmp_path))
    [note] = [note for note in open_recording(path).info().notes if "cut off" in note]
    assert note.startswith("the bag ends early, as when a recording or a copy is cut off: ")
    streams = open_recording(path).info().streams
    messages = {name: list(BagFile(path).messages([name])) for name in TOPICS}
    subprocess.run(["rosbag", "reindex", path], check=True, capture_output=True)
    assert open_recording(path).info().streams == streams != ()
    for name in TOPICS:
        for ours, theirs in zip(messages[name], BagFile(path).messages([name]), strict=True):
            assert str(ours) == str(theirs)
