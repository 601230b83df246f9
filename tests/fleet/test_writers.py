"""Several writers change a site at once, and nobody's work is lost or done twice."""

from __future__ import annotations

import contextlib
import dataclasses
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

pytest.importorskip("psycopg", reason="psycopg is missing")

import psycopg

from hypermap import Hypermap, SemanticLayer, open_map
from hypermap.core.errors import LayerNotFound, ObjectNotFound
from hypermap.core.evidence import EvidenceTable
from hypermap.fleet.store.address import StoreAway, StoreError, parse_address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.observed import Observed, apply_observed
from hypermap.fleet.store.pushing import Conflict, pull, push
from hypermap.fleet.store.sites import SiteNotFound, history
from hypermap.fleet.store.updates import Update, apply
from hypermap.testing import square

pytestmark = pytest.mark.xdist_group("store")


@pytest.fixture
def lab(database: Database, site: str) -> str:
    """A site with two chairs."""
    layer = SemanticLayer("semantic", "map", [square("chair", 0, 0), square("chair", 5, 0)])
    push(database, Hypermap([layer]), site)
    return site


def objects(database: Database, site: str) -> dict[int | None, Any]:
    return {item.id: item for item in pull(database, site).semantic()}


# Changes of single objects


def test_an_opened_map_is_changed_in_the_store(database: Database, store: str, lab: str) -> None:
    hypermap = open_map(f"{store}&site={lab}")
    semantic = hypermap.semantic()
    number = semantic.add(square("table", 2, 2))
    semantic.rename(0, "stool")
    semantic.remove(1)
    assert {n: item.name for n, item in objects(database, lab).items()} == {
        0: "stool",
        number: "table",
    }
    assert semantic.label_at([[0, 0], [5, 0], [2, 2]]).tolist() == ["stool", "Empty", "table"]
    assert hypermap.nearest("table", [0, 0])[0].object.id == number
    assert [each.version for each in history(database, lab)] == [4, 3, 2, 1]
    with pytest.raises(ObjectNotFound):
        semantic.remove(1)


def test_who_has_not_seen_the_last_change_is_told(database: Database, lab: str) -> None:
    apply(database, Update(lab, "semantic", [square("sofa", 0, 0, id=0)], seen={0: 1}))
    late = Update(lab, "semantic", [square("bench", 0, 0, id=0)], removed=[1], seen={0: 1, 1: 1})
    with pytest.raises(Conflict, match=r"object 0 .* was changed, in version 2"):
        apply(database, late)
    taken = Update(lab, "semantic", [square("bench", 0, 0, id=1)])
    with pytest.raises(Conflict, match="object 1"):
        apply(database, taken)
    gone = Update(lab, "semantic", removed=[77], seen={77: 1})
    with pytest.raises(Conflict, match=r"object 77 .* was removed"):
        apply(database, gone)
    assert {n: item.name for n, item in objects(database, lab).items()} == {0: "sofa", 1: "chair"}


def test_an_update_sent_twice_is_done_once(database: Database, lab: str) -> None:
    update = Update(lab, "semantic", [square("table", 2, 2)])
    assert apply(database, update) == apply(database, update)
    assert len(objects(database, lab)) == 3


def test_a_wrong_site_or_layer_is_named(database: Database, lab: str) -> None:
    with pytest.raises(SiteNotFound, match="no site 'nowhere'"):
        apply(database, Update("nowhere", "semantic"))
    with pytest.raises(LayerNotFound, match="known: semantic"):
        apply(database, Update(lab, "x"))


def test_many_writers_at_once_lose_nothing(store: str, database: Database, lab: str) -> None:
    """Readers, meanwhile, always see both objects of an update or none."""
    ended = threading.Event()
    half_seen = []

    def write(writer: int) -> None:
        own = Database(parse_address(store))
        for step in range(5):
            pair = [square(f"pair {writer}", 10 * writer, step) for _ in range(2)]
            apply(own, Update(lab, "semantic", pair))
        own.close()

    def read() -> None:
        hypermap: Any = open_map(f"{store}&site={lab}")
        while not ended.is_set():
            counts = [len(hypermap.semantic().find(f"pair {writer}")) for writer in range(4)]
            half_seen.extend(count for count in counts if count % 2)
        hypermap.database.close()

    reader = threading.Thread(target=read)
    reader.start()
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(write, range(4)))
    ended.set()
    reader.join()
    assert half_seen == []
    assert len(objects(database, lab)) == 2 + 4 * 5 * 2
    assert len(history(database, lab)) == 21


def test_after_a_lost_connection_the_same_update_is_sent_again(
    database: Database, lab: str
) -> None:
    update = Update(lab, "semantic", [square("table", 2, 2)])
    for _ in range(2):
        (number,) = database.rows("SELECT pg_backend_pid()")[0]
        with psycopg.connect(database.address.database, autocommit=True) as other:
            other.execute("SELECT pg_terminate_backend(%s, 240000)", (number,))
        with pytest.raises(StoreAway):
            apply(database, update)
        apply(database, update)  # by a new connection
    assert len(objects(database, lab)) == 3


# Robots that map


def seen_by(source: str, site: str, *things: Any, **others: Any) -> Observed:
    """Return that a robot saw things, each with one observation."""
    evidence = EvidenceTable(
        object_ids=np.array([item.id for item in things]),
        views=np.zeros(len(things), dtype=np.int64),
        scores=np.full(len(things), 0.9),
        footprints=np.array([item.footprint for item in things], dtype=object),
        heights=np.tile([0.0, 1.0], (len(things), 1)),
        stamps=np.array([1000.0]),
        poses=np.eye(4)[np.newaxis],
        areas=np.array([square("", 0, 0, 30).footprint], dtype=object),
    )
    return Observed(site, "semantic", source, things, evidence=evidence, **others)


