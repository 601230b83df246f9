"""The real ROS 2, where there is one: its environment, its tools, and a node that asks."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from .conftest import ROS, Process

NEEDS_ROS2 = "no ROS 2 with hypermap_msgs for this Python: see HYPERMAP_ROS2 in docs/ros2.md"
_CHECK = "import rclpy, tf2_ros, nav_msgs.msg, hypermap_msgs.msg"


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a terminal in which ROS 2 and our package `hypermap` are sourced.

    Sources the setup.bash that `HYPERMAP_ROS2` names, or the newest of those in /opt/ros: the
    tests themselves run without the user's environment. Only this machine is asked, in a domain of
    its own.
    """
    for candidate in sourced():
        done = subprocess.run(
            [sys.executable, "-c", _CHECK], env=candidate, capture_output=True, check=False
        )
        if done.returncode == 0 and shutil.which("ros2", path=candidate["PATH"]):
            break
    else:
        pytest.skip(NEEDS_ROS2)
    prefix = tmp_path_factory.mktemp("ros2")
    _install_launch_files(candidate, prefix)
    candidate["AMENT_PREFIX_PATH"] = f"{prefix}{os.pathsep}{candidate['AMENT_PREFIX_PATH']}"
    candidate["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{candidate['PATH']}"
    candidate["ROS_LOG_DIR"] = str(prefix / "log")
    candidate["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
    candidate["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    candidate["ROS_PYTHON_CHECK_FIELDS"] = "1"  # wrong types are errors
    return candidate


def sourced() -> Iterator[dict[str, str]]:
    """Yield the environment of each ROS 2 that is there, once its setup.bash is sourced."""
    named = os.environ.get("HYPERMAP_ROS2")
    setups = [Path(named)] if named else sorted(Path("/opt/ros").glob("*/setup.bash"), reverse=True)
    for setup in setups:
        script = 'source "$1" >/dev/null 2>&1; env -0'
        plain = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
        done = subprocess.run(
            ["bash", "-c", script, "bash", setup], env=plain, capture_output=True, check=False
        )
        pairs = (entry.partition("=") for entry in done.stdout.decode().split("\0") if entry)
        found = {name: value for name, _, value in pairs}
        if found.get("ROS_VERSION") == "2":
            yield found


def _install_launch_files(environment: dict[str, str], prefix: Path) -> None:
    """Put the checkout's package `hypermap` where `ros2 launch` finds it, as colcon does."""
    package = ROS / "hypermap"
    share, programs = prefix / "share" / "hypermap", prefix / "lib" / "hypermap"
    for folder in ("launch", "maps", "params", "rviz"):
        shutil.copytree(package / folder, share / folder)
    shutil.copytree(package / "scripts", programs)
    index = prefix / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    (index / "hypermap").touch()


class Ros2:
    """The tools of ROS 2, and a node that calls, hears and publishes."""

    def __init__(self, environment: dict[str, str]) -> None:
        self.environment = environment
        self._client = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("ros2_client.py"))],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def close(self) -> None:
        self.tool("daemon", "stop")  # which the tools have started to know the graph
        with self._client:  # closes its pipes
            self._client.communicate(timeout=60)

    def ask(self, do: str, **what: Any) -> Any:
        """Let the node do something; see ros2_client.py."""
        assert self._client.stdin is not None
        assert self._client.stdout is not None
        self._client.stdin.write(json.dumps({"do": do, **what}) + "\n")
        self._client.stdin.flush()
        answer = json.loads(self._client.stdout.readline())
        assert "error" not in answer, f"{do} {what}: {answer['error']}"
        return answer["answer"]

    def call(self, service: str, kind: str, **request: Any) -> Any:
        return self.ask("call", service=service, type=kind, **request)

    def latest(self, topic: str, kind: str) -> Any:
        """Return what a latched topic holds."""
        self.ask("listen", topic=topic, type=kind, latched=True)
        return self.ask("heard", topic=topic)[-1]

    def tool(self, *words: str, is_ok: bool = True) -> str:
        """Run `ros2 WORDS` and return what it prints, errors too."""
        done = subprocess.run(
            ["ros2", *words],
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert (done.returncode == 0) or not is_ok, done.stdout + done.stderr
        return done.stdout + done.stderr

    def has(self, package: str) -> bool:
        """Whether a package can be imported."""
        check = f"import importlib.util as u, sys; sys.exit(u.find_spec({package!r}) is None)"
        done = subprocess.run([sys.executable, "-c", check], env=self.environment, check=False)
        return done.returncode == 0


@pytest.fixture(scope="module")
def ros2(environment: dict[str, str]) -> Iterator[Ros2]:
    """The real ROS 2."""
    made = Ros2(environment)
    yield made
    made.close()


@pytest.fixture
def launch2(ros2: Ros2, start: Callable[..., Process]) -> Callable[..., Process]:
    """Start a launch file of ours with its arguments."""

    def run(file: str, /, **arguments: object) -> Process:
        words = [f"{key}:={value}" for key, value in arguments.items()]
        return start("ros2", "launch", "hypermap", file, *words, env=ros2.environment)

    return run


def point(x: float, y: float, frame: str = "map") -> dict[str, Any]:
    """A `geometry_msgs/PointStamped`."""
    return {"header": {"frame_id": frame}, "point": {"x": float(x), "y": float(y)}}


def string_at(ros2: Ros2, layer: str, where: dict[str, Any]) -> str:
    """Ask the map server for the label of a place."""
    kind = "hypermap_msgs/srv/GetStringAtPoint"
    service = "/hypermap_server/get_string_at_point"
    return str(ros2.call(service, kind, layer=layer, location=where)["name"])
