"""A roscore of its own for the tests of a worker, and processes that end with their test."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

NEEDS_ROS1 = "ROS 1 is not here: make ros1 installs it on Debian 12"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(condition: Callable[[], Any], what: str, timeout: float = 30.0) -> Any:
    """Return the first true answer of a condition."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if answer := condition():
            return answer
        time.sleep(0.02)
    pytest.fail(f"waited {timeout:g} s in vain for {what}")


class Process:
    """A program with its output in a file."""

    def __init__(self, command: list[str], log: Path, **options: Any) -> None:
        self.log = log
        with log.open("wb") as output:
            self.popen = subprocess.Popen(
                command,
                stdout=output,
                stderr=subprocess.STDOUT,
                stdin=options.pop("stdin", subprocess.DEVNULL),
                start_new_session=True,
                **options,
            )

    @property
    def output(self) -> str:
        return self.log.read_text(errors="replace")

    def expect(self, text: str, timeout: float = 30.0) -> None:
        """Wait until the output holds a text."""
        wait_for(lambda: text in self.output or self.popen.poll() is not None, repr(text), timeout)
        assert text in self.output, self.output

    def stop(self, number: int = signal.SIGINT, timeout: float = 20.0) -> int:
        """Send a signal to the whole group and return the exit code."""
        if self.popen.poll() is None:
            os.killpg(self.popen.pid, number)
        try:
            return self.popen.wait(timeout)
        except subprocess.TimeoutExpired:
            os.killpg(self.popen.pid, signal.SIGKILL)
            self.popen.wait()
            pytest.fail(f"did not end on signal {number}: {self.output[-2000:]}")


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Start programs that end with the test; `hypermap` is our command."""
    running: list[Process] = []

    def run(*command: str | Path, **options: Any) -> Process:
        words = [str(word) for word in command]
        if words[0] == "hypermap":
            words[:1] = [sys.executable, "-m", "hypermap"]
        running.append(Process(words, tmp_path / f"process{len(running)}.log", **options))
        return running[-1]

    yield run
    for process in reversed(running):
        if process.popen.poll() is None:
            process.stop(signal.SIGTERM)


@pytest.fixture(scope="session")
def roscore(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The URI of a roscore; `ROS_MASTER_URI` names it to this process and those that it starts."""
    if shutil.which("roscore") is None:
        pytest.skip(NEEDS_ROS1)
    folder = tmp_path_factory.mktemp("roscore")
    port = free_port()
    uri = f"http://127.0.0.1:{port}"
    os.environ.update(ROS_MASTER_URI=uri, ROS_HOSTNAME="127.0.0.1", ROS_HOME=str(folder / "home"))
    core = Process(["roscore", "-p", str(port)], folder / "roscore.log")
    try:
        core.expect("started core service")
        yield uri
    finally:
        core.stop()


@pytest.fixture(scope="session")
def rospy(roscore: str) -> Any:
    """The library rospy, with this process as a node; calls of services and topics are real."""
    from hypermap.ros.ros1_libraries import rospy

    rospy.init_node("tests", anonymous=True, disable_signals=True)
    return rospy
