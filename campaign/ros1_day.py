"""A day on ROS 1: `hypermap live` and `hypermap serve` on a roscore, under a clock that is quick.

A robot shows frames, and its clock and tf run with them. Nodes are ended and killed, another one
takes the name, the clock jumps, topics fall silent, the roscore is killed and comes back. Each
frame that is shown whole is mapped, what was mapped is saved, memory stays level, logs are short.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path

import numpy as np

from campaign.fuzz_targets.target import of_tests
from campaign.long_runs import drive
from campaign.part import Budget, Finding, Result
from campaign.ros1_robot import Ros1Robot
from hypermap.formats import open_map
from hypermap.perception.frame import RgbdFrame

DAY = 86_400.0  # s
_BEGINS = 1_600_000_000.0  # s since 1970
_PATIENCE = 120.0  # s for a program to start, to answer or to end
_EVERY = 25  # frames, of which the last meets an event
_SETTLES = 3  # frames after it that need not be mapped, as tf begins anew
_EVENTS = (
    *("back", "no depth", "no detections", "no tf", "ahead", "pause", "roscore"),
    *("zero", "no info", "server", "silence"),
)
_ENDS = ("kill", "end", "same name")  # of a life: from the evening on, every other event
_EVENING = 0.6  # of the day; until then there is one life
_SHORT = ("roscore", "kill", "back")  # all that the short form has
_SHORT_EVERY = 6
_FEWEST = 300  # frames of a life, from which on growth is distinguishable from noise
GROWTH = (
    60.0  # MB that a life may add: the log fills with its first 3,000 frames, and saves copy it
)
LINES = 12  # that a node may log for each event and start


def run(budget: Budget) -> Result:
    """Let a robot drive for a day, as quickly as the node maps."""
    if shutil.which("roscore") is None:
        return Result("ros1_day", 0, [], {"ros1": "left out: there is no roscore"})
    with tempfile.TemporaryDirectory() as folder:
        day = _Day(Path(folder), budget)
        try:
            day.drive(drive(budget.seed, rate=0.5 if budget.short else 2.0))
        finally:
            day.end()
        return day.result()


class _Program:
    """A program whose output goes to a file, and all that it starts."""

    def __init__(self, words: Sequence[str], log: Path) -> None:
        with log.open("ab") as output:
            self._process = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
            )

    @property
    def is_running(self) -> bool:
        return self._process.poll() is None

    @property
    def memory(self) -> float:
        """What it holds in memory [MB]; NaN once it has ended."""
        with contextlib.suppress(OSError, IndexError):
            statm = Path(f"/proc/{self._process.pid}/statm").read_text(encoding="ascii")
            return int(statm.split()[1]) * 4096 / 1e6
        return float("nan")

    def end(self, number: int = signal.SIGINT) -> int:
        """End it, as Ctrl-C does or by another signal, and return with which code it ended."""
        family = _family(self._process.pid) if number == signal.SIGKILL else [self._process.pid]
        for pid in family:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)
        return self.wait()

    def wait(self) -> int:
        """Wait until it ends, and return with which code; what hangs is killed."""
        try:
            return self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            return self.end(signal.SIGKILL)


def _family(pid: int) -> list[int]:
    """Return a process and all that it has started: roslaunch gives each a session of its own."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    children = [int(child) for task in tasks for child in task.read_text("ascii").split()]
    return [pid, *(member for child in children for member in _family(child))]