def test_two_robots_that_see_one_thing_share_it(database: Database, lab: str) -> None:
    cup = square("cup", 3.0, 3, 0.4, id=0, existence=2.0, first_seen=10.0, last_seen=20.0)
    same = square("cup", 3.1, 3, 0.4, id=0, existence=1.5, first_seen=5.0, last_seen=15.0)
    other = square("cup", 4.0, 3, 0.4, id=1, existence=1.0)
    assert apply_observed(database, seen_by("anna", lab, cup)) == {"added": 1}
    done = apply_observed(database, seen_by("bert", lab, same, other))
    assert done == {"added": 1, "changed": 1, "merged": 1}
    cups = [item for item in objects(database, lab).values() if item.name == "cup"]
    assert [item.id for item in cups] == [2, 3]
    shared = cups[0]
    assert (shared.existence, shared.first_seen, shared.last_seen) == (3.5, 5.0, 20.0)
    assert 2.8 < shared.footprint.centroid.x < 3.3
    evidence = pull(database, lab).semantic().evidence_of(2)
    assert len(evidence) == 2
    # Each goes on with its own number of it, and one that leaves does not take it along.
    later = dataclasses.replace(cup, existence=4.0, last_seen=30.0)
    assert apply_observed(database, seen_by("anna", lab, later)) == {"changed": 1}
    gone = Observed(lab, "semantic", "bert", removed=[0, 1])
    assert apply_observed(database, gone) == {"removed": 1}
    assert objects(database, lab)[2].last_seen == 30.0


def test_what_a_person_has_changed_stays(database: Database, lab: str) -> None:
    cup = square("cup", 3, 3, 0.4, id=0)
    apply_observed(database, seen_by("anna", lab, cup))
    apply(database, Update(lab, "semantic", [square("mug", 3, 3, 0.5, id=2)], seen={2: 2}))
    assert apply_observed(database, seen_by("anna", lab, cup)) == {"kept": 1}
    assert apply_observed(database, Observed(lab, "semantic", "anna", removed=[0])) == {}
    assert objects(database, lab)[2].name == "mug"
    # Nor is a chair that was pushed reshaped, though a robot sees it, too.
    chair = square("chair", 0.1, 0, id=5)
    assert apply_observed(database, seen_by("anna", lab, chair)) == {"merged": 1, "kept": 1}


def test_what_a_robot_sends_twice_counts_once(database: Database, lab: str) -> None:
    observed = seen_by("anna", lab, square("cup", 3, 3, id=0))
    assert apply_observed(database, observed) == apply_observed(database, observed)
    assert len(pull(database, lab).semantic().evidence_of(2)) == 1


# Who may do what


@pytest.fixture(scope="module")
def users(store: str) -> dict[str, str]:
    """The addresses of the store for a reader, a robot and an editor."""
    roles = ("reader", "robot", "editor")
    with psycopg.connect(store, autocommit=True) as connection:
        for role in roles:
            connection.execute(f"CREATE ROLE a_{role} LOGIN IN ROLE hypermap_{role}")
    return {role: store.replace("owner@", f"a_{role}@") for role in roles}


def test_roles_may_do_what_they_are_for(
    users: dict[str, str], store: str, database: Database, lab: str, site: str
) -> None:
    with psycopg.connect(store, autocommit=True) as connection:
        connection.execute(
            "INSERT INTO hypermap.writers SELECT id, 'a_robot' FROM hypermap.sites WHERE name = %s",
            (lab,),
        )
    other = f"{site} other"
    push(database, Hypermap([SemanticLayer("semantic", "map")]), other)
    empty = Hypermap([SemanticLayer("semantic", "map")])
    chair = [square("chair", 9, 9)]
    for role, may_own, may_other, may_add in (
        ("reader", False, False, False),
        ("robot", True, False, False),
        ("editor", True, True, True),
    ):
        own = Database(parse_address(users[role]))
        assert len(pull(own, lab).semantic()) >= 2
        allowed = contextlib.nullcontext()
        for where, may in ((lab, may_own), (other, may_other)):
            with allowed if may else pytest.raises(StoreError, match=r"may not|not allowed"):
                apply(own, Update(where, "semantic", chair))
            with allowed if may else pytest.raises(StoreError, match=r"may not|not allowed"):
                apply_observed(own, seen_by(role, where, square("cup", 20, 20, id=0)))
        with allowed if may_add else pytest.raises(StoreError, match=r"may not|not allowed"):
            push(own, empty, f"{site} of {role}")
        own.close()
    assert len(objects(database, other)) == 2  # of the editor


_SHADOWS = (
    "CREATE TEMP TABLE pg_roles AS "
    "SELECT 'a_writer'::name AS rolname, 'a_robot'::regrole::oid AS oid",
    "CREATE FUNCTION pg_temp.pg_has_role(oid, text) RETURNS boolean LANGUAGE sql AS 'SELECT true'",
)


def test_a_robot_cannot_take_the_sites_of_others(
    users: dict[str, str], store: str, lab: str
) -> None:
    change = "UPDATE hypermap.sites SET version = version WHERE name = %s"
    with psycopg.connect(store, autocommit=True) as connection:
        connection.execute(
            "INSERT INTO hypermap.writers SELECT id, 'a_writer' FROM hypermap.sites "
            "WHERE name = %s",
            (lab,),
        )
    with psycopg.connect(users["robot"]) as connection:  # all is undone
        for shadow in _SHADOWS:
            connection.execute(shadow)
        for path in ("public", "pg_temp, pg_catalog, public"):
            connection.execute(f"SET search_path = {path}")
            assert connection.execute(change, (lab,)).rowcount == 0
        connection.rollback()
