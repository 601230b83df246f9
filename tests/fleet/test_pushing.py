"""A map comes out of a store as it went in, in every version, or there is one clear line."""

from __future__ import annotations

import copy
import json
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

pytest.importorskip("psycopg", reason="psycopg is missing")


from hypermap import Hypermap, open_map, save_map
from hypermap.cli.main import main
from hypermap.core.evidence import EvidenceTable
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.fleet.store import migrating
from hypermap.fleet.store.address import StoreError, parse_address
from hypermap.fleet.store.database import SCHEMA_VERSION, Database
from hypermap.fleet.store.pushing import Conflict, SiteExists, pull, push
from hypermap.fleet.store.sites import SiteNotFound, history, list_sites
from hypermap.fleet.store.tables import SRID
from hypermap.testing import assert_same_map, occupancy_from_text, square
from hypermap.testing.builders import jpeg_picture

pytestmark = pytest.mark.xdist_group("store")

GOLDEN = Path(__file__).parents[2] / "campaign" / "golden"


def evidence_for(*ids: int) -> EvidenceTable:
    """Return an observation of each object, all in one view."""
    shapes = np.array([square("", number, 0).footprint for number in ids], dtype=object)
    return EvidenceTable(
        object_ids=np.array(ids),
        views=np.zeros(len(ids), dtype=np.int64),
        scores=np.full(len(ids), 0.1 + 0.2),
        footprints=shapes,
        heights=np.tile([0.1, 0.7], (len(ids), 1)),
        stamps=np.array([1234.5678]),
        poses=np.eye(4)[np.newaxis] / 3,
        areas=np.array([square("", 0, 0, 9).footprint], dtype=object),
    )


