"""The map as it was, asked as the page asks it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from hypermap.core.value_layer import ValueLayer
from hypermap.formats import save_map
from hypermap.values import FieldSettings, Samples, value_layer_of

from ..cli.conftest import Result
from ..cli.conftest import hypermap as hypermap
from .live_tools import Window, saved, serving
from .past_map import CHAIR_AFTER, CHAIR_BEFORE, PLANT, TUESDAY, past_map, saved_past_map
from .small_map import CHAIR, CUP, DESK, EVIL, EVIL_ID
from .test_live_questions import all_said, answers_of, lines_of

BOX = {"bbox": "-1e6,-1e6,1e6,1e6", "resolution": 0.01}
AROUND_CHAIR = [[6.0, 4.0], [8.0, 4.0], [8.0, 6.0], [6.0, 6.0]]


def names(window: Window, **values: object) -> dict[int, str]:
    shapes = window.get("/api/shapes/semantic", **BOX, **values)["features"]
    return {shape["id"]: shape["name"] for shape in shapes}


def test_the_timeline_says_when_what_changed_and_by_what(tmp_path: Path) -> None:
    with serving(saved_past_map(tmp_path)) as client:
        window = Window(client)
        told = window.get("/api/timeline")
        moved, gone, added = window.get("/api/timeline/2")["changes"]
        window.get("/api/timeline/9", expected=404)
    rows = [(one["version"], one["cause"], one["drive"]) for one in told["versions"]]
    assert rows == [
        (1, "mapping", "monday"),
        (2, "mapping", "tuesday"),
        (3, "edit", ""),
        (4, "edit", ""),
    ]
    assert told["versions"][1]["time"] == TUESDAY
    assert told["versions"][1]["changes"] == {"moved": 1, "gone": 1, "added": 1}
    assert set(told["colors"]) >= {"moved", "gone", "added", "renamed", "edited"}
    assert (moved["kind"], moved["id"]) == ("moved", CHAIR)
    assert moved["before"]["at"] == pytest.approx(CHAIR_BEFORE)
    assert moved["after"]["at"] == pytest.approx(CHAIR_AFTER)
    assert moved["distance"] == pytest.approx(2.5)
    assert (gone["id"], gone["before"]["name"], gone["after"]) == (CUP, "cup", None)
    assert (added["id"], added["before"], added["after"]["name"]) == (PLANT, None, "plant")


def test_doubtful_changes_are_counted_and_not_listed_as_the_command_line_does(
    tmp_path: Path, hypermap: Callable[..., Result]
) -> None:
    room = past_map()
    assert room.history is not None
    first, tuesday, *later = room.history.revisions()
    moved, gone, added = tuesday.changes
    unsure = dataclasses.replace(gone, confidence=0.3)
    first = dataclasses.replace(
        first, changes=tuple(dataclasses.replace(one, confidence=0.3) for one in first.changes)
    )
    revisions = (first, dataclasses.replace(tuesday, changes=(moved, unsure, added)), *later)
    room.history = dataclasses.replace(room.history, earlier=None, added=revisions)
    save_map(room, path := tmp_path / "room.hmap")
    with serving(path) as client:
        window = Window(client)
        told = window.get("/api/timeline")["versions"]
        listed = window.get("/api/timeline/2")
        begun = window.get("/api/timeline/1")
    assert told[0]["changes"] == {"added": len(first.changes)}  # what a map begins with is shown
    assert (begun["total"], begun["doubtful"]) == (len(first.changes), 0)
    assert told[1]["changes"] == {"moved": 1, "added": 1, "doubtful": 1}
    assert [change["kind"] for change in listed["changes"]] == ["moved", "added"]
    assert (listed["total"], listed["doubtful"]) == (2, 1)
    said = hypermap("changes", path, "--since", "v1")
    assert "1 doubtful change left out" in said.err
    assert " gone " not in said.out


def test_a_map_without_history_has_no_past(tmp_path: Path) -> None:
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        assert window.get("/api/timeline")["versions"] == []
        refused = window.get("/api/map", expected=400, as_of=1)
    assert "keeps no history" in refused["error"]


def test_measured_values_are_shown_as_they_were_if_samples_say_when(tmp_path: Path) -> None:
    """On Wednesday it was measured in two more places."""
    hypermap = past_map()
    places = [[1, 1], [2, 1], [8, 6], [9, 6]]
    stamps = [TUESDAY - 9, TUESDAY - 8, TUESDAY + 86_400, TUESDAY + 86_401]
    samples = Samples.of(places, [18, 18, 30, 30], stamps=stamps)
    settings = FieldSettings(length=1.0, deviation=2.0, noise=0.1)
    dated = value_layer_of("warmth", samples, frame_id="map", settings=settings)
    undated = ValueLayer("wifi", "map", dated.grid, dated.cells)
    save_map(hypermap.with_layers([*hypermap, dated, undated]), tmp_path / "room.hmap")
    with serving(tmp_path / "room.hmap") as client:
        window = Window(client)
        layers = {one["name"]: one for one in window.get("/api/map", as_of=2)["layers"]}
        assert {name for name, one in layers.items() if one["as_it_was"]} == {"semantic", "warmth"}
        assert layers["warmth"]["version"] == 2
        now, then = (
            {
                name: client.get(f"/api/tiles/{name}/2/0/0.png", params={"v": 2, **asked}).content
                for name in ("warmth", "wifi")
            }
            for asked in ({}, {"as_of": 2})
        )
        assert now["wifi"] == then["wifi"]
        assert now["warmth"] != then["warmth"]
        grids = [window.get("/api/values/warmth", **asked) for asked in ({}, {"as_of": 2})]
    assert grids[0] != grids[1]


def test_every_question_is_answered_as_of_the_version(tmp_path: Path) -> None:
    x, y = CHAIR_BEFORE
    with serving(saved_past_map(tmp_path)) as client:
        window = Window(client)
        past = {"as_of": 1}
        assert names(window, **past) == {0: "desk", CHAIR: "chair", CUP: "cup", EVIL_ID: EVIL}
        assert names(window) == {0: "table", CHAIR: "chair", EVIL_ID: EVIL, PLANT: "plant"}
        info = window.get("/api/map", **past)
        assert not info["editable"]
        classes = {one["name"] for one in info["layers"][1]["classes"]}
        assert classes == {"desk", "chair", "cup", EVIL}
        at = window.get("/api/at", x=x, y=y, **past)
        found = window.get("/api/find", name="cup", near="1,1", **past)
        details = window.get(f"/api/objects/semantic/{DESK}", **past)
        asked = window.get("/api/ask", question="where is the cup?", **past)
        area = client.post(
            "/api/area",
            params=past,
            json={"polygon": AROUND_CHAIR},
            headers=window.headers,
        ).json()
        evidence = window.get(f"/api/objects/semantic/{CUP}/evidence", **past)
        assert window.get("/api/at", x=x, y=y)["layers"][1]["label"] == "Empty"
    assert at["layers"][1]["label"] == "chair"
    assert [row["id"] for row in found["rows"]] == [CUP]
    assert details["name"] == "desk"
    assert [row["id"] for row in asked["rows"]] == [CUP]
    assert [row["id"] for row in area["rows"]] == [CHAIR]
    assert evidence["name"] == "cup"

    shown = [(layer["name"], *said) for layer in at["layers"] for said in all_said(layer)]
    answers = answers_of(at["command"])
    assert [(row["layer"], row["label"], row["value"]) for row in answers] == shown
    assert lines_of(at["python"]) == [f"{layer} {label}" for layer, label, _ in shown]
    assert lines_of(found["python"])[0].startswith(f"semantic {CUP} ")
    assert [row["value"] for row in answers_of(found["command"])] == [CUP]
    assert lines_of(asked["python"]) == [f"1 [{CUP}]"]
    assert "command" not in asked  # none asks how the map was


def test_what_is_not_saved_yet_does_not_reach_into_the_past(tmp_path: Path) -> None:
    with serving(saved_past_map(tmp_path)) as client:
        window = Window(client)
        before = names(window, as_of=2)
        window.edit({"op": "remove", "layer": "semantic", "id": PLANT})
        assert PLANT not in names(window)
        assert names(window, as_of=2) == before


@pytest.mark.parametrize("version", ["9", "x", "-1", ""])
def test_an_unknown_version_is_refused(tmp_path: Path, version: str) -> None:
    with serving(saved_past_map(tmp_path)) as client:
        answer = client.get("/api/map", params={"as_of": version})
    assert answer.status_code == 400
