"""`hypermap changes`, `history`, `expire` and `query --as-of`: a map over time."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import time
import zipfile
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import pytest
import shapely

from hypermap import (
    FrameTree,
    Hypermap,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    Transform,
    open_map,
    save_map,
)
from hypermap.core.history import ADDED, GONE, Change, Revision
from hypermap.formats import locks
from hypermap.formats.locks import turn_to_edit
from hypermap.history import begin_history

from .conftest import Result, assert_one_error

Run = Callable[..., Result]


@pytest.fixture
def office(tmp_path: Path) -> Path:
    """Return a map of which, after its first version, the chair was moved and the sofa removed."""
    things = [
        SemanticObject(name, shapely.box(x, 0, x + 1, 1))
        for x, name in enumerate(("chair", "sofa", "table"))
    ]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    assert begin_history(hypermap)
    layer = hypermap.semantic()
    layer.rename(2, "desk")
    save_map(hypermap, tmp_path / "office.hmap")
    layer.update(0, SemanticObject("chair", shapely.box(0, 3, 1, 4)))
    layer.remove(1)
    save_map(hypermap, tmp_path / "office.hmap")
    return tmp_path / "office.hmap"


def test_changes_tells_what_changed_since_a_time_or_a_version(hypermap: Run, office: Path) -> None:
    for since, changes in (
        (["--since", "yesterday"], ["renamed", "moved", "gone"]),
        (["--since", "v2"], ["moved", "gone"]),
        (["--since", "v2", "--name", "sofa"], ["gone"]),
        ([], ["renamed", "moved", "gone"]),
    ):
        result = hypermap("changes", office, *since, "--json")
        assert result.code == 0
        found = json.loads(result.out)["changes"]
        assert [row["change"] for row in found] == changes
        assert {row["cause"] for row in found} == {"edit"}
    lines = hypermap("changes", office, "--since", "v2").out.splitlines()
    assert "3.00 m (100%)" in lines[2]
    assert lines[-1] == "1 moved, 1 gone"


def test_changes_says_that_a_name_is_none_of_the_map(hypermap: Run, office: Path) -> None:
    result = hypermap("changes", office, "--name", "chiar")
    assert result.out == "nothing changed\n"
    expected = "no object is called 'chiar', now or in the history; did you mean 'chair'?\n"
    assert result.err == expected
    for name in ("sofa", "table", "desk"):  # which is gone, was renamed, and is there
        assert hypermap("changes", office, "--since", "v3", "--name", name).err == ""


def test_places_of_changes_are_in_the_base_frame(hypermap: Run, tmp_path: Path) -> None:
    frames = FrameTree()
    frames.add(Transform("map", "annex", Pose2D(10.0, 0.0, math.pi / 2)))
    cup = SemanticObject("cup", shapely.box(2, 0, 3, 1), last_seen=1_795_500_000.0)
    things = SemanticLayer("semantic", "annex", [cup])
    tables = SemanticLayer("tables", "map", [SemanticObject("table", shapely.box(0, 0, 1, 1))])
    office = Hypermap([tables, things], frames)
    begin_history(office)
    things.update(0, dataclasses.replace(cup, footprint=shapely.box(4, 0, 5, 1)))
    save_map(office, tmp_path / "office.hmap")
    told = hypermap("changes", tmp_path / "office.hmap", "--json").json
    (row,) = told["changes"]
    assert told["frame_id"] == "map"
    assert row["before"] == pytest.approx({"id": 0, "name": "cup", "x": 9.5, "y": 2.5})
    assert row["after"] == pytest.approx({"id": 0, "name": "cup", "x": 9.5, "y": 4.5})
    assert "9.50, 4.50" in hypermap("changes", tmp_path / "office.hmap").out
    things.remove(0)
    save_map(office, tmp_path / "office.hmap")
    assert "at (9.50, 4.50)" in hypermap("query", tmp_path / "office.hmap", "--name", "cup").err


def test_changes_says_that_the_history_does_not_reach_back_so_far(
    hypermap: Run, office: Path
) -> None:
    for since, is_known in (("v0", False), ("yesterday", False), ("v1", True), ("v2", True)):
        said = hypermap("changes", office, "--since", since).err
        assert ("earlier changes are not known: the history begins with v2, " in said) != is_known


@pytest.mark.parametrize(
    ("lost", "since", "known", "unknown"),
    [
        (4, "v2", "1 moved, 1 gone", "the newest changes are not known: the end of the history is"),
        (4, "v3", "no change is known", "the newest changes are not known"),
        (3, "v2", "1 added", "changes right before v4 are not known: they are lost"),
        (3, "v3", "1 added", None),
        (2, "v1", "1 moved, 1 gone, 1 added", "earlier changes are not known"),
        (2, "v2", "1 moved, 1 gone, 1 added", None),
    ],
)
def test_changes_says_which_of_them_are_lost(
    hypermap: Run, office: Path, lost: int, since: str, known: str, unknown: str | None
) -> None:
    map_of_today = open_map(office)
    map_of_today.semantic().add(SemanticObject("cup", shapely.box(7, 7, 8, 8)))
    save_map(map_of_today, office)
    with zipfile.ZipFile(office) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(office, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content.replace(b'"version":%d' % lost, b'"version:'))
    said = hypermap("changes", office, "--since", since)
    assert said.out.splitlines()[-1] == known
    assert said.err.count("not known") == (unknown is not None)
    assert (unknown or "") in said.err


def test_a_query_says_when_the_last_object_of_a_name_left_the_map(
    hypermap: Run, office: Path
) -> None:
    # The sofa was removed in version 3, the table renamed in version 2, the first that is known.
    said = hypermap("query", office, "--name", "sofa", "--last-seen").err
    assert re.search(r"'sofa' was on the map until 20\S+ \S+ IST \(--as-of v2\)\n", said)
    found = hypermap("query", office, "--name", "sofa", "--as-of", "v2", "--json").json["answers"]
    assert len(found) == 1
    said = hypermap("query", office, "--name", "table").err
    assert re.search(r"'table' was on the map until 20\S+ \S+ IST\n", said)
    assert "was on the map" not in hypermap("query", office, "--name", "bed").err


def test_times_before_now_are_before_the_time_that_is_asked(hypermap: Run, tmp_path: Path) -> None:
    noon = time.time() // 86_400 * 86_400 - 10 * 86_400 + 43_200
    things = [
        SemanticObject(name, shapely.box(x, 0, x + 1, 1), first_seen=noon, last_seen=noon + 60 * x)
        for x, name in ((0, "cup"), (110, "chair"))
    ]
    office = Hypermap([SemanticLayer("semantic", "map", things)])
    assert begin_history(office)
    assert office.history is not None
    office.history = dataclasses.replace(
        office.history, added=(Revision(1, noon, "edit", "", ()),), version=1
    )
    save_map(office, tmp_path / "office.hmap")
    asked = datetime.fromtimestamp(noon + 3 * 3600).isoformat()
    for ago, found in (("4h", []), ("2h", ["cup"]), ("1h", ["cup", "chair"])):
        options = ("--not-seen-for", ago, "--as-of", asked, "--json")
        answers = hypermap("query", tmp_path / "office.hmap", *options).json["answers"]
        assert [row["label"] for row in answers] == found
    for option, found in (("--not-seen-for", []), ("--since", ["cup", "chair"])):
        options = (option, "1h", "--as-of", "v1", "--json")  # since when it is as in this version
        answers = hypermap("query", tmp_path / "office.hmap", *options).json["answers"]
        assert [row["label"] for row in answers] == found
    said = hypermap("ask", tmp_path / "office.hmap", f"what is new since 4 hours ago as of {asked}")
    assert len(said.out.splitlines()) == 2


def test_a_question_knows_other_names_of_what_left_the_map(hypermap: Run, tmp_path: Path) -> None:
    names = ("bin", "zorblax", "office chair")
    things = [SemanticObject(name, shapely.box(x, 0, x + 1, 1)) for x, name in enumerate(names)]
    office = Hypermap([SemanticLayer("semantic", "map", things)])
    assert begin_history(office)
    save_map(office, tmp_path / "office.hmap")
    for number in range(3):
        office.semantic().remove(number)
    save_map(office, tmp_path / "office.hmap")
    for name, asked in (("bin", "bin"), ("zorblax", "zorblax"), ("office chair", "seating")):
        said = hypermap("ask", tmp_path / "office.hmap", f"when did you last see the {asked}?").out
        assert f"; '{name}' was on the map until 20" in said
    said = hypermap("ask", tmp_path / "office.hmap", "where is the wug?").err
    assert "cannot read 'wug'" in said


def test_of_what_left_the_map_it_is_said_when_it_was_seen_last_and_where(
    hypermap: Run, tmp_path: Path
) -> None:
    monday = 1_795_500_000.0  # 2026-11-24 11:30 IST
    cups = [
        SemanticObject("cup", shapely.box(x, 0, x + 1, 1), last_seen=monday + 60 * x)
        for x in (4, 5, 2)
    ]
    mapped = Hypermap([SemanticLayer("semantic", "map", cups)])
    begin_history(mapped)
    for number in (0, 1, 2):  # the last one left first
        mapped.semantic().remove(2 if number == 0 else number - 1)
        save_map(mapped, tmp_path / "office.hmap")
    seen = r"; last seen 2026-11-24 11:35 IST at \(5.50, 0.50\)\n"
    said = hypermap("query", tmp_path / "office.hmap", "--name", "cup").err
    assert re.search(rf"'cup' was on the map until 20\S+ \S+ IST \(--as-of v3\){seen}", said)
    asked = hypermap("ask", tmp_path / "office.hmap", "when did you last see my cup?").out
    left = r"'cup' was on the map until 20\S+ \S+ IST"
    assert re.search(rf"there is no cup in the map; {left}{seen}", asked)
    before = hypermap("query", tmp_path / "office.hmap", "--name", "sofa", "--as-of", "v2")
    assert "was on the map" not in before.err


def test_all_changes_are_known_of_a_map_that_began_empty(hypermap: Run, tmp_path: Path) -> None:
    path = tmp_path / "live.hmap"
    begun = Hypermap([SemanticLayer("semantic", "map")])
    begin_history(begun)
    begun.metadata["map_version"] = 6  # as of a live node, which saves often
    begun.semantic().add([SemanticObject("chair", shapely.box(0, 0, 1, 1))])
    save_map(begun, path)
    assert hypermap("changes", path, "--since", "v1").err == ""


def test_a_second_day_says_what_changed_and_how_to_see_it(hypermap: Run, tmp_path: Path) -> None:
    out = tmp_path / "room.hmap"
    for day in (1, 2):
        drive = tmp_path / f"day{day}"
        start = f"2026-11-{22 + day}T08:00"
        simulate = ("simulate", "demo", "-o", drive, "--rate", "0.5", "--errors", "none")
        assert hypermap(*simulate, "--day", str(day), "--start", start).code == 0
        go_on = ("--onto", out) if day > 1 else ()
        detections = ("--detections", drive / "detections.json")
        made = hypermap("map", drive, *detections, *go_on, "-o", out)
        assert made.code == 0
    assert f"hypermap changes {out} --since v1" in made.err
    counts = re.search(rf"since {re.escape(str(out))}: (.*)", made.err)
    assert counts is not None
    assert "moved" in counts[1]
    since = hypermap("changes", out, "--since", "v1")
    told = since.out.splitlines()[-1]
    assert counts[1].startswith(told)
    assert "2026-11-24 08:00 IST" in since.out
    # All that the first drive found is one row, unless each object or a name is asked for.
    everything = hypermap("changes", out, "--all").out.splitlines()
    assert len(everything) > len(since.out.splitlines()) + 10
    rows = hypermap("changes", out).out.splitlines()
    assert len(rows) == len(since.out.splitlines()) + 1
    assert re.search(r"added +\d+ objects", rows[2])
    assert re.search(r"added +chair", hypermap("changes", out, "--name", "chair").out)


def test_doubtful_changes_are_counted_and_shown_on_demand(hypermap: Run, office: Path) -> None:
    cup = SemanticObject("cup", shapely.box(0, 0, 1, 1), id=7)
    change = Change(GONE, "semantic", cup, None, confidence=0.2)
    mapped = open_map(office)
    assert mapped.history is not None
    revision = Revision(4, 1.7e9, "mapping", "day2", (change,))
    mapped.history = dataclasses.replace(mapped.history, added=(revision,), version=4)
    save_map(mapped, office)
    shown = hypermap("changes", office, "--since", "v3")
    assert shown.out.strip() == "nothing changed"
    assert "1 doubtful change left out; --all shows them" in shown.err
    assert "(20%)" in hypermap("changes", office, "--since", "v3", "--all").out
    assert len(hypermap("changes", office, "--since", "v3", "--json").json["changes"]) == 1
    assert hypermap("history", office).out.splitlines()[4].split("day2")[1].strip() == "1 doubtful"


def test_what_doubtfully_changed_is_neither_drawn_nor_counted_as_unchanged(
    hypermap: Run, office: Path, tmp_path: Path
) -> None:
    mapped = open_map(office)
    assert mapped.history is not None
    change = Change(ADDED, "semantic", None, mapped.semantic()[2], confidence=0.2)
    revision = Revision(4, 1.7e9, "mapping", "day2", (change,))
    mapped.history = dataclasses.replace(mapped.history, added=(revision,), version=4)
    save_map(mapped, office)
    picture = tmp_path / "changes.svg"
    assert hypermap("changes", office, "--since", "v2", "--picture", picture).code == 0
    assert "2 changes, 0 objects unchanged" in picture.read_text()  # nor is the desk unchanged


def test_changes_draws_them(hypermap: Run, office: Path, tmp_path: Path) -> None:
    picture = tmp_path / "changes.svg"
    assert hypermap("changes", office, "--since", "v2", "--picture", picture).code == 0
    assert "moved" in picture.read_text()
    assert "2 changes, 1 object unchanged" in picture.read_text()


def test_the_picture_fills_only_what_is_still_so(
    hypermap: Run, office: Path, tmp_path: Path
) -> None:
    changed = open_map(office)
    changed.semantic().remove(0)
    save_map(changed, office)
    picture = tmp_path / "changes.svg"
    assert hypermap("changes", office, "--picture", picture).code == 0
    now, was = picture.read_text().split("as it was")[0].split("as it is now")[1], "moved"
    assert was not in now
    assert was in picture.read_text()


def test_a_query_may_ask_the_map_as_it_was(hypermap: Run, office: Path) -> None:
    assert "sofa" not in hypermap("query", office, "--in", "0,0,9,9").out
    assert "sofa" in hypermap("query", office, "--in", "0,0,9,9", "--as-of", "v2").out
    result = hypermap("query", office, "--name", "sofa", "--as-of", "2020-01-01")
    assert_one_error(result, "the map is not known: its history begins with version 2")
    assert_one_error(
        hypermap("query", office, "--as-of", "soon"), "--as-of 'soon': expected a time"
    )
    for unknown in (("query", "--name", "sofa", "--as-of", "v99"), ("changes", "--since", "v99")):
        assert_one_error(hypermap(unknown[0], office, *unknown[1:]), "there is no version 99")


def test_history_lists_versions_and_bounds_and_exports_them(
    hypermap: Run, office: Path, tmp_path: Path
) -> None:
    lines = hypermap("history", office).out.splitlines()
    assert lines[-1] == "2 versions; changes of 90d, at most 100 MB, are kept"
    assert "1 moved, 1 gone" in lines[3]
    assert " IST " in lines[3]  # the time as `changes` writes it
    table = tmp_path / "changes.csv"
    assert hypermap("history", office, "--export", table, "--keep", "1h").code == 0
    assert open_map(office).metadata["history"] == {"keep": "1h", "max_mb": 100.0}
    header, *rows = table.read_text().splitlines()
    assert header.startswith("version,time,cause,drive,layer,id,what,name_before,name,")
    assert [row.split(",")[6] for row in rows] == ["renamed", "moved", "gone"]
    assert_one_error(hypermap("history", office, "--keep", "long"), "keep: expected a time")


def test_a_wrong_policy_of_a_map_is_said_and_mended(
    hypermap: Run, office: Path, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.hmap"
    with zipfile.ZipFile(office) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "hmap_config.yaml":
                content = content.replace(b"map_version:", b"history: 7\n  map_version:")
            new.writestr(name, content)
    said = "expected keep and max_mb, got 7; `hypermap history MAP --keep 90d` mends it"
    assert_one_error(hypermap("history", path), said)
    assert hypermap("history", path, "--keep", "9d").out.endswith(
        "of 9d, at most 100 MB, are kept\n"
    )


def test_who_changes_a_map_keeps_nobody_from_reading_it_nor_itself_from_saving(
    hypermap: Run, office: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locks, "_PATIENCE", 0.0)
    with turn_to_edit(office):
        assert hypermap("history", office).code == 0
        note = ("--write", "x", "--place", "1,1", "-o", tmp_path / "new.hmap")
        assert hypermap("notes", office, *note).code == 0
    (tmp_path / "folder").mkdir()
    open_map(office).save(tmp_path / "folder")
    assert hypermap("history", tmp_path / "folder", "--keep", "1h").code == 0


def test_history_begins_where_a_map_keeps_none(hypermap: Run, tmp_path: Path) -> None:
    path = tmp_path / "old.hmap"
    save_map(Hypermap([SemanticLayer("semantic", "map")]), path)
    assert "keeps no history" in hypermap("history", path).out
    assert_one_error(hypermap("changes", path), "this map keeps no history")
    assert hypermap("history", path, "--keep", "30d").code == 0
    hypermap_ = open_map(path)
    hypermap_.semantic().add(SemanticObject("cup", shapely.box(0, 0, 1, 1)))
    save_map(hypermap_, path)
    assert "1 added" in hypermap("changes", path).out


def test_an_expired_object_answers_no_query(hypermap: Run, office: Path) -> None:
    said = hypermap("expire", office, "2", "--until", "2020-01-01").out
    assert "expires on 2020-01-01" in said
    assert hypermap("query", office, "--name", "desk").out == ""
    assert "desk" in hypermap("query", office, "--name", "desk", "--as-of", "v3").out
    assert hypermap("expire", office, "2", "--until", "never").out == "desk 2 never expires\n"
    assert "desk" in hypermap("query", office, "--name", "desk").out
    assert_one_error(hypermap("expire", office, "9", "--until", "2h"), "no object with id 9")
    wrong = hypermap("expire", office, "2", "--until", "x")
    assert_one_error(wrong, "--until 'x': expected a time")