class _Day:
    """The roscore, the nodes and the robot, and what became of the frames."""

    def __init__(self, folder: Path, budget: Budget) -> None:
        self._budget, self._saved = budget, folder / "live.hmap"
        self._logs = {name: budget.folder / f"{name}.log" for name in ("live", "serve", "core")}
        for log in self._logs.values():
            log.unlink(missing_ok=True)
        self._found: list[str] = []
        self._rng = np.random.default_rng(budget.seed)
        self._clock, self._frames, self._mapped, self._events = _BEGINS, 0, 0, 0
        self._starts = self._roscores = self._lives = 0
        self._life: list[float] = []  # what the node held after each frame [MB]
        self._growth: list[float] = []  # MB that each long life added, once warm
        self._slowest, self._used = 0.0, 0
        self._server: _Program | None = None
        self._port = of_tests("roscore").free_port()
        os.environ.update(
            ROS_MASTER_URI=f"http://127.0.0.1:{self._port}",
            ROS_HOSTNAME="127.0.0.1",
            ROS_HOME=str(folder),
            ROS_LOG_DIR=str(folder),
        )
        self._core = self._new_roscore()
        self._robot = Ros1Robot("live")
        self._live = self._new_live()

    def end(self) -> None:
        """End what runs."""
        for program in (self._live, self._server, self._core):
            if program is not None and program.is_running:
                program.end()

    # What runs

    def _new_roscore(self) -> _Program:
        from hypermap.ros.ros1.libraries import rosgraph

        core = _Program(of_tests("roscore").roscore_command(self._port), self._logs["core"])
        self._roscores += 1
        _wait_for(rosgraph.is_master_online, "the roscore")
        rosgraph.Master("/day").setParam("/use_sim_time", True)
        return core

    def _new_live(self) -> _Program:
        camera, saved = of_tests("ros.live_camera"), str(self._saved)
        words = ["live", "--ros1", "__name:=live", "--onto", saved, "-o", saved]
        words += ["--depth-topic", camera.DEPTH, "--detections-topic", camera.DARKNET]
        words += ["--save-every", "3", "--param", "tf_timeout=0.5"]
        self._robot.forget()
        live = _Program([sys.executable, "-m", "hypermap", *words], self._logs["live"])
        self._starts += 1
        self._lives += 1
        self._end_memory()
        self._mapped_in_life = 0
        self._wait_until_heard(live)
        return live

    def _new_server(self) -> _Program:
        self._starts += 1
        words = ["serve", str(self._saved), "--ros1", "__name:=served"]
        return _Program([sys.executable, "-m", "hypermap", *words], self._logs["serve"])

    def _wait_until_heard(self, live: _Program) -> None:
        def is_heard() -> bool:
            self._tick(0.1)
            return self._robot.is_heard() or not live.is_running

        _wait_for(is_heard, "the live node to listen")

    def _wait_until_known(self) -> None:
        """Wait until all nodes have registered with a roscore that is new."""
        from hypermap.ros.ros1.libraries import rosgraph

        names = ["/live", "/robot", *(["/served"] if self._server else [])]

        def are_known() -> bool:
            self._tick(0.1)
            with contextlib.suppress(rosgraph.MasterException, OSError):
                return all(rosgraph.Master("/day").lookupNode(name) for name in names)
            return False

        _wait_for(are_known, "the nodes to register again")

    # The day

    def drive(self, frames: list[RgbdFrame]) -> None:
        """Show frames over and over, until the day or the time is over."""
        began, seconds, before = time.monotonic(), max(self._budget.left, 1.0), 0.0
        every = _SHORT_EVERY if self._budget.short else _EVERY
        most = every * (len(_SHORT) + 1) if self._budget.short else 100_000
        for i, frame in zip(range(most), cycle(frames), strict=False):
            gone = max((time.monotonic() - began) / seconds, (i + 1) / most)
            if gone > 1:
                break
            self._tick((gone - before) * DAY)
            before = gone
            if i and i % every == 0:
                self._meet(self._next_event(gone), frame)
            self._show(frame, must=i % every >= _SETTLES)
            self._look()
        self._end_life(signal.SIGINT)
        self._end_memory()

    def _next_event(self, gone: float) -> str:
        self._events += 1
        if self._budget.short:
            return _SHORT[self._events - 1]
        if gone > _EVENING and self._events % 2:
            return _ENDS[self._events // 2 % len(_ENDS)]
        return _EVENTS[self._events % len(_EVENTS)]

    def _tick(self, seconds: float) -> None:
        self._clock += seconds
        self._robot.tell_time(self._clock)

    def _now(self, frame: RgbdFrame) -> RgbdFrame:
        """Return a frame as of now, from a slightly other pose."""
        pose = frame.map_T_camera.copy()
        pose[:2, 3] += self._rng.normal(0, 0.02, 2)
        return dataclasses.replace(frame, stamp=self._clock, map_T_camera=pose)

    def _show(self, frame: RgbdFrame, *, must: bool = True) -> None:
        """Show a frame whole; it must be mapped, unless an event was just before."""
        self._frames += 1
        started = time.monotonic()
        if self._robot.show(self._now(frame), must=must):
            self._mapped += 1
            self._mapped_in_life += 1
            self._slowest = max(self._slowest, time.monotonic() - started)
        elif must:
            self._found.append(f"frame {self._frames} was not mapped: {self._robot.fates}")

    def _look(self) -> None:
        """See that the nodes run, and what the live one holds."""
        if not self._live.is_running:
            self._found.append("the live node ended by itself")
            self._live = self._new_live()
        self._life.append(self._live.memory)
        if self._server is None and self._saved.exists():
            self._server = self._new_server()
        elif self._server is not None and not self._server.is_running:
            self._found.append("the map server ended by itself")
            self._server = self._new_server()

    def _meet(self, event: str, frame: RgbdFrame) -> None:
        """Let something happen."""
        by = float(self._rng.uniform(2, 3600))
        if event in ("back", "zero", "ahead"):
            to = {"back": self._clock - by, "zero": 1.0, "ahead": self._clock + 24 * by}[event]
            self._tick(max(to, 1.0) - self._clock)
        elif event.startswith("no "):
            for _ in range(10):
                self._tick(1.0)
                self._robot.show_without(self._now(frame), event.removeprefix("no "))
            self._robot.settle()
        elif event == "silence":
            for _ in range(60):
                self._tick(60.0)
        elif event == "pause":
            time.sleep(2.0)
        elif event == "roscore":
            self._restart_roscore(frame)
        elif event == "server":
            self._restart_server()
        elif event == "same name":  # who comes later has it, as ever on ROS 1
            older, self._live = self._live, self._new_live()
            older.wait()
        else:
            self._end_life(signal.SIGKILL if event == "kill" else signal.SIGINT)
            self._live = self._new_live()

    def _restart_roscore(self, frame: RgbdFrame) -> None:
        """Kill the roscore, and start it again after a while in which mapping goes on."""
        self._core.end(signal.SIGKILL)
        for _ in range(_SETTLES):
            self._tick(1.0)
            self._show(frame)  # nodes that know each other need none
        self._core = self._new_roscore()
        self._wait_until_known()
        self._wait_until_heard(self._live)

    def _restart_server(self) -> None:
        """Ask the map server, end it and start it again."""
        from hypermap.ros.ros1.libraries import rospy
        from hypermap.ros.ros1.messages import service_class

        if self._server is None:
            return
        kind, name = service_class("hypermap_msgs/GetSemanticByString"), "get_semantic_by_string"
        asked = str(open_map(self._saved).semantic().names[0])
        try:
            rospy.wait_for_service(f"/served/{name}", _PATIENCE)
            if not rospy.ServiceProxy(f"/served/{name}", kind)(asked).objects:
                self._found.append(f"the map server knows no {asked}")
        except rospy.exceptions.ROSException as error:
            self._found.append(f"the map server did not answer: {error}")
        if code := self._server.end():
            self._found.append(f"the map server ended with {code}")
        self._server = self._new_server()

    def _end_memory(self) -> None:
        """Note how much a life has added to what the node held, if it was a long one."""
        memory, self._life = np.asarray(self._life), []
        if len(memory) >= _FEWEST:
            warm = np.arange(len(memory) // 4, len(memory))
            self._growth.append(len(warm) * float(np.polyfit(warm, memory[warm], 1)[0]))

    def _end_life(self, number: int) -> None:
        """End the live node, and see that its map has what it mapped."""
        code = self._live.end(number)
        if number == signal.SIGINT and code:
            self._found.append(f"the live node ended with {code}")
        if not self._saved.exists():
            self._found.append("no map was saved")
            return
        counts = open_map(self._saved).metadata["frames"]
        least = self._used + (self._mapped_in_life if number == signal.SIGINT else 0)
        if counts["used"] + counts["skipped"] < least:
            self._found.append(f"{least} frames were mapped, but the map has {counts}")
        self._used = counts["used"]

    def result(self) -> Result:
        """Return what the day was like."""
        logs = {name: _lines(self._logs[name]) for name in ("live", "serve")}
        self._found += [
            f"{name} {what}" for name, log in logs.items() for what in odd_lines(log, self._allowed)
        ]
        self._found += [f"a life added {mb:.0f} MB" for mb in self._growth if mb > GROWTH]
        figures: dict[str, float | str] = {
            "frames": self._frames,
            "frames mapped": self._mapped,
            "events": self._events,
            "lives of the live node": self._lives,
            "roscores": self._roscores,
            "lines logged by the live node": len(logs["live"]),
            "lines logged by the map server": len(logs["serve"]),
            "MB that long lives added": ", ".join(f"{mb:.0f}" for mb in self._growth),
            "slowest": f"{self._slowest:.2f} s (a frame)",
        }
        log, seed = self._logs["live"], self._budget.seed
        return Result(
            "ros1_day", self._frames, [Finding(what, seed, log) for what in self._found], figures
        )

    @property
    def _allowed(self) -> int:
        return LINES * (self._events + self._starts)


def odd_lines(log: Sequence[str], most: int) -> list[str]:
    """Return in words what is wrong with a node's log, of which so many lines are allowed."""
    found = [f"logged {len(log)} lines, more than {most}"] if len(log) > most else []
    if traces := sum(line.startswith("Traceback") for line in log):
        found.append(f"logged {traces} tracebacks")
    return found


def _lines(log: Path) -> list[str]:
    return log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []


def _wait_for(condition: Callable[[], object], what: str) -> None:
    end = time.monotonic() + _PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"timed out waiting for {what}")
        time.sleep(0.02)
