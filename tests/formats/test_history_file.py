"""The files of a history: what they keep, what a policy drops, and damage."""

from __future__ import annotations

import datetime
import logging
import time
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import shapely

from hypermap import Hypermap, HypermapError, SemanticLayer, SemanticObject, open_map, save_map
from hypermap.core.history import MAP_ID, MAP_VERSION, Change, History, Revision
from hypermap.formats.history_file import (
    HistoryFiles,
    dump_revision,
    history_files,
    parse_revision,
)
from hypermap.history import at_version, begun
from hypermap.history.policy import HistoryPolicy

DAY = 86_400.0
RING = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 2, 2))


def chair(x: float = 0.0) -> SemanticObject:
    return SemanticObject("chair", shapely.box(x, 0, x + 1, 1.23456), id=3)


def revision(version: int, time: float | None = None) -> Revision:
    moved = Change("moved", "semantic", chair(), chair(version), float(version), 0.5)
    return Revision(version, time, "mapping", f"day {version}", (moved,))


def versions(files: dict[str, bytes]) -> list[int]:
    return [one.version for one in HistoryFiles(files)()]


def test_a_revision_is_read_as_it_was_written() -> None:
    item = SemanticObject(
        "Anna's cup",
        shapely.MultiPolygon(
            [*RING.geoms] if hasattr(RING, "geoms") else [RING, chair(9).footprint]
        ),
        id=7,
        tags=("mug",),
        confidence=(0.25,),
        existence=3.5,
        first_seen=1.7e9,
        last_seen=1.7e9 + 0.25,
        attributes={"bought": datetime.date(2026, 11, 20), "id": "x"},
    )
    change = Change("gone", "semantic", item, None)
    read = parse_revision(dump_revision(Revision(4, 1.7e9 + 0.125, "edit", "", (change,))))
    (again,) = read.changes
    assert again.before is not None
    assert (read.version, read.time, read.cause, read.drive) == (4, 1.7e9 + 0.125, "edit", "")
    assert vars(again.before) | {"footprint": 0} == vars(item) | {"footprint": 0}
    assert shapely.equals_exact(again.before.footprint, item.footprint, 1e-4)


def test_lines_are_appended_and_large_files_are_followed_by_others() -> None:
    policy = HistoryPolicy()
    first = history_files(History(added=(revision(1), revision(2))), policy)
    assert list(first) == ["history.000001.jsonl"]
    full = {"history.000001.jsonl": first["history.000001.jsonl"] * 1000}
    more = history_files(History(earlier=HistoryFiles(full), added=(revision(3),)), policy)
    assert list(more) == ["history.000001.jsonl", "history.000003.jsonl"]
    assert more["history.000001.jsonl"] == full["history.000001.jsonl"]


def test_a_policy_drops_the_oldest_by_age_and_by_size() -> None:
    history = History(added=tuple(revision(n, n * DAY) for n in range(1, 101)))
    everything = history_files(history, HistoryPolicy(keep="999d"))
    assert versions(everything) == list(range(1, 101))
    assert versions(history_files(history, HistoryPolicy(keep="10d"))) == list(range(90, 101))
    size = len(everything["history.000001.jsonl"])
    half = versions(history_files(history, HistoryPolicy(keep="999d", max_mb=size / 2e6)))
    assert half == list(range(101 - len(half), 101))
    assert 48 <= len(half) <= 52


def test_sessions_under_clocks_far_ahead_drop_nothing() -> None:
    days = [*range(1, 21), 4000, 4000.5]
    history = History(added=tuple(revision(n, day * DAY) for n, day in enumerate(days, 1)))
    assert versions(history_files(history, HistoryPolicy(keep="10d"))) == list(range(10, 23))
    later = replace(history, added=(*history.added, revision(23, 21 * DAY)))  # the clock is right
    assert versions(history_files(later, HistoryPolicy(keep="10d"))) == list(range(11, 24))
    other = replace(history, added=(*history.added, revision(23, 9000 * DAY)))  # wrong again
    assert versions(history_files(other, HistoryPolicy(keep="10d"))) == list(range(10, 24))
    days_after = (revision(23, 4001 * DAY), revision(24, 4002 * DAY))  # it was right before
    long = replace(history, added=(*history.added, *days_after))
    assert versions(history_files(long, HistoryPolicy(keep="10d"))) == [21, 22, 23, 24]


