from __future__ import annotations

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from hypermap.core.occupancy import OccupancyLayer
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument
from hypermap.viewer.live.guard import TOKEN_HEADER, Guard
from hypermap.viewer.live.requests import MOST_BYTES
from hypermap.web.hosts import known_hosts

from .live_tools import Window, saved, serving

TOKEN = "the-pages"


COOKIE = {"Cookie": f"other=1; hypermap-8090={TOKEN}"}


def answer_of(
    method: str,
    path: str,
    headers: dict[str, str],
    host: str = "127.0.0.1",
    is_private: bool = False,
) -> int:
    """Return the status of a guarded server's answer."""
    route = Route("/{rest:path}", lambda _: PlainTextResponse("let in"), methods=["GET", "POST"])
    guard = Guard(Starlette(routes=[route]), known_hosts(host), TOKEN, is_private)
    client = TestClient(guard, base_url="http://127.0.0.1:8090")
    answer = client.request(method, path, headers=headers)
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert (answer.text == "let in") == (answer.status_code == 200)
    return answer.status_code


@pytest.mark.parametrize(
    ("host", "listening_on", "status"),
    [
        ("127.0.0.1:8090", "127.0.0.1", 200),
        ("localhost:9999", "127.0.0.1", 200),  # as through an SSH tunnel
        ("LOCALHOST", "127.0.0.1", 200),
        ("[::1]:8090", "::1", 200),
        ("evil.example:8090", "127.0.0.1", 403),
        ("127.0.0.1.evil.example", "127.0.0.1", 403),
        ("192.168.1.5:8090", "127.0.0.1", 403),
        ("", "127.0.0.1", 403),
        ("[::", "127.0.0.1", 403),
        ("192.168.1.5:8090", "192.168.1.5", 200),
        ("192.168.1.5:8090", "0.0.0.0", 200),
        ("evil.example:8090", "0.0.0.0", 403),
        ("robot.local:8090", "robot.local", 200),
    ],
)
def test_only_requests_to_this_machine_are_let_in(host, listening_on, status):
    assert answer_of("GET", "/api/map", {"Host": host}, listening_on) == status


def test_a_web_server_in_front_is_known_by_its_public_name():
    hosts = known_hosts("127.0.0.1", "https://Robot.example/maps")
    route = Route("/", lambda _: PlainTextResponse("let in"), methods=["GET", "POST"])
    client = TestClient(Guard(Starlette(routes=[route]), hosts, TOKEN))
    own = {"Host": "robot.example", "Origin": "https://robot.example", TOKEN_HEADER: TOKEN}
    assert client.post("/", headers=own).status_code == 200
    assert client.post("/", headers={**own, "Origin": "https://evil.example"}).status_code == 403
    assert client.get("/", headers={**own, "Host": "evil.example"}).status_code == 403


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/api/map", {}, 200),
        ("GET", "/api/map", {"Origin": "http://127.0.0.1:8090"}, 200),
        ("GET", "/api/map", {"Origin": "http://evil.example"}, 403),
        ("GET", "/api/map", {"Origin": "null"}, 403),
        ("GET", "/api/map", {"Origin": "http://["}, 403),
        ("GET", "/api/map", {"Sec-Fetch-Site": "same-origin"}, 200),
        ("GET", "/api/tiles/a/0/0/0.png", {"Sec-Fetch-Site": "cross-site"}, 403),
        ("GET", "/api/map", {"Sec-Fetch-Site": "same-site"}, 403),
        ("GET", "/", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}, 200),
        ("GET", "/", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}, 403),
        ("GET", "/api/map", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}, 403),
        ("POST", "/api/save", {}, 403),
        ("POST", "/api/save", {TOKEN_HEADER: "another"}, 403),
        ("POST", "/api/save", {TOKEN_HEADER: TOKEN}, 200),
        ("POST", "/api/save", {TOKEN_HEADER: TOKEN, "Origin": "http://evil.example"}, 403),
        ("POST", "/api/save", {TOKEN_HEADER: TOKEN, "Origin": "http://127.0.0.1:1"}, 403),
        ("POST", "/api/save", {TOKEN_HEADER: TOKEN, "Sec-Fetch-Site": "cross-site"}, 403),
    ],
)
def test_other_sites_are_refused(method, path, headers, status):
    assert answer_of(method, path, headers) == status


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/", {}, 403),
        ("GET", "/page/app.js", {}, 403),
        ("GET", "/api/map", {}, 403),
        ("GET", "/api/map?token=", {}, 403),
        ("GET", "/api/map?token=another", {}, 403),
        ("GET", f"/?token={TOKEN}", {}, 200),
        ("GET", f"/api/map?token={TOKEN}", {}, 200),
        ("GET", f"/?token={TOKEN}", {"Host": "evil.example"}, 403),
        ("GET", "/api/map", {TOKEN_HEADER: TOKEN}, 200),
        ("GET", "/api/map", COOKIE, 200),
        ("GET", "/api/map", {**COOKIE, "Host": "127.0.0.1:9999"}, 403),  # another server's
        ("GET", "/api/map", {"Cookie": "hypermap-8090=another"}, 403),
        ("GET", "/api/map", {**COOKIE, "Origin": "http://evil.example"}, 403),
        ("POST", "/api/save", COOKIE, 403),  # as a form of a page on another port could send
        ("POST", f"/api/save?token={TOKEN}", {}, 403),
        ("POST", "/api/save", {**COOKIE, TOKEN_HEADER: TOKEN}, 200),
    ],
)
def test_of_a_private_server_the_token_must_be_known(method, path, headers, status):
    assert answer_of(method, path, headers, is_private=True) == status


