"""What a robot maps reaches the store, all of it and once, also if the database dies meanwhile."""

from __future__ import annotations

import contextlib
import json
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("psycopg", reason="psycopg is missing")

from hypermap import Hypermap, HypermapError, SemanticLayer
from hypermap.cli.main import main
from hypermap.core.evidence import EvidenceTable
from hypermap.fleet.store import followers
from hypermap.fleet.store.address import parse_address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.delivery import Delivery, deliver
from hypermap.fleet.store.followers import follow
from hypermap.fleet.store.live_writer import Changes, LiveWriter
from hypermap.fleet.store.observed import MOST_EVIDENCE, Observed, apply_observed
from hypermap.fleet.store.pushing import pull, push
from hypermap.fleet.store.spool import Spool
from hypermap.fleet.store.thinning import DAY, thin
from hypermap.fleet.store.updates import Update, apply
from hypermap.testing import assert_same_objects, square
from hypermap.testing.comparing import assert_same_evidence

pytestmark = pytest.mark.xdist_group("store")

NOWHERE = parse_address("postgresql://nobody@127.0.0.1:1/none?site=lab")


def mapped(count: int, views: int) -> SemanticLayer:
    """Return what a robot has mapped: cups that were all seen in some views."""
    cups = [square("cup", 2.0 * n, 0, existence=float(views)) for n in range(count)]
    ids = np.repeat(np.arange(count), views)
    evidence = EvidenceTable(
        object_ids=ids,
        views=np.tile(np.arange(views), count),
        scores=np.full(len(ids), 0.5),
        footprints=np.array([cups[n].footprint for n in ids], dtype=object),
        heights=np.tile([0.0, 1.0], (len(ids), 1)),
        stamps=1000.0 + np.arange(views),
        poses=np.tile(np.eye(4), (views, 1, 1)),
        areas=np.array([square("", 0, 0, 9).footprint] * views, dtype=object),
    )
    return SemanticLayer("semantic", "map", cups, evidence=evidence)


def wait_until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + 240
    while not is_so():
        assert time.monotonic() < end, "this takes too long"
        time.sleep(0.05)


def test_only_what_is_new_is_sent() -> None:
    changes = Changes("lab", "anna")
    first = changes.since_last(mapped(2, 1))
    assert first is not None
    assert ([item.id for item in first.objects], len(first.evidence or ())) == ([0, 1], 2)
    assert changes.since_last(mapped(2, 1)) is None
    # A third cup was seen from the start, but only now is it sure enough to be an object.
    second = changes.since_last(mapped(3, 2))
    assert second is not None
    assert second.evidence is not None
    assert second.evidence.object_ids.tolist() == [0, 1, 2, 2]
    third = changes.since_last(mapped(1, 2))
    assert third is not None
    assert third.removed == [1, 2]


def test_the_spool_keeps_observations_exactly_and_in_order(tmp_path: Path) -> None:
    layer = mapped(2, 3)
    evidence = layer.evidence()
    observed = Observed("lab", "semantic", "anna", layer.objects(), [7], evidence)
    spool = Spool(tmp_path / "spool")
    spool.put(observed)
    spool.put(Observed("lab", "semantic", "anna", removed=[8]))
    spool.close()
    again = Spool(tmp_path / "spool")
    number, kept = again.first() or (0, observed)
    assert (kept.id, kept.site, kept.source, kept.removed) == (observed.id, "lab", "anna", [7])
    assert_same_objects(kept.objects, observed.objects)
    assert_same_evidence(kept.evidence, evidence)
    again.remove(number)
    assert len(again) == 1
    again.close()