def test_many_empty_lines_take_no_seconds() -> None:
    earlier = HistoryFiles({"history.000001.jsonl": b"\n" * 300_000}, "office.hmap")
    started = time.process_time()
    assert earlier() == ()
    history = History(earlier=earlier, added=(revision(1, DAY), revision(2, 2 * DAY)))
    assert versions(history_files(history, HistoryPolicy(max_mb=0.001))) == [1, 2]
    assert time.process_time() - started < 0.8


def test_nothing_is_too_old_by_a_clock_that_is_not_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three clocks far ahead confirm each other, and ours, which starts in 1970, cannot object."""
    days = [*range(1, 21), 40_000, 40_002, 40_004]
    history = History(added=tuple(revision(n, day * DAY) for n, day in enumerate(days, 1)))
    assert versions(history_files(history, HistoryPolicy(keep="10d"))) == list(range(10, 24))
    monkeypatch.setattr("hypermap.core.history.time.time", lambda: 60.0)
    assert versions(history_files(history, HistoryPolicy(keep="10d"))) == list(range(1, 24))


def test_history_is_dropped_from_a_map_that_changes_once_a_season() -> None:
    history = History(added=tuple(revision(n, 90 * n * DAY) for n in range(1, 9)))
    kept = versions(history_files(history, HistoryPolicy(keep="200d")))
    assert kept == [4, 5, 6, 7, 8]  # 6 is the newest that two later ones confirm


def office(path: Path) -> Hypermap:
    """Return a map with four versions, each saved after a rename."""
    hypermap = Hypermap(
        [SemanticLayer("semantic", "map", [chair()])], metadata={MAP_ID: "00ff", MAP_VERSION: 1}
    )
    hypermap.history = begun(hypermap)
    for name in ("armchair", "seat", "stool"):
        hypermap.semantic().rename(3, name)
        hypermap.save(path)
    return hypermap


def damaged(path: Path, line: bytes) -> None:
    """Overwrite a line of the history in an archive, whose checksums then fit again."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            is_history = name.startswith("history.")
            archive.writestr(
                name, content.replace(line, b"#" * len(line)) if is_history else content
            )


def test_of_a_damaged_history_the_rest_is_read_and_what_is_lost_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    damaged(path, b'"version":3')
    opened = open_map(path)
    assert opened.semantic().names.tolist() == ["stool"]
    assert opened.history is not None
    with caplog.at_level(logging.WARNING):
        assert [(one.version, one.follows_loss) for one in opened.history.revisions()] == [
            (2, False),
            (4, True),
        ]
    said = "a part of the map's history is lost: 1 part of it cannot be read: what changed "
    assert f"{said}between versions 2 and 4" in caplog.text
    with pytest.raises(HypermapError, match="in version 2 the map is not known: a later part"):
        at_version(opened, 2)


def test_before_an_end_of_the_history_that_is_lost_nothing_is_known(tmp_path: Path) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    damaged(path, b'"version":4')
    opened = open_map(path)
    for version in (2, 3):
        with pytest.raises(HypermapError, match="the end of its history is lost, so only the"):
            at_version(opened, version)
    assert at_version(opened, 4).semantic().names.tolist() == ["stool"]
    with pytest.raises(HypermapError, match="the end of its history is lost"):
        opened.as_of(time.time() - 86_400)
    assert opened.as_of(time.time() + 60).semantic().names.tolist() == ["stool"]
    opened.semantic().remove(opened.semantic().objects()[0].id)
    save_map(opened, path)
    for later in (opened, open_map(path)):
        with pytest.raises(HypermapError, match="in version 3 the map is not known: a later part"):
            at_version(later, 3)


