"""The console of the map server, typed on a terminal of its own, through a real roscore."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hypermap.core.hypermap import Hypermap
from hypermap.testing import occupancy_from_text

from .conftest import wait_for
from .map_server_tools import Client, building, saved

pytestmark = pytest.mark.xdist_group("ros")

_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Terminal:
    """A server on a pseudo-terminal; what it shows is read all the time, as a person would."""

    def __init__(self, path: Path | None, name: str, folder: Path) -> None:
        self._master, slave = pty.openpty()
        environment = {**os.environ, "XDG_STATE_HOME": str(folder), "PROMPT_TOOLKIT_NO_CPR": "1"}
        file = [] if path is None else [str(path)]
        self.popen = subprocess.Popen(
            [sys.executable, "-m", "hypermap", "serve", *file, "--ros1", f"__name:={name}"],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env={**environment, "TERM": "xterm"},
            preexec_fn=_own_terminal,
        )
        os.close(slave)
        self._shown = b""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def shown(self) -> str:
        return _ESCAPES.sub("", self._shown.decode(errors="replace")).replace("\r", "")

    def type(self, text: str) -> None:
        os.write(self._master, text.encode())

    def ask(self, line: str, answer: str) -> None:
        """Type a line and wait for what is shown after it."""
        begin = len(self.shown)
        self.type(f"{line}\r")
        wait_for(lambda: answer in self.shown[begin:], f"{answer!r} after {line!r}: {self.shown}")

    def ends(self) -> int:
        code = self.popen.wait(240)
        self._reader.join(5)
        return code

    def close(self) -> None:
        if self.popen.poll() is None:
            self.popen.kill()
            self.popen.wait()
        self._reader.join(5)
        os.close(self._master)

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # the other end is gone
            while found := os.read(self._master, 4096):
                self._shown += found


def _own_terminal() -> None:
    """Make standard input the terminal that controls this process, as a shell does."""
    import fcntl
    import termios

    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


@pytest.fixture
def terminal(rospy: Any, tmp_path: Path) -> Iterator[Callable[..., Terminal]]:
    opened: list[Terminal] = []

    def run(path: Path | None, name: str) -> Terminal:
        opened.append(Terminal(path, name, tmp_path))
        wait_for(lambda: "hypermap>" in opened[-1].shown, "the prompt")
        return opened[-1]

    yield run
    for made in opened:
        made.close()


def test_what_is_typed_is_carried_out_on_the_map_that_is_served(terminal, rospy, tmp_path):
    path = saved(building(), tmp_path / "building.hmap")
    other = saved(Hypermap([occupancy_from_text("#")]), tmp_path / "my other.hmap")
    served = terminal(path, "typed_at")
    client = Client(rospy, "typed_at")
    served.ask("getString semantic 9.5 1", "table")
    served.ask("fly", "error: unknown command 'fly'")
    served.ask(f"load {tmp_path}/nowhere.hmap", "there is no such file")
    assert client.string("semantic", 9.5, 1) == "table"
    served.ask(f'load "{other}"', "loaded 1 layer ")
    assert client.string("occupancy", 0.5, 0.5) == "Occupied"
    heard = client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda m: m.info.width == 1)
    assert list(heard.data) == [100]
    served.ask("republish", "published 1 layer again")
    served.ask(f"save {tmp_path}/saved.hmap", "saved 1 layer ")
    served.ask("clear", "the map is empty now")
    assert "known: none" in client.refused(
        "get_string_at_point", "GetStringAtPoint", layer="x", location=client.point(0, 0)
    )
    served.ask(f"load {tmp_path}/saved.hmap", "loaded 1 layer ")
    assert client.string("occupancy", 0.5, 0.5) == "Occupied"
    served.type("exit\r")
    assert served.ends() == 0, served.shown
    assert "Traceback" not in served.shown


def test_the_end_of_input_ends_the_console_alone_and_costs_nothing(terminal, rospy, tmp_path):
    served = terminal(saved(building(), tmp_path / "building.hmap"), "without_input")
    served.type("\x04")
    wait_for(lambda: "the console has ended" in served.shown, "the end of the console")
    before, begin = _seconds(served.popen.pid), time.monotonic()
    assert Client(rospy, "without_input").string("occupancy", 0.5, 0.5) == "Free"
    wait_for(lambda: time.monotonic() > begin + 1.0, "a second")
    assert _seconds(served.popen.pid) - before < 0.5 * (time.monotonic() - begin)
    served.popen.send_signal(signal.SIGINT)
    assert served.ends() == 0, served.shown
    assert "Traceback" not in served.shown


@pytest.mark.parametrize("how", ["typed", "signal"])
def test_ctrl_c_ends_the_node_and_leaves_the_terminal_as_it_was(terminal, how):
    import termios

    served = terminal(None, f"ctrl_c_{how}")
    typing = termios.tcgetattr(served._master)[3]
    assert not typing & termios.ECHO  # the prompt draws what is typed itself
    if how == "typed":
        served.type("getLayer\x03")
    else:
        served.popen.send_signal(signal.SIGINT)
    assert served.ends() == 0, served.shown
    assert termios.tcgetattr(served._master)[3] & termios.ECHO
    assert "Traceback" not in served.shown


def test_in_the_background_nobody_is_asked(start, rospy):
    """A process that reads its terminal from the background would be stopped by the system."""
    master, slave = pty.openpty()
    process = start("hypermap", "serve", "--ros1", "__name:=in_background", stdin=slave)
    process.expect("starting without a map")
    answer = Client(rospy, "in_background").call("clear", "std_srvs/Trigger")
    assert answer.success
    assert "hypermap>" not in process.output
    assert process.stop() == 0
    os.close(slave)
    os.close(master)


def _seconds(pid: int) -> float:
    """Return how long a process has kept the processor busy."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