def test_a_browser_is_let_in_by_a_token_that_opens_the_page_once():
    route = Route("/{rest:path}", lambda _: PlainTextResponse("let in"))
    guard = Guard(Starlette(routes=[route]), known_hosts("127.0.0.1"), TOKEN, once={"once"})
    ours, theirs = (TestClient(guard, base_url="http://127.0.0.1:8090") for _ in range(2))
    elsewhere = {"Host": "evil.example"}
    assert theirs.get("/api/map", params={"token": "once"}).status_code == 403
    assert theirs.get("/", params={"token": "once"}, headers=elsewhere).status_code == 403
    assert ours.get("/", params={"token": "once"}).status_code == 200
    assert theirs.get("/", params={"token": "once"}).status_code == 403
    assert ours.get("/", params={"token": "once"}).status_code == 200  # loaded again
    assert ours.get("/api/map").status_code == 200


def test_the_real_server_is_guarded(tmp_path):
    with serving(saved(tmp_path)) as client:
        info = client.get("/api/map")
        assert "access-control-allow-origin" not in info.headers
        assert info.headers["cross-origin-resource-policy"] == "same-origin"
        assert "'unsafe-inline'" not in info.headers["content-security-policy"]
        for route in ("area", "edit", "undo", "redo", "save", "reload"):
            answer = client.post(f"/api/{route}", json={})
            assert answer.status_code == 403
            assert "reload the page" in answer.json()["error"]
            assert client.get(f"/api/{route}").status_code == 405
        assert client.get("/api/map", headers={"Host": "evil.example"}).status_code == 403


@pytest.mark.parametrize(
    ("content", "status", "reason"),
    [
        (b"{", 400, "not valid JSON"),
        (b"[" * 100_000, 400, "not valid JSON"),
        (b"[]", 400, "must be a JSON object"),
        (b"\xff\xfe", 400, "not valid JSON"),
        (b"{}", 400, "version: a whole number is expected, got None"),
        (b'{"version": 1}', 400, "operations: a list with at least one operation"),
        (b'{"version": 1, "operations": [1]}', 400, "each must be an object"),
        (b'{"version": 1, "operations": [{"op": "add"}]}', 409, "the map has been reloaded"),
        (b'{"version": 1, "operations": [' + b"{}," * 600 + b"{}]}", 400, "601 operations"),
        (b'{"a": "' + b"x" * MOST_BYTES + b'"}', 413, "larger than 8 MB"),
    ],
)
def test_a_body_that_is_no_request_is_refused(tmp_path, content, status, reason):
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        answer = client.post("/api/edit", content=content, headers=window.headers)
        assert (answer.status_code, reason in answer.json()["error"]) == (status, True)


@pytest.mark.parametrize("seen", ["1" * 5000, "\u00b2", "-1", "x"])
def test_a_window_that_has_seen_no_version_there_is_hears_the_news(tmp_path, seen):
    app = MapApp(MapDocument(saved(tmp_path)), is_private=False)
    app.is_closing = True  # the news have an end
    client = TestClient(app.app, base_url="http://127.0.0.1")
    answer = client.get("/api/events", headers={"Last-Event-ID": seen.encode()})
    assert answer.status_code == 200
    assert answer.headers["Content-Type"].startswith("text/event-stream")


def test_a_plug_in_that_does_not_work_is_named_to_the_page(tmp_path, monkeypatch):
    path = saved(tmp_path)
    monkeypatch.setattr(OccupancyLayer, "label_at", lambda *_: 1 / 0)
    with TestClient(
        MapApp(MapDocument(path), is_private=False).app,
        "http://127.0.0.1",
        raise_server_exceptions=False,
    ) as client:
        answer = client.get("/api/at?x=0&y=0")
        assert answer.status_code == 500
        assert "division by zero" in answer.json()["error"]
        assert client.get("/api/map").status_code == 200


@pytest.mark.parametrize(
    "path",
    ["/page/../app.py", "/page/%2e%2e%2fdocument.py", "/page/secret", "/etc/passwd", "/api/x"],
)
def test_no_other_file_is_served(tmp_path, path):
    with serving(saved(tmp_path)) as client:
        answer = client.get(path)
        assert answer.status_code == 404
        assert answer.json()["error"]
