from __future__ import annotations

import contextlib
import json
import os
import queue
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import pytest

import hypermap as hypermap_package
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import save_map
from hypermap.testing import square
from hypermap.viewer.live.page import is_page_built

from ..prepared import Command
from .commands import PATIENCE, at, hypermap, said_and_opened, started
from .live_tools import pixels_of, saved


@dataclass
class Server:
    """A running `hypermap view`."""

    process: Command
    url: str

    def get(self, path: str) -> Any:
        with urlopen(at(self.url, path), timeout=PATIENCE) as answer:
            return json.load(answer)

    def post(self, path: str, **body: Any) -> Any:
        token = self.get("api/map")["token"]
        headers = {"X-Hypermap-Token": token, "Content-Type": "application/json"}
        request = Request(at(self.url, path), json.dumps(body).encode(), headers)
        with urlopen(request, timeout=PATIENCE) as answer:
            return json.load(answer)

    def rename(self, number: int, name: str) -> Any:
        operation = {"op": "update", "layer": "things", "id": number, "name": name}
        version = self.get("api/map")["version"]
        return self.post("api/edit", version=version, operations=[operation])

    def end(self, number: int = signal.SIGINT) -> tuple[int, str]:
        """Send a signal, and return the exit code and what was said on standard error."""
        self.process.send_signal(number)
        _, said = self.process.communicate(timeout=PATIENCE)
        return self.process.wait(), said


@contextlib.contextmanager
def viewing(*arguments: object) -> Iterator[Server]:
    environment = {k: v for k, v in os.environ.items() if k != "BROWSER"}
    process = started("view", *arguments, "--no-browser", stderr=subprocess.PIPE, env=environment)
    try:
        assert process.stdout is not None
        assert select.select([process.stdout], [], [], PATIENCE)[0], "no address was printed"
        url = process.stdout.readline().strip()
        assert url.startswith("http://"), process.communicate()[1]
        yield Server(process, url)
    finally:
        process.kill()
        process.communicate()


@contextlib.contextmanager
def events(server: Server, version: int | None = None) -> Iterator[Callable[[], dict[str, Any]]]:
    """Listen to the server's news, and yield a function that returns the next of them."""
    headers = {} if version is None else {"Last-Event-ID": str(version)}
    answer = urlopen(Request(at(server.url, "api/events"), headers=headers), timeout=PATIENCE)
    assert answer.headers["Content-Type"].startswith("text/event-stream")
    assert answer.headers["X-Accel-Buffering"] == "no"  # of nginx
    heard: queue.Queue[dict[str, Any]] = queue.Queue()

    def listen() -> None:
        with contextlib.suppress(OSError, ValueError):
            for line in answer:
                if line.startswith(b"data: "):
                    heard.put(json.loads(line[len(b"data: ") :]))

    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    yield lambda: heard.get(timeout=PATIENCE)
    # The server ends the stream; closing it here would wait for the reading thread.


@contextlib.contextmanager
def a_port() -> Iterator[int]:
    """Yield a free port that only those who ask for it by number get, as the server does."""
    with socket.socket() as held:
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        yield held.getsockname()[1]


def test_a_map_is_served_asked_changed_and_saved_over_http(tmp_path):
    path = saved(tmp_path)
    with viewing(path, "--port", 0) as server:
        assert server.get("api/map")["path"] == str(path)
        with urlopen(at(server.url, "api/tiles/occupancy/3/0/0.png"), timeout=PATIENCE) as answer:
            assert answer.headers["Content-Type"] == "image/png"
            assert pixels_of(answer.read()).shape == (256, 256, 4)
        with events(server) as next_news:
            first = next_news()
            assert (first["layers"], first["unsaved"]) == ([], False)
            reply = server.rename(0, "mug")
            news = next_news()
            assert (news["version"], news["layers"]) == (reply["version"], ["things"])
            assert (news["unsaved"], news["can_undo"]) == (True, True)
            server.post("api/save")
            news = next_news()
            assert (news["saved"], news["unsaved"], news["layers"]) == (True, False, [])
            began = time.monotonic()
            code, said = server.end()
            assert code == 0
            assert time.monotonic() - began < PATIENCE / 3, "an open window must not delay the end"
        assert "unsaved" not in said
        assert "Traceback" not in said