def test_a_ring_from_zero_to_minus_zero_is_closed_for_postgis(
    database: Database, site: str
) -> None:
    ring = shapely.Polygon([(-0.0, 0), (1, 0), (1, 1), (0, -0.0)])
    drawn = SemanticLayer("semantic", "map", [SemanticObject("cup", ring)])
    push(database, Hypermap([drawn]), site)
    (pulled,) = pull(database, site).semantic()
    assert pulled.footprint.equals_exact(ring)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a map with all that a store keeps in rows."""
    path = tmp_path_factory.mktemp("lab") / "lab.hmap"
    chairs = [square("chair", x, 0, attributes={"nr": x, 7: [None, 1.5]}) for x in range(3)]
    layer = SemanticLayer("semantic", "map", chairs, evidence=evidence_for(0, 1, 2))
    layer.kept_pictures = {1: (jpeg_picture("red"), jpeg_picture("blue", azimuth=2.0))}
    cells = "\n".join(["#" + "." * 298 + "?"] * 140)
    hypermap = Hypermap(
        [occupancy_from_text(cells, 0.1), layer], metadata={"map_id": "lab", "map_version": 3}
    )
    hypermap.mapper_state = b"what mapping knows"
    save_map(hypermap, path)
    return path


@pytest.fixture
def a_map(lab: Path) -> Hypermap:
    return open_map(lab)


def same_file(tmp_path: Path, one: Hypermap, other: Hypermap) -> bool:
    save_map(one, tmp_path / "one.hmap")
    save_map(other, tmp_path / "other.hmap")
    return (tmp_path / "one.hmap").read_bytes() == (tmp_path / "other.hmap").read_bytes()


def test_a_pulled_map_is_the_same_file(
    database: Database, site: str, lab: Path, a_map: Hypermap, tmp_path: Path
) -> None:
    push(database, a_map, site)
    pulled = pull(database, site)
    assert_same_map(pulled, a_map)
    save_map(pulled, tmp_path / "pulled.hmap")
    assert (tmp_path / "pulled.hmap").read_bytes() == lab.read_bytes()


@pytest.mark.parametrize("name", [path.name for path in sorted(GOLDEN.glob("*.hmap"))])
def test_maps_of_all_kinds_come_back_as_the_same_file(
    database: Database, site: str, tmp_path: Path, name: str
) -> None:
    original = open_map(GOLDEN / name)
    push(database, original, site)
    assert same_file(tmp_path, pull(database, site), original)


def test_former_versions_stay(database: Database, store: str, site: str, lab: Path) -> None:
    first, second = open_map(lab), open_map(lab)
    second.semantic().remove(1)
    second.semantic().add(square("table", 5, 5))
    second.remove("occupancy")
    push(database, first, site)
    pushed = push(database, second, site, update=True, note="a table came")
    assert pushed.version == 2
    assert pushed.changes["objects"] == 1  # the others are not written again
    assert_same_map(pull(database, site, 1), first)
    second.metadata["map_version"] = 4  # of its history, to which the change was added
    assert_same_map(pull(database, site, 2), second)
    assert_same_map(open_map(f"{store}&site={site}&version=1"), first)
    assert [each.note for each in history(database, site)] == ["a table came", ""]
    (listed,) = [each for each in list_sites(database) if each.name == site]
    assert (listed.version, listed.objects) == (2, 3)


def test_a_push_that_was_done_is_not_done_again(
    database: Database, site: str, a_map: Hypermap
) -> None:
    number = uuid.uuid4()
    once = push(database, a_map, site, update_id=number)
    assert push(database, a_map, site, update_id=number) == once
    assert [each.version for each in history(database, site)] == [1]


def test_a_push_that_two_senders_send_at_once_is_done_once(
    database: Database, store: str, site: str, a_map: Hypermap
) -> None:
    number, other = uuid.uuid4(), Database(parse_address(store))
    with ThreadPoolExecutor(1) as pool:
        with database.transaction() as cursor:
            once = push(database, a_map, site, update_id=number)
            again = pool.submit(push, other, a_map, site, update_id=number)
            waits = "SELECT count(*) FROM pg_locks WHERE NOT granted"
            while cursor.execute(waits).fetchone() == (0,):
                assert not again.done()
                time.sleep(0.01)
        assert again.result() == once
    other.close()
    assert [each.version for each in history(database, site)] == [1]


def test_an_equal_map_changes_nothing(database: Database, site: str, a_map: Hypermap) -> None:
    push(database, a_map, site)
    assert push(database, a_map, site, update=True).changes == {}


def test_another_map_of_the_same_name_is_refused(
    database: Database, site: str, a_map: Hypermap
) -> None:
    push(database, a_map, site)
    with pytest.raises(SiteExists, match="give --update"):
        push(database, Hypermap([SemanticLayer("other", "map")]), site)
    renamed = copy.copy(a_map)
    renamed.metadata["map_id"] = "another"
    with pytest.raises(SiteExists, match="has another map, with the id lab, not another"):
        push(database, renamed, site, update=True)
    with pytest.raises(Conflict, match="has version 1 by now, not 7"):
        push(database, a_map, site, update=True, expected=7)
    assert_same_map(pull(database, site), a_map)
    assert push(database, renamed, site, update=True, force=True).version == 2


def test_what_fails_halfway_leaves_nothing(
    database: Database, site: str, a_map: Hypermap, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hypermap.fleet.store.pushing.add_version", fail)  # the last step
    with pytest.raises(KeyboardInterrupt):
        push(database, a_map, site)
    with pytest.raises(SiteNotFound):
        pull(database, site)
    assert database.rows("SELECT count(*) FROM objects WHERE valid_from = 0") == [(0,)]


def run(capfd: pytest.CaptureFixture[str], *words: str) -> tuple[Any, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(words)
    out, err = capfd.readouterr()
    return ended.value.code, out, err


def test_the_commands_push_and_pull_the_same_file(
    store: str, site: str, lab: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = run(capfd, "push", str(lab), store, "--site", site)
    assert (code, out.splitlines()[0]) == (0, f"{site}: version 1")
    back = tmp_path / "back.hmap"
    assert run(capfd, "pull", f"{store}&site={site}", "-o", str(back))[0] == 0
    assert back.read_bytes() == lab.read_bytes()
    assert site in run(capfd, "sites", store)[1]
    assert "owner" in run(capfd, "log", store, "--site", site)[1]
    code, out, _ = run(capfd, "query", f"{store}&site={site}", "--name", "chair")
    assert (code, out.count("chair")) == (0, 3)


def test_a_site_is_shown_compared_and_converted_like_a_file(
    store: str, site: str, lab: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run(capfd, "push", str(lab), store, "--site", site)
    address = f"{store}&site={site}&password=secret"
    layers = [
        json.loads(run(capfd, "info", str(map_), "--json")[1])["layers"] for map_ in (lab, address)
    ]
    assert layers[0] == layers[1]
    picture = ("--picture", str(tmp_path / "both.png"))
    code, out, err = run(capfd, "evaluate", address, str(lab), *picture, "--json")
    assert (code, json.loads(out)["all"]["matched"]["iou"]) == (0, 1.0)
    assert "secret" not in out + err
    copy = tmp_path / "copy.hmap"
    assert run(capfd, "convert", address, str(copy))[0] == 0
    assert_same_map(open_map(copy), open_map(lab))
    of_file, of_copy = (open_map(path).semantic().kept_pictures for path in (lab, copy))
    assert of_copy == of_file
    assert of_file
    assert "leave out --frame" in run(capfd, "convert", address, "x.hmap", "--frame", "map")[2]


def test_values_of_a_site_are_estimated_again(
    store: str, site: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    table, warm, again = (tmp_path / name for name in ("warm.csv", "warm.hmap", "again.hmap"))
    table.write_text("x,y,value\n" + "".join(f"{n},{n % 3},{20 + n % 5}\n" for n in range(20)))
    assert run(capfd, "values", str(table), "--method", "nearest", "-o", str(warm))[0] == 0
    run(capfd, "push", str(warm), store, "--site", site)
    address = f"{store}&site={site}"
    assert run(capfd, "values", address, "--method", "nearest", "-o", str(again))[0] == 0
    assert_same_map(open_map(again), open_map(warm))


def test_no_command_shows_the_password_of_a_store(
    store: str, site: str, lab: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run(capfd, "push", str(lab), store, "--site", site)
    address = f"{store}&site={site}&password=secret"
    for words in (
        ("merge", address, str(lab), "--same-frame", "-o", "merged.hmap"),
        ("merge", str(lab), address, "--same-frame", "-o", "merged.hmap"),
        ("align", str(lab), address),
        ("diff", str(lab), address, "--same-frame"),
        ("changes", address),
        ("values", address, "-o", "values.hmap"),
        ("history", address),
        ("connect", address, "1,1", str(lab), "1,1", "--kind", "lift"),
        ("expire", address, "77", "--until", "2h"),
    ):
        _, out, err = run(capfd, *words)
        assert "secret" not in out + err, words
    drawn = tmp_path / "drawn.svg"
    assert run(capfd, "diff", address, str(lab), "--same-frame", "--picture", str(drawn))[0] == 0
    assert f">{site} to lab<" in drawn.read_text()
    assert run(capfd, "render", address, "-o", str(drawn))[0] == 0
    assert f">{site}<" in drawn.read_text()


def test_all_pictures_of_a_site_are_read_at_once(
    database: Database, store: str, site: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    layer = SemanticLayer("semantic", "map", [square("chair", x, 0) for x in range(9)])
    layer.kept_pictures = {number: (jpeg_picture("red"),) for number in (2, 5, 7)}
    push(database, Hypermap([layer]), site)
    asked = list[str]()
    rows = Database.rows

    def counted(self: Database, query: str, *values: Any) -> Any:
        asked.append(query)
        return rows(self, query, *values)

    monkeypatch.setattr(Database, "rows", counted)
    save_map(open_map(f"{store}&site={site}"), tmp_path / "copy.hmap")
    of_pictures = [query for query in asked if "FROM pictures" in query]
    assert of_pictures
    assert not [query for query in of_pictures if "object_id = %s" in query]  # one by one
    assert open_map(tmp_path / "copy.hmap").semantic().kept_pictures == layer.kept_pictures


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("postgresql://me:secret@127.0.0.1:1/maps", "cannot connect"),
        ("postgresql:///nobody_made_this?host={folder}&user=owner&password=secret", "not exist"),
        ("postgresql:///postgres?host={folder}&user=owner&password=secret", "hypermap migrate"),
        ("postgresql:///store?host={folder}&user=nobody&password=secret", "nobody"),
        ("postgresql:///store?host={folder}&user=owner&port=a&password=secret", "port"),
        ("mysql://me:secret@host/maps", "not the address of a store"),
    ],
)
def test_a_wrong_address_is_one_line_without_the_password(
    store: str, address: str, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = store.partition("host=")[2]
    code, out, err = run(capfd, "sites", address.format(folder=folder))
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert message in err
    assert "secret" not in err


@pytest.mark.parametrize("command", [["info"], ["view"], ["rooms"], ["diff", "lab.hmap"]])
def test_no_command_shows_the_password_of_an_address(
    command: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    address = "postgresql://me:secret@127.0.0.1:1/maps?site=lab"
    code, out, err = run(capfd, *command, address)
    assert (code, out) == (2, "")
    assert "secret" not in err


def test_a_wrong_site_and_a_wrong_version_are_named(
    store: str,
    site: str,
    database: Database,
    a_map: Hypermap,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    push(database, a_map, site)
    out = str(tmp_path / "x.hmap")
    assert f"did you mean {site!r}" in run(capfd, "pull", store, "--site", site + "x", "-o", out)[2]
    wrong = run(capfd, "pull", store, "--site", site, "--version", "9", "-o", out)
    assert wrong[0] == 2
    assert "no version 9: 1 to 1" in wrong[2]
    assert "name the site" in run(capfd, "log", store)[2]
    assert not Path(out).exists()


@pytest.mark.parametrize(
    ("version", "remedy"),
    [
        ("0", "migrate URL"),
        ("1", "migrate URL"),
        ("10", "update Hypermap"),
        ("3b", "update Hypermap"),
        (None, "there is no store yet; make one: hypermap migrate URL"),
    ],
)
def test_another_schema_version_is_refused(
    database: Database, version: str | None, remedy: str
) -> None:
    connection = database.connected()
    if version is None:
        connection.execute("DELETE FROM hypermap.store_version")
    else:
        connection.execute("UPDATE hypermap.store_version SET version_num = %s", (version,))
    try:
        database.close()
        said = f"has schema version {version}, this program needs" if version else remedy
        with pytest.raises(StoreError, match=said) as error:
            list_sites(database)
        assert str(error.value).endswith(remedy)
    finally:
        from hypermap.fleet.store.database import SCHEMA_VERSION, connect

        with connect(database.address) as connection:
            connection.execute("DELETE FROM hypermap.store_version")
            connection.execute("INSERT INTO hypermap.store_version VALUES (%s)", (SCHEMA_VERSION,))


def test_only_one_program_at_a_time_migrates_a_store(
    database: Database, store: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(migrating, "_PATIENCE", 20)
    database.connected().execute("SELECT pg_advisory_lock(%s)", (SRID,))
    with pytest.raises(StoreError, match="another program is migrating it"):
        migrating.migrate(parse_address(store))
    monkeypatch.undo()  # the server may need a while to see that the lock's owner is gone
    database.close()
    assert migrating.migrate(parse_address(store)) == SCHEMA_VERSION


def test_migrate_on_a_full_disk_says_so(
    database: Database, store: str, capsys: pytest.CaptureFixture[str]
) -> None:
    connection = database.connected()
    connection.execute(
        "CREATE FUNCTION public.full_disk() RETURNS event_trigger LANGUAGE plpgsql AS $$ BEGIN "
        "RAISE EXCEPTION USING ERRCODE = 'disk_full', MESSAGE = 'could not extend file'; END $$"
    )
    connection.execute(
        "CREATE EVENT TRIGGER full_disk ON ddl_command_start WHEN TAG IN ('CREATE SCHEMA') "
        "EXECUTE FUNCTION public.full_disk()"
    )
    try:
        with pytest.raises(SystemExit, match="2"):
            main(["migrate", store])
    finally:
        connection.execute("DROP FUNCTION public.full_disk CASCADE")
    said = capsys.readouterr().err
    assert "the disk of the database is full; free space there, and try again" in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    "text", ["postgresql://a@h/\udcff", "postgresql://h/b?site=\udcff", "postgresql://%99@h/b"]
)
def test_an_address_of_half_characters_is_refused(text: str) -> None:
    with pytest.raises(StoreError, match=r"not valid Unicode|expected postgresql://"):
        parse_address(text)


@pytest.mark.parametrize(
    ("name", "reason"), [("", "a site needs a name"), ("\udcff", "is not valid Unicode")]
)
def test_a_site_that_cannot_have_that_name_is_refused(
    database: Database, a_map: Hypermap, name: str, reason: str
) -> None:
    with pytest.raises(StoreError, match=reason):
        push(database, a_map, name)


@pytest.mark.parametrize("tagged", [{}, {"tags": ("c\0p", "mug")}])
def test_an_object_that_the_database_cannot_hold_is_named(
    database: Database, site: str, tagged: dict[str, Any]
) -> None:
    things = [square("bed", 0, 0, id=3), square("cup" if tagged else "c\0p", 2, 0, id=7, **tagged)]
    with pytest.raises(StoreError, match=r"object 7, 'c.+p': its name or a tag has a NUL"):
        push(database, Hypermap([SemanticLayer("semantic", "map", things)]), site)
    with pytest.raises(SiteNotFound):
        pull(database, site)


def test_an_address_hides_its_password_and_survives_being_a_path() -> None:
    address = parse_address("postgresql://me:se/cret@db:5433/maps?sslmode=require&site=a b")
    assert "cret" not in repr(address) + address.shown
    assert address.site == "a b"
    assert parse_address(Path("postgresql://me@db/maps")).shown == "postgresql://me@db/maps"
    assert parse_address(Path("postgresql:///maps?host=/run")).shown == (
        "postgresql:///maps?host=/run"
    )
