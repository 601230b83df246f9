"""`hypermap map --view` as a process: what it says, how it ends, and what it leaves."""

from __future__ import annotations

import io
import json
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

import pytest

from hypermap.cli.watching import watching as served
from hypermap.formats import open_map
from hypermap.viewer.live.page import is_page_built

from .commands import PATIENCE, at, hypermap, said_and_opened, started
from .live_tools import saved
from .run_tools import Watching, watching, write_run

pytestmark = pytest.mark.xdist_group("watch_command")  # they share what takes long to make


@pytest.fixture(scope="module")
def long_drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("long") / "drive", frames=4000, cup_from=4)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("short") / "drive", frames=8, cup_from=4)


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let the processes keep their runs in a folder of the test."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


def get(watched: Watching, path: str) -> Any:
    with urlopen(at(watched.url, path), timeout=PATIENCE) as answer:
        return json.load(answer)


def news(watched: Watching) -> Any:
    """Return the first news that a window hears."""
    with urlopen(at(watched.url, "api/events"), timeout=PATIENCE) as answer:
        for line in answer:
            if line.startswith(b"data: "):
                return json.loads(line[len(b"data: ") :])
    raise AssertionError("there were no news")


def wait_for_steps(watched: Watching, count: int) -> Any:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        reply = news(watched)
        if len(reply["steps"]["numbers"]) >= count:
            return reply
        time.sleep(0.2)
    raise AssertionError(f"there were never {count} steps")


def test_ctrl_c_saves_what_there_is_and_again_ends_the_page(
    long_drive: Path, tmp_path: Path, scratch: Path
) -> None:
    output = tmp_path / "room.hmap"
    with watching(long_drive, output) as watched:
        before = wait_for_steps(watched, 3)
        assert before["state"] == "mapping"
        assert not output.exists()
        assert len(list(scratch.glob("hypermap-run-*/*.jpg"))) >= 3
        watched.interrupt()
        watched.wait_for("the run stays at")
        assert "stopping; saving the map so far" in watched.said
        assert "stopped early by Ctrl-C" in watched.said
        used = open_map(output).metadata["frames"]["used"]
        reply = news(watched)
        assert reply["state"] == "saved"
        assert "saved room.hmap, the map of a part of the recording" in reply["message"]
        assert reply["counts"]["used"] == used == len(reply["steps"]["numbers"]) < 4000
        assert get(watched, "api/steps/1")["observation"]["number"] == 1
        assert get(watched, f"api/steps/{used}")["observation"]["number"] == used
        watched.interrupt()
        assert watched.end() == 130
    assert "Traceback" not in watched.said
    assert list(scratch.glob("hypermap-run-*")) == []


def test_a_whole_run_stays_until_ctrl_c_and_leaves_the_same_map(
    drive: Path, tmp_path: Path, scratch: Path
) -> None:
    seen, alone = tmp_path / "room.hmap", tmp_path / "alone" / "room.hmap"
    with watching(drive, seen) as watched:
        watched.wait_for("the run stays at")
        assert "8 used" in watched.said
        assert news(watched)["message"] == "saved room.hmap"
        with pytest.raises(HTTPError, match="403"):
            urlopen(Request(at(watched.url, "api/run"), headers={"Host": "evil.example"}))
        watched.interrupt()
        assert watched.end() == 0
        with pytest.raises(URLError):
            urlopen(watched.url, timeout=PATIENCE)
    assert list(scratch.glob("hypermap-run-*")) == []
    alone.parent.mkdir()
    done = hypermap("map", drive, "-o", alone, "--intrinsics", "131.25,131.25,79.5,59.5")
    assert done.returncode == 0, done.stderr
    assert seen.read_bytes() == alone.read_bytes()


def test_ctrl_c_may_come_as_soon_as_it_is_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ctrl_c: None
) -> None:
    class Terminal(io.StringIO):
        is_pressed = False

        def write(self, text: str) -> int:
            length = super().write(text)
            if "until Ctrl-C" in text and not self.is_pressed:
                self.is_pressed = True
                signal.raise_signal(signal.SIGINT)
            return length

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    try:
        with served(True, "drive", saved(tmp_path), 1, 0, False) as watched:
            watched.finish("saved")
    except KeyboardInterrupt:
        pytest.fail("the page was not ended in order")
    assert terminal.is_pressed


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_who_gives_up_leaves_nothing_behind(
    long_drive: Path, tmp_path: Path, scratch: Path, number: int
) -> None:
    with watching(long_drive, tmp_path / "room.hmap") as watched:
        wait_for_steps(watched, 2)
        watched.process.send_signal(number)
        if number == signal.SIGINT:  # the second one does not wait for the map
            watched.wait_for("stopping")  # or both might count as one
            watched.process.send_signal(number)
        # The second Ctrl-C may find nothing left but Python itself, which it kills then.
        assert watched.end() in (130, 143, -signal.SIGINT)
    assert "Traceback" not in watched.said
    assert list(scratch.glob("hypermap-run-*")) == []


def test_a_port_in_use_is_said_before_anything_is_mapped(drive: Path, tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = hypermap("map", drive, "-o", tmp_path / "room.hmap", "--view", "--port", port)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"port {port} of 127.0.0.1 is in use" in done.stderr.splitlines()[-1]
    assert "mapping" not in done.stderr
    assert not (tmp_path / "room.hmap").exists()


@pytest.mark.parametrize("options", [["--port", "0"], ["--no-browser"]])
def test_options_of_the_page_need_the_page(drive: Path, tmp_path: Path, options: list[str]) -> None:
    done = hypermap("map", drive, "-o", tmp_path / "room.hmap", *options)
    assert done.returncode == 2
    assert "--port and --no-browser need --view" in done.stderr


def test_a_recording_that_fails_ends_the_page_and_says_why(tmp_path: Path, scratch: Path) -> None:
    drive = write_run(tmp_path / "drive", frames=5, cup_from=2)
    (drive / "detections.json").write_text('{"frames": 7}')
    done = hypermap(
        "map", drive, "-o", tmp_path / "room.hmap", "--view", "--no-browser", "--port", "0"
    )
    assert done.returncode == 2
    assert "detections.json" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    assert list(scratch.glob("hypermap-run-*")) == []


@pytest.mark.skipif(not is_page_built(), reason="the page is not built: make page")
def test_the_browser_is_opened_at_the_page(drive: Path, tmp_path: Path) -> None:
    output = tmp_path / "r.hmap"
    said, opened = said_and_opened(tmp_path, "map", drive, "-o", output, "--view", "--port", 0)
    assert opened.partition("=")[0] == said.partition("=")[0]
    assert opened != said  # other users see what programs are started with


def test_the_demo_can_be_watched_too(tmp_path: Path, scratch: Path) -> None:
    options = ["--view", "--no-browser", "--port", 0]
    process = started("demo", "--folder", tmp_path / "demo", *options, stderr=subprocess.DEVNULL)
    with process:
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        end = time.monotonic() + PATIENCE
        names: set[str] = set()
        while len(names) < 2 and time.monotonic() < end:
            time.sleep(0.5)
            with urlopen(at(url, "api/run"), timeout=PATIENCE) as answer:
                assert json.load(answer)["output"] == "room.hmap"
            try:
                with urlopen(at(url, "api/steps/4"), timeout=PATIENCE) as answer:
                    names = {name for _, name, *_ in json.load(answer)["objects"]["set"]}
            except HTTPError as error:
                error.close()  # there is no step yet
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=PATIENCE) in (130, 0)  # 0 where all is mapped by now
    assert {"table", "chair"} & names
    assert list(scratch.glob("hypermap-run-*")) == []
