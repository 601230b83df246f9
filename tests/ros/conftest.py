"""A roscore of its own for the tests of a worker, and processes that end with their test."""

from __future__ import annotations

import gc
import io
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import pytest

from hypermap.core.errors import HypermapError

from ..prepared import Command
from ..roscore import free_port, roscore_command

collect_ignore = ["port_node.py", "ros2_client.py"]  # programs, which doctest would import

# rospy leaves the sockets of its calls of the roscore to the garbage collector.
ROSPY_SOCKETS = pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning")

ROS = Path(__file__).resolve().parents[2] / "ros"
NEEDS_ROS1 = "ROS 1 is not here (on Debian 12, as root: make ros1)"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = Path(__file__).parent
    for item in items:
        if item.path.is_relative_to(here):
            item.add_marker(ROSPY_SOCKETS)


@pytest.fixture(scope="module", autouse=True)
def _no_socket_left_for_others() -> Iterator[set[str]]:
    """Close what rospy has left, if any test of the module has used it: the names of fixtures."""
    used: set[str] = set()
    yield used
    if "rospy" in used:
        gc.collect()
        gc.freeze()  # else the next one looks through all that is loaded again


@pytest.fixture(autouse=True)
def _no_parameter_left_for_others(
    request: pytest.FixtureRequest, _no_socket_left_for_others: set[str]
) -> Iterator[None]:
    """Take away what a test, or a node that it started, has left on the roscore of the worker."""
    _no_socket_left_for_others.update(request.fixturenames)
    if "ROS_MASTER_URI" not in os.environ:
        yield
        return
    with ServerProxy(os.environ["ROS_MASTER_URI"], allow_none=True) as master:
        before = _parameters(master)
        yield
        for name in _parameters(master) - before:
            master.deleteParam("/tests", name)


def _parameters(master: ServerProxy) -> set[str]:
    answer: Any = master.getParamNames("/tests")
    return set(answer[2])


def wait_for(condition: Callable[[], Any], what: str, timeout: float = 120.0) -> Any:
    """Return the first true answer of a condition."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if answer := condition():
            return answer
        time.sleep(0.02)
    pytest.fail(f"no {what} after {timeout:g} s")


def wait_for_listener(publisher: Any, what: str) -> None:
    """Wait until somebody listens to a publisher of rospy, and announce it again meanwhile.

    The master tells of publishers in threads of its own. So the last that a listener hears may be
    that the publisher of the test before has gone, and it leaves this one, too.
    """
    import rosgraph
    import rospy

    master = rosgraph.Master(rospy.get_name())
    announced = time.monotonic()

    def is_heard() -> bool:
        nonlocal announced
        if publisher.get_num_connections() > 0:
            return True
        if time.monotonic() > announced + 5:
            announced = time.monotonic()
            name, kind = publisher.resolved_name, publisher.type
            master.registerPublisher(name, kind, rospy.get_node_uri())
        return False

    wait_for(is_heard, what)


HYPERMAP = [sys.executable, "-m", "hypermap"]
ROS1_TOOLS = ("roslaunch", "rosmsg", "rosnode", "rosparam", "rosservice", "rostopic")
# What nodes import. Others, as matplotlib, can abort a process at whose end threads still run, as
# those of rospy do.
PACKAGES = ("hypermap.cli", "hypermap.formats", "hypermap.ros", "hypermap.ros.ros1", *ROS1_TOOLS)


def program_of_python(command: Sequence[str]) -> tuple[tuple[str, ...], Sequence[str]] | None:
    """Return which program a command has Python run, and its words; None for other commands."""
    if command[0] in ROS1_TOOLS:
        return (str(shutil.which(command[0])),), command[1:]
    if command[0] != sys.executable:
        return None
    count = 3 if command[1] in ("-c", "-m") else 2
    return tuple(command[1:count]), command[count:]


class Process:
    """A program with its output in a file; what ROS writes gets there at once, too.

    A program of Python, as `HYPERMAP` and words or a tool of ROS 1, is a copy that starts quickly,
    unless it `is_new`: what a copy has imported already is not searched for on its PYTHONPATH.
    """

    popen: subprocess.Popen[bytes] | Command

    def __init__(
        self,
        command: list[str],
        log: Path,
        *,
        stdin: int = subprocess.DEVNULL,
        env: Mapping[str, str] | None = None,
        is_new: bool = False,
    ) -> None:
        self.log = log
        environment = dict(os.environ if env is None else env)
        if command[0] != sys.executable:  # ours must show by themselves what they say
            environment["PYTHONUNBUFFERED"] = "1"
        with log.open("wb") as output:
            options: dict[str, Any] = {
                "stdout": output,
                "stderr": subprocess.STDOUT,
                "stdin": stdin,
                "start_new_session": True,
                "env": environment,
            }
            if is_new or (program := program_of_python(command)) is None:
                self.popen = subprocess.Popen(command, **options)
            else:
                self.popen = Command(*program[1], **options, packages=PACKAGES, program=program[0])

    @property
    def output(self) -> str:
        return self.log.read_text(errors="replace")

    def expect(self, text: str, timeout: float = 120.0) -> None:
        """Wait until the output holds a text."""
        wait_for(lambda: text in self.output or self.popen.poll() is not None, repr(text), timeout)
        assert text in self.output, self.output

    def stop(self, number: int = signal.SIGINT, timeout: float = 240.0) -> int:
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
            words[:1] = HYPERMAP
        running.append(Process(words, tmp_path / f"process{len(running)}.log", **options))
        return running[-1]

    yield run
    for process in reversed(running):
        if process.popen.poll() is None:
            process.stop(signal.SIGTERM)
        print(f"{process.popen.args}:\n{process.output[-3000:]}")  # noqa: T201 - shown if it failed


@pytest.fixture(scope="session")
def needs_ros1() -> None:
    """Skip where ROS 1 or its libraries for this Python are missing."""
    if shutil.which("roscore") is None:
        pytest.skip(NEEDS_ROS1)
    try:
        import hypermap.ros.ros1.libraries  # noqa: F401 - whether they are there
    except HypermapError:
        pytest.skip("ROS 1 is for another Python (make test PYTHON=/usr/bin/python3)")


@pytest.fixture(scope="session")
def roscore(needs_ros1: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The URI of a roscore; `ROS_MASTER_URI` names it to this process and those that it starts."""
    folder = tmp_path_factory.mktemp("roscore")
    port = free_port()
    uri = f"http://127.0.0.1:{port}"
    os.environ.update(ROS_MASTER_URI=uri, ROS_HOSTNAME="127.0.0.1", ROS_HOME=str(folder / "home"))
    core = Process(roscore_command(port), folder / "roscore.log")
    try:
        core.expect("started core service")
        yield uri
    finally:
        core.stop()