def test_a_file_that_is_no_spool_is_named(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("this is no database, but a text that is long enough" * 9)
    with pytest.raises(HypermapError, match="text: cannot keep observations in this file"):
        Spool(tmp_path / "text")
    with sqlite3.connect(tmp_path / "other") as other:
        other.execute("CREATE TABLE mine (x)")
    other.close()
    with pytest.raises(HypermapError, match=r"other: .* a database of something else"):
        Spool(tmp_path / "other")
    Spool(tmp_path / "schema").close()
    content = (tmp_path / "schema").read_bytes()
    (tmp_path / "schema").write_bytes(content.replace(b"PRIMARY KEY", b"PRIMARY KE\xff"))
    with pytest.raises(HypermapError, match="schema: cannot keep observations in this file"):
        Spool(tmp_path / "schema")
    damaged = Spool(tmp_path / "damaged")
    with sqlite3.connect(tmp_path / "damaged") as file:
        file.execute("INSERT INTO waiting (content) VALUES ('{}')")
    file.close()
    with pytest.raises(HypermapError, match="damaged: entry 1: is damaged"):
        damaged.first()
    damaged.close()


@pytest.mark.parametrize(
    "wrong",
    ["[]", "7", '{"objects": "{}"}', "[" * 100_000, '{"removed": ["x"]}', b"{\xff}"],
    ids=["list", "number", "objects", "deep", "removed", "no UTF-8"],
)
def test_an_entry_that_says_nothing_is_damage(tmp_path: Path, wrong: str | bytes) -> None:
    spool = Spool(tmp_path / "spool")
    with sqlite3.connect(tmp_path / "spool") as file:
        file.execute("INSERT INTO waiting (content) VALUES (CAST(? AS TEXT))", (wrong,))
    file.close()
    with pytest.raises(HypermapError, match="spool: entry 1: is damaged"):
        spool.first()
    spool.set_aside(1, "damage")
    assert spool.aside == 1
    spool.close()


def test_where_the_disk_is_full_the_spool_says_what_to_do(tmp_path: Path) -> None:
    full = tmp_path / "full"
    spool = Spool(full)
    [[pages]] = spool._file.execute("PRAGMA page_count")
    spool._file.execute(f"PRAGMA max_page_count = {pages}")  # as a full disk
    seen = Changes("office", "anna").since_last(mapped(40, 40))
    assert seen is not None
    with pytest.raises(HypermapError, match=r"disk is full; free space there, .*\(--spool\)"):
        spool.put(seen)
    spool.close()
    with pytest.raises(HypermapError, match=r"unable to open .*; free space there"):
        Spool(tmp_path)  # as where nothing can be created


@contextlib.contextmanager
def full_spool(path: Path) -> Iterator[sqlite3.Connection]:
    """A spool that refuses what is new, as on a full disk, until its trigger `full` is dropped."""
    Spool(path).close()
    with contextlib.closing(sqlite3.connect(path)) as file:
        file.execute(
            "CREATE TRIGGER full BEFORE INSERT ON waiting "
            "BEGIN SELECT raise(FAIL, 'disk full'); END"
        )
        yield file


def test_what_the_spool_cannot_take_is_put_when_it_can_again(tmp_path: Path) -> None:
    path, troubles = tmp_path / "spool", []
    with full_spool(path) as file:
        writer = LiveWriter(lambda: (mapped(1, 1), None), NOWHERE, path, "anna", troubles.append)
        wait_until(lambda: any("disk full; observations wait in memory" in t for t in troubles))
        file.execute("DROP TRIGGER full")
    assert writer.close() == 1


def test_what_the_spool_never_took_is_said_to_be_lost(tmp_path: Path) -> None:
    path, troubles = tmp_path / "spool", []
    with full_spool(path):
        writer = LiveWriter(lambda: (mapped(1, 1), None), NOWHERE, path, "anna", troubles.append)
        assert writer.close() == 0
    assert any("disk full; the last observations are lost" in each for each in troubles)


def test_the_newest_observations_of_an_object_stay_and_thin_removes_the_others(
    site: str, database: Database
) -> None:
    push(database, Hypermap([SemanticLayer("semantic", "map")]), site)
    changes = Changes(site, "anna")
    for views in (MOST_EVIDENCE, MOST_EVIDENCE + 30):
        sent = changes.since_last(mapped(2, views))
        assert sent is not None
        apply_observed(database, sent)
    evidence = pull(database, site).semantic().evidence_of(1)
    assert len(evidence) == MOST_EVIDENCE
    assert evidence.stamps.min() == 1030.0  # the first is of 1000.0
    assert pull(database, site, 2).semantic().evidence_of(1).stamps.min() == 1000.0
    gone = changes.since_last(mapped(1, MOST_EVIDENCE + 30))
    assert gone is not None
    apply_observed(database, gone)
    database.rows(
        "UPDATE versions SET at = at - interval '9 days' FROM sites WHERE sites.id = site_id "
        "AND name = %s RETURNING 1",
        site,
    )
    thin(database, site)
    assert len(pull(database, site, 2).semantic().evidence() or ()) == 2 * MOST_EVIDENCE
    thin(database, site, keep=DAY)
    left = pull(database, site).semantic().evidence()
    assert left is not None
    assert (len(left), len(left.stamps)) == (MOST_EVIDENCE, MOST_EVIDENCE)
    assert set(left.object_ids.tolist()) == {0}


def test_a_database_that_dies_costs_nothing(
    server: Any, store: str, site: str, tmp_path: Path
) -> None:
    """The robot goes on while the database is dead, and all comes later, once."""
    now, troubles = [mapped(1, 1)], []
    address = parse_address(f"{store}&site={site}")
    writer = LiveWriter(
        lambda: (now[-1], None), address, tmp_path / "spool", "anna", troubles.append
    )
    database = Database(address)

    def stored() -> int:
        rows = database.rows(
            "SELECT count(*) FROM observations JOIN layers ON layers.id = layer_id "
            "JOIN sites ON sites.id = site_id WHERE sites.name = %s",
            site,
        )
        return int(rows[0][0])

    wait_until(lambda: stored() == 1)
    server.stop()
    try:
        now.append(mapped(2, 5))
        wait_until(lambda: bool(troubles))
        assert "observations wait in" in troubles[0]
    finally:
        server.start()
    now.append(mapped(3, 6))
    wait_until(lambda: stored() == 18)
    assert writer.close() == 0
    final = pull(database, site).semantic()
    assert [item.name for item in final] == ["cup"] * 3
    assert [len(final.evidence_of(number)) for number in final.ids.tolist()] == [6, 6, 6]
    assert [item.existence for item in final] == [6.0] * 3
    database.close()


def test_an_error_of_a_library_does_not_end_the_delivery_in_silence(
    store: str, site: str, database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spool, troubles = Spool(tmp_path / "spool"), []
    spool.put(Observed(site, "semantic", "anna", [square("cup", 0, 0, id=1)]))
    failing = RuntimeError("of a library")

    def fail(*_: object) -> None:
        raise failing

    push(database, Hypermap([SemanticLayer("semantic", "map")]), site)
    with monkeypatch.context() as broken:
        broken.setattr("hypermap.fleet.store.delivery.deliver", fail)
        delivery = Delivery(spool, parse_address(store), troubles.append)
        wait_until(lambda: bool(troubles))
    assert troubles == [f"RuntimeError: of a library; observations wait in {spool.path}"]
    delivery.wake()
    wait_until(lambda: len(spool) == 0)
    assert delivery.close() == 0
    spool.close()


def test_what_the_store_refuses_is_set_aside_and_the_rest_is_stored(
    store: str, site: str, database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spool, troubles = Spool(tmp_path / "spool"), []
    cups = [square("cup", float(2 * n), 0, id=n) for n in range(4)]
    cups[2] = square("a cup\0", 4, 0, id=2)  # text of PostgreSQL has no NUL
    long = np.random.default_rng(0).bytes(5000).hex()  # cannot be compressed to fit into an index
    cups[3] = square(long, 6, 0, id=3)
    spool.put(Observed(site, "semantic", "anna", cups))
    spool.put(Observed(site, "semantic", "anna", [square("mug", 9, 0, id=9)]))
    with contextlib.closing(sqlite3.connect(spool.path)) as file, file:
        file.execute("INSERT INTO waiting (content) VALUES ('{}')")
    spool.put(Observed(site, "semantic", "anna", [square("bowl", 11, 0, id=11)]))
    delivery = Delivery(spool, parse_address(store), troubles.append)
    wait_until(lambda: len(spool) == 0)
    assert delivery.close() == 0
    names = sorted(item.name for item in pull(database, site).semantic())
    assert names == ["bowl", "cup", "cup", "mug"]
    assert spool.aside == 3
    spool.close()
    assert len(troubles) == 3
    assert all(f"see: hypermap refused {spool.path}" in trouble for trouble in troubles)
    again: list[str] = []
    LiveWriter(lambda: (mapped(0, 1), None), NOWHERE, spool.path, "anna", again.append).close()
    see = f"see: hypermap refused {spool.path}"
    assert f"3 parts were refused by the store, in all runs; {see}" in again


def test_of_what_is_refused_the_newest_stays(tmp_path: Path) -> None:
    spool = Spool(tmp_path / "spool")
    for number in range(5):
        spool.put(Observed("lab", "semantic", "anna", [square("cup", 0, 0, id=number)]))
    spool.set_aside(1, "reason 1")
    size = len(spool.refused()[0].content)
    spool.close()
    with sqlite3.connect(tmp_path / "spool") as file:  # the length of a text has to be counted
        assert file.execute("SELECT typeof(content) FROM refused").fetchone() == ("blob",)
    file.close()
    spool = Spool(tmp_path / "spool", most_refused=3.5 * size / 1e6)
    dropped = [spool.set_aside(number, f"reason {number}") for number in range(1, 6)]
    assert [each.reason for each in spool.refused()] == ["reason 3", "reason 4", "reason 5"]
    assert (dropped, spool.dropped) == ([0, 0, 0, 1, 1], 2)
    spool.close()
    tight = Spool(tmp_path / "spool", most_refused=0.0)
    assert (tight.set_aside(1, "again"), tight.dropped, tight.aside) == (3, 5, 1)
    tight.close()


@pytest.mark.parametrize("size", [float("nan"), float("inf"), -1.0])
def test_what_is_refused_has_a_size(tmp_path: Path, size: float) -> None:
    with pytest.raises(HypermapError, match=r"cannot fill .* MB; --refused-mb is 0 or more"):
        Spool(tmp_path / "spool", most_refused=size)


def test_what_was_refused_is_listed_sent_again_and_dropped(
    store: str, database: Database, site: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "spool"
    spool = Spool(path)
    for number, name in enumerate(["mug", "a cup\0"]):
        spool.put(Observed(site, "semantic", "anna", [square(name, 9.0 * number, 0, id=number)]))
        spool.set_aside(number + 1, f"no {name}")
        spool.remove(number + 1)
    spool.close()

    def said(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main(["refused", *arguments])
        captured = capsys.readouterr()
        return int(ended.value.code or 0), captured.out, captured.err

    listed = json.loads(said(str(path), "--json")[1])
    assert [(each["objects"], each["reason"]) for each in listed["refused"]] == [
        (["mug"], "no mug"),
        (["a cup\0"], "no a cup\0"),
    ]
    assert "no mug" in said(str(path))[1]
    status, out, err = said(str(path), "--resend", store)
    assert (status, out) == (2, "1 part stored, 1 still refused\n")
    assert "2: postgresql://" in err
    assert [item.name for item in pull(database, site).semantic()] == ["mug"]
    assert said(str(path), "2", "--drop")[:2] == (0, "1 part dropped\n")
    assert "number 2" in said(str(path), "2")[2]
    assert said(str(path))[1] == "nothing that was refused is kept\n"
    assert "no such file" in said(f"{path}x")[2]
    assert "not both" in said(str(path), "--drop", "--resend", store)[2]


def test_what_a_store_refuses_for_now_waits(
    store: str, site: str, database: Database, tmp_path: Path
) -> None:
    push(database, Hypermap([SemanticLayer("semantic", "map")]), site)
    spool, troubles = Spool(tmp_path / "spool"), []
    spool.put(Observed(site, "semantic", "anna", [square("cup", 0, 0, id=1)]))
    read_only = f"{store}&options=-c%20default_transaction_read_only%3Don"  # as a standby is
    delivery = Delivery(spool, parse_address(read_only), troubles.append)
    wait_until(lambda: bool(troubles))
    assert "read-only transaction; observations wait in" in troubles[0]
    assert (delivery.close(), spool.aside) == (1, 0)
    spool.close()


def test_what_another_connection_is_storing_is_stored_once(
    store: str, site: str, database: Database
) -> None:
    """A connection may be lost while the database still works on what it has heard."""
    push(database, Hypermap([SemanticLayer("semantic", "map")]), site)
    observed = Observed(site, "semantic", "anna", [square("cup", 0, 0, id=1)])
    outcomes: list[object] = []
    other = Database(parse_address(store))
    again = threading.Thread(target=lambda: outcomes.append(apply_observed(other, observed)))
    with database.transaction() as cursor:
        apply_observed(database, observed)
        again.start()
        waits = "SELECT count(*) FROM pg_locks WHERE NOT granted"
        wait_until(lambda: cursor.execute(waits).fetchall() != [(0,)])
    again.join()
    other.close()
    assert outcomes == [{"added": 1}]


def test_what_a_library_fails_at_again_and_again_is_set_aside(
    store: str,
    site: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("hypermap.fleet.store.delivery._PATIENCE", 0.0)
    right = deliver

    def fail(database: Database, observed: Observed) -> None:
        if any(item.name == "bad" for item in observed.objects):
            raise RuntimeError("of a library")
        right(database, observed)

    monkeypatch.setattr("hypermap.fleet.store.delivery.deliver", fail)
    spool, troubles = Spool(tmp_path / "spool"), []
    spool.put(Observed(site, "semantic", "anna", [square("bad", 0, 0, id=1)]))
    spool.put(Observed(site, "semantic", "anna", [square("cup", 3, 0, id=2)]))
    delivery = Delivery(spool, parse_address(store), troubles.append)
    wait_until(lambda: len(spool) == 0)
    assert delivery.close() == 0
    assert spool.aside == 1
    spool.close()
    assert troubles[0] == f"RuntimeError: of a library; observations wait in {spool.path}"
    assert "set aside" in troubles[1]
    with pytest.raises(SystemExit):
        main(["refused", str(spool.path), "--resend", store])
    captured = capsys.readouterr()
    assert captured.out == "0 parts stored, 1 still refused\n"
    assert "1: RuntimeError: of a library" in captured.err


def test_what_waits_is_sent_by_the_next_run(
    store: str, site: str, database: Database, tmp_path: Path
) -> None:
    nowhere = parse_address(f"postgresql://owner@/store?host={tmp_path}&site={site}")
    writer = LiveWriter(
        lambda: (mapped(2, 2), None), nowhere, tmp_path / "spool", "anna", lambda _: None
    )
    assert writer.close() == 1
    spool = Spool(tmp_path / "spool")
    first = spool.first()
    assert first is not None
    push(database, Hypermap([SemanticLayer("semantic", "map")]), site)
    apply_observed(database, first[1])  # confirmed by the store, but the robot fell before it heard
    delivery = Delivery(spool, parse_address(store))
    wait_until(lambda: len(spool) == 0)
    assert delivery.close() == 0
    spool.close()
    assert len(pull(database, site).semantic().evidence() or ()) == 4


def test_followers_hear_of_a_change_at_once(
    store: str, site: str, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(followers, "_PATIENCE", 1000.0)  # they do not look by themselves
    push(database, Hypermap([SemanticLayer("semantic", "map")]), site)
    heard: list[int] = []
    ended = threading.Event()
    address = parse_address(store).at(site)

    def listening() -> None:
        for version in follow(address, ended):
            heard.append(version)  # noqa: PERF402 - seen one by one

    thread = threading.Thread(target=listening)
    thread.start()
    try:
        wait_until(lambda: len(heard) == 1)
        apply(database, Update(site, "semantic", [square("cup", 0, 0)]))
        wait_until(lambda: len(heard) == 2)
        assert heard == [1, 2]
        monkeypatch.setattr(followers, "_PATIENCE", 0.1)
        database.rows(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
            "WHERE application_name = 'hypermap' AND pid <> pg_backend_pid()"
        )
        wait_until(lambda: len(heard) == 3)  # connected again
        assert heard[2] == 2
    finally:
        ended.set()
        thread.join()