def edited(path: Path, change: Callable[[bytes], bytes]) -> Hypermap:
    """Return a map in an archive whose history is changed, with checksums that fit."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            is_history = name.startswith("history.")
            archive.writestr(name, change(content) if is_history else content)
    return open_map(path)


@pytest.mark.parametrize("lines", [1, 2])
def test_that_whole_lines_at_the_end_are_missing_is_noticed(tmp_path: Path, lines: int) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    opened = edited(path, lambda content: b"".join(content.splitlines(keepends=True)[:-lines]))
    with pytest.raises(HypermapError, match="the end of its history is lost, so only the"):
        at_version(opened, 2)
    assert at_version(opened, 4).semantic().names.tolist() == ["stool"]
    opened.semantic().rename(3, "bench")
    save_map(opened, path)
    again = open_map(path)
    assert at_version(again, 4).semantic().names.tolist() == ["stool"]
    with pytest.raises(HypermapError, match="in version 3 the map is not known"):
        at_version(again, 3)


def test_that_a_line_in_the_middle_is_missing_is_noticed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    opened = edited(path, lambda content: b"".join(content.splitlines(keepends=True)[::2]))
    assert opened.history is not None
    with caplog.at_level(logging.WARNING):
        told = [(one.version, one.follows_loss) for one in opened.history.revisions()]
    assert told == [(2, False), (4, True)]
    said = "a part of the map's history is lost: 1 part of it cannot be read: what changed "
    assert f"{said}between versions 2 and 4" in caplog.text
    assert at_version(opened, 3).semantic().names.tolist() == ["seat"]
    with pytest.raises(HypermapError, match="in version 2 the map is not known: a later part"):
        at_version(opened, 2)


def test_a_version_without_a_line_is_not_missing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    hypermap = open_map(path)
    hypermap.metadata[MAP_VERSION] = 7  # as a tool does that changes other layers
    hypermap.semantic().rename(3, "bench")
    hypermap.save(path)
    history = open_map(path).history
    assert history is not None
    assert [(one.version, one.follows_loss) for one in history.revisions()][-2:] == [
        (4, False),
        (7, False),
    ]
    assert not caplog.records


def test_lines_that_a_policy_drops_are_not_missing(caplog: pytest.LogCaptureFixture) -> None:
    history = History(added=tuple(revision(n, n * DAY) for n in range(1, 101)))
    assert versions(history_files(history, HistoryPolicy(keep="10d"))) == list(range(90, 101))
    assert not caplog.records


def test_a_line_that_stands_twice_is_told_once(tmp_path: Path) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    opened = edited(path, lambda content: content + content.splitlines(keepends=True)[-1])
    assert opened.history is not None
    assert [one.version for one in opened.history.revisions()] == [2, 3, 4]
    assert at_version(opened, 3).semantic().names.tolist() == ["seat"]


def test_a_version_that_is_lost_is_known_by_the_one_after_it(tmp_path: Path) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    damaged(path, b'"version":3')
    opened = open_map(path)
    assert at_version(opened, 3).semantic().names.tolist() == ["seat"]
    with pytest.raises(HypermapError, match="in version 2 the map is not known: a later part"):
        at_version(opened, 2)


@pytest.mark.parametrize("value", ['"far"', "NaN", "1e400", "true", "[1]"])
def test_a_distance_that_is_no_number_is_damage(value: str) -> None:
    line = dump_revision(revision(2)).replace(b'"distance":2.0', b'"distance":' + value.encode())
    assert value.encode() in line
    assert HistoryFiles({"history.000002.jsonl": line})() == ()


def test_a_map_opens_without_the_file_of_its_history(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "office.hmap"
    office(path)
    content = bytearray(path.read_bytes())
    at = content.find(b"history.000002.jsonl") + len(b"history.000002.jsonl")
    content[at + 20] ^= 0xFF  # within the packed lines
    path.write_bytes(bytes(content))
    with caplog.at_level(logging.WARNING):
        opened = open_map(path)
    assert opened.semantic().names.tolist() == ["stool"]
    assert "a part of the map's history is lost" in caplog.text
    opened.semantic().rename(3, "bench")
    opened.save(path)
    again = open_map(path)
    assert again.history is not None
    assert [(one.version, one.follows_loss) for one in again.history.revisions()] == [(5, True)]


def test_after_a_file_that_was_cut_off_new_revisions_are_kept() -> None:
    cut = dump_revision(revision(1)) + b"\n" + dump_revision(revision(2))[:-9]
    history = History(HistoryFiles({"history.000001.jsonl": cut}), (revision(3),))
    assert versions(history_files(history, HistoryPolicy())) == [1, 3]