def test_news_go_on_where_a_window_stopped_listening(tmp_path):
    with viewing(saved(tmp_path), "--port", 0) as server:
        version = server.get("api/map")["version"]
        server.rename(0, "mug")
        server.rename(1, "desk")
        with events(server, version) as next_news:
            news = next_news()
            assert (news["version"], news["layers"]) == (version + 2, ["things"])


def test_a_file_that_changes_or_vanishes_is_noticed(tmp_path):
    path = saved(tmp_path)
    with viewing(path, "--port", 0) as server, events(server) as next_news:
        assert "disk" not in next_news()
        save_map(Hypermap([SemanticLayer("things", "lab", [square("theirs", 0, 0)])]), path)
        assert next_news()["disk"] == "changed"
        path.unlink()
        assert next_news()["disk"] == "vanished"
        assert server.get("api/map")["disk"] == "vanished"
        assert len(server.get("api/shapes/things?bbox=-99,-99,99,99&resolution=1")["features"]) == 3
        saved(tmp_path)
        assert next_news()["disk"] == "changed"
        server.post("api/reload")
        news = next_news()
        assert "disk" not in news
        assert news["layers"] == ["occupancy", "things"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_who_ends_the_server_is_warned_of_what_was_not_saved(tmp_path, number):
    path = saved(tmp_path)
    before = path.read_bytes()
    with viewing(path, "--port", 0) as server:
        server.rename(0, "mug")
        code, said = server.end(number)
    assert code == 0
    assert f"{path}: unsaved changes made in the browser are lost" in said
    assert "Traceback" not in said
    assert path.read_bytes() == before


def test_a_client_that_stops_in_the_middle_of_an_upload_does_not_hold_up_the_end(tmp_path):
    with viewing(saved(tmp_path), "--port", 0) as server:
        address = urlsplit(server.url)
        with socket.create_connection((address.hostname, address.port), PATIENCE) as client:
            token = address.query.partition("=")[2]
            head = f"POST /api/edit HTTP/1.1\r\nHost: {address.netloc}\r\n"
            more = f"X-Hypermap-Token: {token}\r\nContent-Length: 500\r\n\r\n{{"
            client.sendall((head + more).encode())
            server.get("api/map")  # so the one before has come
            code, said = server.end(signal.SIGTERM)
    assert code == 0
    assert len(said.splitlines()) == 1, said  # how to stop it


def test_a_port_in_use_is_said_so_and_without_one_the_next_is_taken(tmp_path):
    path = saved(tmp_path)
    with viewing(path) as one, viewing(path) as other:
        ports = [urlsplit(server.url).port for server in (one, other)]
        assert ports[0] != ports[1]
        assert set(ports) <= set(range(8090, 8140))
        assert other.get("api/map")["name"] == "room.hmap"
        done = hypermap("view", path, "--no-browser", "--port", ports[0])
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert f"port {ports[0]} of 127.0.0.1 is in use; give another with --port" in line


def test_it_listens_where_it_is_reported_and_only_there(tmp_path):
    with a_port() as port, viewing(saved(tmp_path), "--port", port, "--read-only") as server:
        assert server.url.startswith(f"http://127.0.0.1:{port}/?token=")
        assert not server.get("api/map")["editable"]
        with pytest.raises(HTTPError, match="403"):
            server.rename(0, "mug")
        evil = Request(at(server.url, "api/map"), headers={"Host": "evil.example"})
        with pytest.raises(HTTPError, match="403"):
            urlopen(evil, timeout=PATIENCE)
        own = socket.gethostbyname_ex(socket.gethostname())[2]
        for address in (address for address in own if not address.startswith("127.")):
            with pytest.raises(OSError, match="refused"):
                socket.create_connection((address, port), timeout=PATIENCE)


def test_behind_a_web_server_the_address_is_that_of_visitors(tmp_path):
    url = "https://robot.example/maps"
    with a_port() as port:
        words = ["view", saved(tmp_path), "--no-browser", "--port", port, "--public-url", url]
        with Command(*words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            said = ""
            while "passes requests on" not in said:
                said += process.stdout.readline()
            process.send_signal(signal.SIGINT)
    assert re.match(rf"{url}/\?token=\S{{32}}\n", said)
    assert f"the web server there passes requests on to 127.0.0.1:{port}\n" in said


def test_whoever_lets_others_in_is_reported_so(tmp_path):
    with viewing(saved(tmp_path), "--port", 0, "--host", "0.0.0.0") as server:
        assert server.url.startswith("http://127.0.0.1:")
        _, said = server.end()
    whom = "everyone who can reach this machine and knows the token"
    assert f"{whom} can see and change the map" in said


def test_nobody_is_let_in_without_the_token_that_is_printed(tmp_path):
    with viewing(saved(tmp_path), "--port", 0) as server:
        base, _, query = server.url.partition("?")
        for path in ("", "page/app.js", "api/map", "api/events", "?token=", "?token=guessed"):
            with pytest.raises(HTTPError, match="403") as error:
                urlopen(base + path, timeout=PATIENCE)
            assert b"open it by the whole address that was printed" in error.value.read()
        with urlopen(base + "api/map?" + query, timeout=PATIENCE) as answer:
            cookie = answer.headers["Set-Cookie"]
        assert "; HttpOnly; SameSite=Strict" in cookie
        known = Request(base + "api/map", headers={"Cookie": cookie.partition(";")[0]})
        with urlopen(known, timeout=PATIENCE) as answer:
            assert json.load(answer)["name"] == "room.hmap"


def test_with_no_token_everyone_is_let_in(tmp_path):
    with viewing(saved(tmp_path), "--port", 0, "--no-token") as server:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", server.url)
        assert server.get("api/map")["name"] == "room.hmap"
        server.rename(0, "mug")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["no.hmap"], "no.hmap"),
        (["bad.hmap"], "bad.hmap"),
        (["room.hmap", "--host", "203.0.113.7"], "cannot listen on 203.0.113.7, port 8090"),
        (["room.hmap", "--port", "99999"], "65535"),
        (["room.hmap", "--public-url", "robot.example"], "must be the address of a web server"),
    ],
)
def test_what_cannot_be_shown_is_said_in_one_line(tmp_path, arguments, reason):
    saved(tmp_path)
    (tmp_path / "bad.hmap").write_bytes(b"no zip")
    done = hypermap("view", "--no-browser", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert reason in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["view", "room.hmap", "--no-browser", "--port", 0],
        ["demo", "--view", "--no-browser", "--port", 0],
    ],
)
def test_nothing_is_begun_where_the_page_is_missing(tmp_path, monkeypatch, arguments):
    page = shutil.ignore_patterns("page", "__pycache__")
    shutil.copytree(Path(hypermap_package.__file__).parent, tmp_path / "src/hypermap", ignore=page)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "src"))
    saved(tmp_path)
    words = [sys.executable, "-m", "hypermap", *map(str, arguments)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{tmp_path}/src/hypermap/viewer/page: the page is not built; build" in done.stderr


@pytest.mark.skipif(not is_page_built(), reason="the page is not built: make page")
def test_the_browser_is_opened_at_the_page(tmp_path):
    said, opened = said_and_opened(tmp_path, "view", saved(tmp_path), "--port", 0)
    assert opened.partition("=")[0] == said.partition("=")[0]
    assert opened != said  # other users see what programs are started with


def test_the_command_explains_itself():
    done = hypermap("view", "--help")
    assert done.returncode == 0
    assert "--read-only" in done.stdout
