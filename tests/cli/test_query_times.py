"""`hypermap query`: when objects were seen."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
import shapely

from hypermap import Hypermap, SemanticLayer, SemanticObject, save_map

from .conftest import Result, assert_one_error

Run = Callable[..., Result]

HOUR, DAY = 3600.0, 86_400.0


def seen(name: str, x: float, first_ago: float, last_ago: float, now: float) -> SemanticObject:
    shape = shapely.box(x, 0, x + 0.5, 0.5)
    return SemanticObject(name, shape, first_seen=now - first_ago, last_seen=now - last_ago)


@pytest.fixture
def week(tmp_path: Path) -> Path:
    """Return a map of objects that were seen at different times."""
    now = time.time()
    things = [
        seen("cup", 0, 30 * DAY, HOUR, now),
        seen("chair", 1, 2 * HOUR, HOUR / 2, now),
        seen("chair", 2, 30 * DAY, 3 * DAY, now),
        seen("plant", 3, 30 * DAY, 10 * DAY, now),
        SemanticObject("zone", shapely.box(4, 0, 5, 1)),  # drawn by hand
    ]
    path = tmp_path / "week.hmap"
    save_map(Hypermap([SemanticLayer("semantic", "map", things)]), path)
    return path


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--since", "6h"], ["cup", "chair"]),
        (["--since", "5 days ago"], ["cup", "chair", "chair"]),
        (["--new-since", "1d"], ["chair"]),
        (["--not-seen-for", "2d"], ["chair", "plant"]),
        (["--not-seen-for", "1 week", "--name", "chair"], []),
        (["--name", "chair", "--since", "1d"], ["chair"]),
        (["--since", "1w", "--not-seen-for", "1d"], ["chair"]),
        (["--since", "1d", "--nearest", "--name", "chair"], ["chair"]),
    ],
)
def test_objects_are_found_by_when_they_were_seen(
    hypermap: Run, week: Path, options: list[str], expected: list[str]
) -> None:
    answers = hypermap("query", week, *options, "--json").json["answers"]
    assert [answer["label"] for answer in answers] == expected
    line = " ".join(["query", *(f'"{option}"' for option in options), "--json"])
    assert hypermap("shell", week, stdin=line).json["answers"] == answers


def test_when_they_were_last_seen_is_shown_the_latest_first(hypermap: Run, week: Path) -> None:
    result = hypermap("query", week, "--last-seen")
    head, _, *rows = result.out.splitlines()
    assert head.split()[:4] == ["layer", "label", "last", "seen"]
    assert [row.split()[1] for row in rows] == ["chair", "cup", "chair", "plant", "zone"]
    answers = hypermap("query", week, "--last-seen", "--name", "cup", "--json").json["answers"]
    last_seen = answers[0]["object"]["last_seen"]
    assert last_seen == pytest.approx(time.time() - HOUR, abs=600)
    assert time.strftime("%Y-%m-%d", time.localtime(last_seen)) in rows[1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--since", "soon"], ["--since 'soon': expected a time, such as yesterday"]),
        (["--since", "2026-13-01"], ["--since '2026-13-01': expected a time"]),
        (["--since", "monday or tuesday"], ["--since 'monday or tuesday'"]),
        (["--not-seen-for", ""], ["--not-seen-for ''"]),
        (["--at", "1,1", "--since", "1d"], ["--at queries a point"]),
        (["--layer", "walls", "--last-seen"], ["there is no layer 'walls'"]),
    ],
)
def test_what_is_no_time_is_one_error(
    hypermap: Run, week: Path, options: list[str], words: list[str]
) -> None:
    assert_one_error(hypermap("query", week, *options), *words)


def test_stamps_of_a_recording_are_no_time_of_day(hypermap: Run, tmp_path: Path) -> None:
    path = tmp_path / "room.hmap"
    thing = seen("cup", 0, 90.0, 20.5, 100.0)
    save_map(Hypermap([SemanticLayer("semantic", "map", [thing])]), path)
    assert_one_error(hypermap("query", path, "--since", "1d"), "the dates at which objects")
    assert " 79.5 s " in hypermap("query", path, "--last-seen").out
