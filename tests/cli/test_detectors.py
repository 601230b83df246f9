"""Networks by name: their list, and their download from a server that does not always behave."""

from __future__ import annotations

import hashlib
import http.server
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from hypermap.formats import open_map
from hypermap.perception.detectors import catalog

from .conftest import INTRINSICS, assert_one_error, write_drive

NAME = "yolox-nano"


@dataclass
class Server:
    """An HTTP server with one file, and what it is to do with the next requests."""

    content: bytes
    url: str = ""
    breaks_off_after: list[int] = field(default_factory=list)  # bytes, of one answer after another
    status: int = 200
    knows_ranges: bool = True
    tells_length: bool = True
    other_length: str = ""
    asked_from: list[int] = field(default_factory=list)

    def answer(self, request: http.server.BaseHTTPRequestHandler) -> None:
        asked = request.headers.get("Range", "bytes=0-")
        start = int(asked.removeprefix("bytes=").removesuffix("-"))
        self.asked_from.append(start)
        if self.status != 200:
            request.send_error(self.status)
            return
        if self.knows_ranges and start >= len(self.content):
            request.send_error(416)
            return
        is_part = self.knows_ranges and start > 0
        rest = self.content[start:] if is_part else self.content
        request.send_response(206 if is_part else 200)
        if is_part:
            last, whole = len(self.content) - 1, len(self.content)
            request.send_header("Content-Range", f"bytes {start}-{last}/{whole}")
        if self.tells_length:
            request.send_header("Content-Length", self.other_length or str(len(rest)))
        request.end_headers()
        if self.breaks_off_after:
            rest = rest[: self.breaks_off_after.pop(0)]
        request.wfile.write(rest)


@pytest.fixture
def server() -> Iterator[Server]:
    """A server on this machine that sends 300 kB, which the catalog takes for the network."""
    files = Server(bytes(range(256)) * 1200)

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            files.answer(self)

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as listening:
        thread = threading.Thread(target=listening.serve_forever, args=(0.01,))
        thread.start()
        files.url = f"http://127.0.0.1:{listening.server_port}/models/network.onnx"
        yield files
        listening.shutdown()
        thread.join()


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("HYPERMAP_DETECTOR_URL", raising=False)
    for proxy in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(proxy, raising=False)
    return tmp_path / "cache" / "hypermap" / "detectors"


@pytest.fixture
def offered(server: Server, monkeypatch: pytest.MonkeyPatch) -> Callable[[bytes], Path]:
    """Let the catalog name the server's file as the network; return where it will lie."""

    def offer(content: bytes) -> Path:
        server.content = content
        known = replace(
            catalog.NETWORKS[0],
            url=server.url,
            sha256=hashlib.sha256(content).hexdigest(),
            size=len(content),
        )
        monkeypatch.setattr(catalog, "NETWORKS", (known,))
        return known.path

    return offer


@pytest.fixture
def path(offered: Callable[[bytes], Path], server: Server) -> Path:
    return offered(server.content)


def test_the_list_says_what_one_needs_to_choose(hypermap):
    text = hypermap("detectors").out
    for words in (NAME, "3.7 MB", "Apache-2.0", "80 of COCO", "Megvii", "sha256  c789161e"):
        assert words in text
    assert "https://github.com/Megvii-BaseDetection/YOLOX/releases/" in text
    (first, *_) = hypermap("detectors", "--json").json
    assert (first["name"], first["is_here"]) == (NAME, False)


def test_each_network_of_the_list_can_be_distinguished_from_others_and_checked():
    names = [network.name for network in catalog.NETWORKS]
    assert len(set(names)) == len(names)
    assert len({network.path for network in catalog.NETWORKS}) == len(names)
    for network in catalog.NETWORKS:
        assert len(bytes.fromhex(network.sha256)) == 32
        assert network.url.startswith("https://")
        assert network.path.suffix == ".onnx"


def test_a_network_is_downloaded_once(hypermap, server, path):
    result = hypermap("detectors", "get", NAME)
    assert result.code == 0
    assert f"with the right SHA-256: {path}" in result.err
    assert path.read_bytes() == server.content
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    assert hypermap("detectors", "get", NAME).code == 0
    assert server.asked_from == [0]
    assert "downloaded; " in hypermap("detectors").out


@pytest.mark.parametrize("knows_ranges", [True, False])
def test_a_broken_connection_is_taken_up_again(hypermap, server, path, knows_ranges):
    server.breaks_off_after, server.knows_ranges = [100_000, 120_000], knows_ranges
    assert hypermap("detectors", "get", NAME).code == 0
    assert path.read_bytes() == server.content
    assert server.asked_from[:2] == [0, 100_000]


def test_what_a_server_that_gives_up_has_sent_is_kept_for_the_next_time(hypermap, server, path):
    server.breaks_off_after = [100_000, 0, 0, 0]
    result = hypermap("detectors", "get", NAME)
    assert result.code == 2
    assert "the connection was interrupted" in result.err
    assert "100000 of 307200 bytes are kept: run the same command to continue" in result.err
    assert not path.exists()
    assert hypermap("detectors", "get", NAME).code == 0
    assert server.asked_from[-1] == 100_000
    assert path.read_bytes() == server.content


def test_a_part_of_another_file_is_found_out(hypermap, server, path):
    path.parent.mkdir(parents=True)
    path.with_name(f"{path.name}.part").write_bytes(b"something else" * 1000)
    assert hypermap("detectors", "get", NAME).code == 0
    assert path.read_bytes() == server.content