@pytest.fixture(scope="session")
def rospy(roscore: str) -> Iterator[Any]:
    """The library rospy, with this process as a node; calls of services and topics are real."""
    from hypermap.ros.ros1.libraries import rospy

    rospy.init_node("tests", anonymous=True, disable_signals=True)
    yield rospy
    rospy.signal_shutdown("the tests have ended")
    for master in rospy.core._xmlrpc_cache.values():
        master("close")()  # otherwise its socket is left for the end of pytest
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        gc.collect()


@pytest.fixture
def launch(
    rospy: Any, start: Callable[..., Process], monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., Process]]:
    """Start a launch file of the checkout, or any other; the nodes run with this Python."""
    path = os.environ.get("ROS_PACKAGE_PATH")
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([str(ROS), *([path] if path else [])]))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")

    def run(file: str | Path, /, **arguments: object) -> Process:
        words = [f"{key}:={value}" for key, value in arguments.items()]
        place = [file] if Path(file).is_absolute() else ["hypermap", file]
        # A node on a busy machine may take its time to end; roslaunch would kill it after 17 s.
        return start("roslaunch", "--sigint-timeout=240", *place, *words)

    yield run
    if rospy.has_param("/use_sim_time"):
        rospy.delete_param("/use_sim_time")


class Ros1Types:
    """The classes of ROS 1; `sent` returns what the receiver of a message gets."""

    def __init__(self) -> None:
        import genpy

        from hypermap.ros.ros1.messages import message_class, service_class

        self.message = message_class
        self.request = lambda name: service_class(name)._request_class
        self.response = lambda name: service_class(name)._response_class
        self.stamp = lambda nanoseconds: genpy.Time(*divmod(nanoseconds, 10**9))

    def encoded(self, message: Any) -> bytes:
        buffer = io.BytesIO()
        message.serialize(buffer)
        return buffer.getvalue()

    def sent(self, message: Any) -> Any:
        made = next(kind for kind in type(message).__mro__ if "_md5sum" in vars(kind))
        return made().deserialize(self.encoded(message))


class Ros2Types:
    """The classes of ROS 2, as rosbags makes them; `sent` as above."""

    def __init__(self) -> None:
        from hypermap.ros import typestore

        self.message = typestore.message_class
        self.request = typestore.request_class
        self.response = typestore.response_class
        self.stamp = typestore.stamp
        self.encoded = typestore.encode
        self._decode = typestore.decode

    def sent(self, message: Any) -> Any:
        return self._decode(self.encoded(message), type(message))


@pytest.fixture(scope="session")
def ros1_types(needs_ros1: None) -> Ros1Types:
    """The message classes of ROS 1; no roscore is needed for them."""
    return Ros1Types()


@pytest.fixture(scope="session", params=["ros1", "ros2"])
def types(request: pytest.FixtureRequest) -> Any:
    """The message classes of ROS 1, and those of ROS 2."""
    return request.getfixturevalue("ros1_types") if request.param == "ros1" else Ros2Types()


@pytest.fixture(scope="module")
def port(rospy: Any) -> Iterator[Any]:
    """A `Ros1Port` on the node of this process; that node lives on after it."""
    from hypermap.ros.ros1.port import Ros1Port

    port = Ros1Port("tests")
    yield port
    port._watch.close()
    if port._static is not None:
        port._static.close()
