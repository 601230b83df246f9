"""Notes on the page's server: added, changed, undone, saved; their files are inert."""

from __future__ import annotations

import asyncio
import io
from pathlib import Path

import pytest
from PIL import Image

from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map
from hypermap.notes import notes_layer
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument

from .live_tools import Window, files_in, saved, serving

LARGE = b"\0\0\0\x20ftypisom" + bytes(3_000_000)
SCRIPT = b"<svg xmlns='http://www.w3.org/2000/svg' onload='alert(1)'/>"


def picture() -> bytes:
    content = io.BytesIO()
    Image.new("RGB", (40, 30), "orange").save(content, "PNG")
    return content.getvalue()


def upload(window: Window, content: bytes, name: str, expected: int = 200) -> dict:
    answer = window.client.post(
        "/api/files", params={"name": name}, content=content, headers=window.headers
    )
    assert answer.status_code == expected, answer.text
    return answer.json()


def add_note(text: str = "Loose tile", **others: object) -> dict:
    return {"op": "add_note", "layer": "notes", "point": [3.0, 1.0], "text": text, **others}


def note_of(hypermap: Hypermap, number: int = 1):
    return notes_layer(hypermap)[number]


@pytest.fixture
def path(tmp_path) -> Path:
    return saved(tmp_path)


def test_a_note_is_added_with_a_file_and_saved(path):
    with serving(path) as client:
        window = Window(client)
        sent = upload(window, picture(), "tile.png")
        reply = window.edit(
            add_note(
                "**Loose** tile", author="Ada", files=[sent["sha256"]], links=["https://a.org"]
            )
        )
        assert reply["ids"] == [1]
        (note,) = window.get("/api/notes")
        assert note["html"] == "<p><strong>Loose</strong> tile</p>\n"
        assert (note["at"], note["author"], note["polygons"]) == ([3.0, 1.0], "Ada", [])
        (file,) = note["files"]
        assert (file["kind"], file["name"]) == ("picture", "tile.png")
        layer = next(one for one in window.get("/api/map")["layers"] if one["name"] == "notes")
        assert (layer["kind"], layer["count"], layer["editable"]) == ("notes", 1, False)
        window.post("/api/save")
    kept = note_of(open_map(path))
    assert kept.attachments[0].content == picture()
    assert kept.links == ("https://a.org",)


def test_notes_are_in_the_base_frame_and_kept_in_that_of_their_layer(path):
    with serving(path) as client:
        window = Window(client)
        window.edit(add_note(point=None, polygon=[[0, 0], [2, 0], [2, 2], [0, 2]]))
        (note,) = window.get("/api/notes")
        assert sorted(note["polygons"][0][0][:4]) == [[0, 0], [0, 2], [2, 0], [2, 2]]
        assert window.get("/api/at", x=1, y=1)["layers"][-1]["label"] == "Loose tile"


def test_notes_are_changed_removed_undone_and_redone_to_the_second(path):
    with serving(path) as client:
        window = Window(client)
        sent = upload(window, picture(), "tile.png")
        window.edit(add_note(files=[sent["sha256"]]))
        window.edit({"op": "update_note", "layer": "notes", "id": 1, "text": "fixed", "files": []})
        window.edit({"op": "remove_note", "layer": "notes", "id": 1})
        states = []
        for _ in range(3):
            states.append(window.get("/api/notes"))
            window.go("/api/undo")
        texts = [[note["text"] for note in notes] for notes in states]
        assert texts == [[], ["fixed"], ["Loose tile"]]
        assert [len(notes[0]["files"]) for notes in states[1:]] == [0, 1]
        assert "notes" not in [layer["name"] for layer in window.get("/api/map")["layers"]]
        for state in reversed(states):
            window.go("/api/redo")
            assert window.get("/api/notes") == state


def test_a_window_does_not_overwrite_the_note_of_another(path):
    with serving(path) as client:
        first, second = Window(client), Window(client)
        first.edit(add_note())
        second.version = first.version
        first.edit({"op": "update_note", "layer": "notes", "id": 1, "text": "mine"})
        change = {"op": "update_note", "layer": "notes", "id": 1, "text": "yours"}
        assert second.edit(change, expected=409)["reason"] == "behind"


@pytest.mark.parametrize(
    ("content", "name", "media_type", "how"),
    [
        (picture(), "a.txt", "image/png", "inline"),
        (SCRIPT, "a.svg", "application/octet-stream", "attachment"),
        (b"<!doctype html><script>1</script>", "a.html", "application/octet-stream", "attachment"),
        (b"%PDF-1.7 x", "a.pdf", "application/pdf", "attachment"),
        (LARGE, "a.mp4", "video/mp4", "inline"),
    ],
)
def test_a_file_is_shown_only_if_nothing_can_run_in_it(path, content, name, media_type, how):
    with serving(path) as client:
        window = Window(client)
        sent = upload(window, content, name)
        window.edit(add_note(files=[sent["sha256"]]))
        (file,) = window.get("/api/notes")[0]["files"]
        answer = client.get(file["url"])
        assert answer.content == content
        assert answer.headers["content-type"] == media_type
        assert answer.headers["content-disposition"].startswith(f"{how}; filename*=UTF-8''a.")
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["content-security-policy"] == "sandbox; default-src 'none'"
        assert answer.headers["cross-origin-resource-policy"] == "same-origin"
        assert client.get("/api/map").headers["content-security-policy"].startswith("default-src")