@pytest.mark.parametrize(
    "sent", [b"<html>Log in first</html>", b"\0" * 307_200, b"\0" * 400_000, b""]
)
@pytest.mark.parametrize("tells_length", [True, False])
def test_another_file_is_refused_and_not_kept(hypermap, server, path, sent, tells_length):
    server.content, server.tells_length = sent, tells_length
    result = hypermap("detectors", "get", NAME)
    assert result.code == 2
    assert server.url in result.err
    assert not path.exists()
    if sent:
        assert f"this is not {NAME}" in result.err
        assert hashlib.sha256(b"\0" * 307_200).hexdigest() in result.err or len(sent) != 307_200


@pytest.mark.parametrize("length", ["\u00b2", "1" * 5000])
def test_a_length_that_is_no_number_is_not_believed(hypermap, server, path, length):
    server.other_length = length
    assert hypermap("detectors", "get", NAME).code == 0
    assert path.read_bytes() == server.content


def test_a_file_that_is_not_there_is_reported_with_other_ways_to_get_it(hypermap, server, path):
    server.status = 404
    result = hypermap("detectors", "get", NAME)
    assert result.code == 2
    assert f"{server.url}: the server answers 404" in result.err
    assert "--url" in result.err
    assert "--detector FILE" in result.err
    assert len(server.asked_from) == 1


def test_a_server_that_cannot_be_reached_is_reported(hypermap, path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    result = hypermap("detectors", "get", NAME, "--url", f"http://127.0.0.1:{port}/x.onnx")
    assert result.code == 2
    assert "cannot be reached" in result.err


def test_a_damaged_download_is_reported_and_replaced(hypermap, server, path):
    path.parent.mkdir(parents=True)
    path.write_bytes(b"cut off")
    drive = write_drive(path.parent / "drive", frames=2)
    used = hypermap("map", drive, "--detector", NAME, "-o", path.parent / "out.hmap")
    assert_one_error(used, str(path), f"hypermap detectors get {NAME}")
    assert hypermap("detectors", "get", NAME).code == 0
    assert path.read_bytes() == server.content


def test_a_mirror_may_be_named(hypermap, server, path, monkeypatch):
    mirror = server.url.replace("models", "mirror")
    monkeypatch.setattr(
        catalog,
        "NETWORKS",
        (replace(catalog.NETWORKS[0], url="https://nowhere.invalid/network.onnx"),),
    )
    monkeypatch.setenv("HYPERMAP_DETECTOR_URL", mirror)
    assert hypermap("detectors", "get", NAME).code == 0
    assert path.read_bytes() == server.content


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["get"], "which one?"),
        (["get", "yolox-nno"], f"did you mean {NAME!r}?"),
        (["list", NAME], "belongs to `hypermap detectors get NAME`"),
        (["fetch", NAME], "fetch"),
    ],
)
def test_a_wrong_call_is_said_so(hypermap, arguments, words):
    result = hypermap("detectors", *arguments)
    assert result.code == 2
    assert words in result.err


@pytest.mark.parametrize("url", ["file:///etc/passwd", "ftp://mirror/x.onnx", "x.onnx", ""])
def test_only_web_addresses_are_downloaded_from(hypermap, path, url):
    result = hypermap("detectors", "get", NAME, "--url", url)
    if url:
        assert result.code == 2
        assert f"{url}: expected an address that begins with http:// or https://" in result.err
    else:  # an empty variable of the environment counts as none
        assert result.code == 0


def test_a_folder_that_cannot_be_written_is_reported(hypermap, path, cache):
    cache.parent.parent.mkdir(parents=True)
    cache.parent.write_text("a file in the place of a folder")
    result = hypermap("detectors", "get", NAME)
    assert result.code == 2
    assert "XDG_CACHE_HOME" in result.err


def test_a_network_that_was_not_downloaded_is_reported_how_to_get_it(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2)
    result = hypermap("map", drive, "--detector", NAME, "-o", tmp_path / "out.hmap")
    assert_one_error(result, "not downloaded yet", f"hypermap detectors get {NAME}", "3.7 MB")
    result = hypermap("map", drive, "--detector", "yolox.onnx", "-o", tmp_path / "out.hmap")
    assert_one_error(result, "yolox.onnx: there is no such model", "hypermap detectors")


def test_a_downloaded_network_maps_by_its_name(hypermap, offered, unsure_network, tmp_path):
    offered(unsure_network.read_bytes())
    assert hypermap("detectors", "get", NAME).code == 0
    drive, out = write_drive(tmp_path / "drive", frames=6), tmp_path / "out.hmap"
    arguments = ["--detector", NAME, "--score", "0.1", "--intrinsics", INTRINSICS, "-o", out]
    config = tmp_path / "config.yaml"
    config.write_text("evidence: {publish_above: 0}\n")
    assert hypermap("map", drive, *arguments, "--config", config).code == 0
    assert [found.name for found in open_map(out)["semantic"].objects()] == ["chair"]


def test_the_real_network_finds_what_is_on_a_real_desk(hypermap, offered, shared_data, tmp_path):
    offered((shared_data / "models" / "yolox_nano.onnx").read_bytes())
    assert hypermap("detectors", "get", NAME).code == 0
    out = tmp_path / "desk.hmap"
    arguments = ["--detector", NAME, "--every", "8", "-o", out]
    assert hypermap("map", shared_data / "desk", *arguments).code == 0
    assert {"tv", "keyboard"} <= {found.name for found in open_map(out)["semantic"].objects()}
