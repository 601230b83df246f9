"""Things are found at all sites, in a store as in a folder of maps."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("psycopg", reason="psycopg is missing")

from hypermap import Hypermap, SemanticLayer, save_map
from hypermap.cli.main import main
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.finding import (
    Sighting,
    as_geodataframe,
    by_site,
    find_in_folder,
    find_in_store,
    seen_in_future,
)
from hypermap.fleet.store.pushing import push
from hypermap.testing import square

pytestmark = pytest.mark.xdist_group("store")

DAY = 86400.0
THING = "fire extinguisher"  # of no other test


def a_site(extinguishers: dict[float, float | None]) -> Hypermap:
    """Return a map with two rooms, and extinguishers at some x, seen so many days ago."""
    now = time.time()
    things = [
        square(THING, x, 0, 0.2, last_seen=None if days is None else now - days * DAY)
        for x, days in extinguishers.items()
    ]
    rooms = [square("kitchen", 0, 0, 4), square("hall", 4, 0, 4)]
    return Hypermap(
        [SemanticLayer("semantic", "map", things), SemanticLayer("rooms", "map", rooms)]
    )


SITES = {
    "berlin": a_site({1.5: 40.0, 2.2: 1.0, 5.0: 1.0, 9.0: None}),
    "paris": a_site({-1.0: 31.0}),
    "rome": a_site({}),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("maps")
    for name, hypermap in SITES.items():
        save_map(hypermap, made / f"{name}.hmap")
    return made


@pytest.fixture(scope="module")
def in_store(store: str) -> str:
    from hypermap.fleet.store.address import parse_address

    database = Database(parse_address(store))
    for name, hypermap in SITES.items():
        push(database, hypermap, name)
    database.close()
    return store


def described(found: list[Sighting]) -> list[Any]:
    return [
        (Path(each.site).stem, each.id, round(each.distance, 6), each.room, each.shape.wkt)
        for each in found
    ]


def test_store_and_folder_find_the_same(in_store: str, folder: Path, database: Database) -> None:
    stored = find_in_store(database, [THING], (1.0, 0.0))
    filed, wrong = find_in_folder(folder, [THING], (1.0, 0.0))
    assert described(stored) == described(filed)
    assert wrong == []
    berlin, paris = by_site(stored)
    assert (berlin.site, berlin.count, berlin.nearest.x) == ("berlin", 4, 1.5)
    assert berlin.rooms == {"kitchen": 1, "hall": 2, "": 1}
    assert (paris.nearest.distance, paris.rooms) == (pytest.approx(1.9), {"kitchen": 1})


def test_what_was_not_seen_lately_is_found(in_store: str, folder: Path, database: Database) -> None:
    since = time.time() - 30 * DAY
    for found in (
        find_in_store(database, [THING], last_seen_before=since),
        find_in_folder(folder, [THING], last_seen_before=since)[0],
    ):
        assert [(Path(each.site).stem, each.x) for each in found] == [
            ("berlin", 1.5),
            ("paris", -1.0),
        ]


def test_a_clock_that_is_off_shows(folder: Path) -> None:
    found, _ = find_in_folder(folder, [THING])
    assert seen_in_future(found) == []
    assert seen_in_future(found, time.time() - 10 * DAY) == ["berlin.hmap"]


def test_a_broken_map_is_named_and_left_out(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "a.hmap").write_bytes((folder / "paris.hmap").read_bytes())
    (tmp_path / "b.hmap").write_bytes(b"PK no map")
    found, wrong = find_in_folder(tmp_path, [THING])
    assert [each.site for each in found] == ["a.hmap"]
    assert "b.hmap" in str(wrong[0])


def test_sightings_become_a_geodataframe(in_store: str, database: Database) -> None:
    pytest.importorskip("geopandas")
    frame = as_geodataframe(find_in_store(database, [THING]))
    assert frame.groupby("site").size().to_dict() == {"berlin": 4, "paris": 1}
    assert frame.geometry.area.tolist() == pytest.approx([0.04] * 5)


def run(capfd: pytest.CaptureFixture[str], *words: str) -> tuple[Any, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["find", *words])
    out, err = capfd.readouterr()
    return ended.value.code, out, err


def test_the_command_lists_sites(
    in_store: str, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = run(capfd, THING, "--in-store", in_store, "--json")
    sites = json.loads(out)["sites"]
    assert code == 0
    assert [(each["site"], each["count"]) for each in sites] == [("berlin", 4), ("paris", 1)]
    code, out, _ = run(
        capfd, THING, "--in", str(folder), "--not-seen-for", "30d", "--point", "-1,0"
    )
    assert out.splitlines()[-1] == "2 at 2 sites"
    assert run(capfd, "unicorn", "--in", str(folder))[1] == "found nowhere\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "say where to look"),
        (["--in", "nowhere_at_all"], "there is no such folder"),
        (["--in", str(Path(__file__).parent)], "no .hmap file"),
        (["--in", ".", "--in-store", "postgresql:///maps"], "say where to look"),
        (["--in", ".", "--point", "x"], "--point"),
        (["--in", ".", "--not-seen-for", "soon"], "--not-seen-for"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str], message: str, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, out, err = run(capfd, THING, *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