def test_a_large_file_goes_next_to_the_map_at_once_and_parts_of_it_are_sent(path):
    folder = path.with_name("room.hmap.media")
    folder.mkdir()
    (folder / f".hypermap-{'0' * 16}.part").write_bytes(b"of an upload that was killed")
    with serving(path) as client:
        window = Window(client)
        sent = upload(window, LARGE, "tour.mp4")
        assert files_in(folder) == [sent["sha256"]]
        window.edit(add_note(files=[sent["sha256"]]))
        (file,) = window.get("/api/notes")[0]["files"]
        part = client.get(file["url"], headers={"Range": "bytes=4-7"})
        assert (part.status_code, part.content) == (206, b"ftyp")
        window.post("/api/save")
    with note_of(open_map(path)).attachments[0].open() as opened:
        assert opened.read() == LARGE
    assert files_in(folder) == [sent["sha256"]]


@pytest.mark.parametrize(
    ("content", "name", "said"),
    [
        (b"<html>", "fake.png", "its content is HTML"),
        (picture()[:50], "half.png", "the picture is damaged"),
        (b"", "none", "is empty"),
        (b"x" * 3_000_000, "fake.mp4", "its name says that it is a video"),
    ],
)
def test_a_file_that_is_not_what_it_says_is_refused_and_leaves_nothing(path, content, name, said):
    with serving(path) as client:
        assert said in upload(Window(client), content, name, 400)["error"]
    assert not path.with_name("room.hmap.media").exists() or not files_in(
        path.with_name("room.hmap.media")
    )


@pytest.mark.parametrize(
    ("operation", "expected", "said"),
    [
        (add_note("x" * 1_000_001), 400, "attach it as a file"),
        (add_note(""), 400, "needs a text"),
        (add_note(point=None), 400, "needs a point"),
        (add_note(point=[1, "x"]), 400, "point: a number"),
        (add_note(point=[1]), 400, "expected [x, y]"),
        (add_note(text=7), 400, "text: a text is expected"),
        (add_note(links=["javascript:alert(1)"]), 400, "begins with http"),
        (add_note(links="https://a.org"), 400, "a list of texts"),
        (add_note(files=["0" * 64]), 400, "was not uploaded"),
        (add_note(layer="things"), 400, "is of the kind SemanticLayer"),
        ({"op": "update_note", "layer": "things", "id": 1, "text": "x"}, 400, "SemanticLayer"),
        ({"op": "remove_note", "layer": "notes", "id": 1}, 404, "there is no layer 'notes'"),
    ],
)
def test_wrong_notes_are_refused_and_nothing_changes(path, operation, expected, said):
    with serving(path) as client:
        window = Window(client)
        assert said in window.edit(operation, expected=expected)["error"]
        assert window.get("/api/map")["version"] == window.version


def test_a_read_only_map_takes_no_files_and_no_notes(path):
    with serving(path, is_editable=False) as client:
        window = Window(client)
        assert "read-only" in upload(window, b"x", "a.txt", 403)["error"]
        assert "read-only" in window.edit(add_note(), expected=403)["error"]
    assert not path.with_name("room.hmap.media").exists()


@pytest.mark.parametrize("way", ["/api/files", "/api/edit"])
def test_a_client_that_breaks_off_leaves_nothing_and_no_error(path, way):
    app = MapApp(MapDocument(path))
    known = [(b"host", b"127.0.0.1"), (b"x-hypermap-token", app.token.encode())]
    scope = {"type": "http", "method": "POST", "path": way, "headers": known, "query_string": b""}
    messages = [
        {"type": "http.request", "body": LARGE, "more_body": True},
        {"type": "http.disconnect"},
    ]
    folder, seen = path.with_name("room.hmap.media"), []

    async def receive() -> dict:
        seen.append(files_in(folder) if folder.exists() else [])
        return messages.pop(0)

    async def send(_: object) -> None:
        pass

    asyncio.run(app.app(scope, receive, send))
    assert messages == []
    assert [len(files) for files in seen] == [0, 1 if way == "/api/files" else 0]
    assert not folder.exists() or files_in(folder) == []


def test_other_sites_can_upload_nothing(path):
    with serving(path) as client:
        answer = client.post("/api/files", params={"name": "a"}, content=b"x")
        assert answer.status_code == 403


def test_a_file_of_no_note_is_not_given_away(path):
    with serving(path) as client:
        window = Window(client)
        sent = upload(window, b"secret", "a.txt")
        window.edit(add_note())
        for address in (f"notes/1/{sent['sha256']}", "notes/1/..%2f..%2froom.hmap", "notes/2/x"):
            assert client.get(f"/api/notes/{address}").status_code in (400, 404)
