"""A store of many sites: questions through `open_map`, beside the same in plain SQL by psycopg.

A private server on a local socket is filled with made-up sites. Plain SQL knows the layer's number
and fetches what is asked alone, with the predicates of PostGIS; both keep their connection. Then
clients ask while others write, and robots send observations.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import shapely

from hypermap import Hypermap, SemanticLayer, open_map
from hypermap.core.arrays import as_objects
from hypermap.core.evidence import EvidenceTable
from hypermap.core.objects import ObjectTable
from hypermap.testing import square
from hypermap.testing.postgres import PrivateServer, private_server, why_no_server
from suite.race import Disagreement, Figure, Race, Row, Settings, Unavailable, library

SETTINGS = "-c shared_buffers=512MB -c max_connections=60 -c synchronous_commit=off"
NAMES = 50  # as many of each in a site
RARE = "fire extinguisher"  # this many of them in each site:
RARE_COUNT = 5
SHARE_MORE, LEAST_MORE = 0.5, 1.0  # of plain SQL's time, or milliseconds, we may take more
ASKED = 40  # questions in each repetition
BULK = 100_000  # objects of one push
CLIENTS, WRITERS = 16, 4
ROBOTS, OBSERVATIONS = 20, 50  # that each robot sends in a second


def rows(settings: Settings) -> Iterator[Row]:
    """Yield bulk pushes, questions, questions while others write, and observations of robots."""
    library("psycopg")
    if (reason := why_no_server()) is not None:
        raise Unavailable(reason)
    if hasattr(os, "sched_setaffinity"):  # a server and its clients use more than one core
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    sites, objects = (5, 1000) if settings.quick else (200, 10_000)
    with private_server(SETTINGS) as server:
        address = _filled(server, sites, objects)
        yield _bulk_push(address, settings)
        size = f"{sites * objects:,} objects on {sites} sites"
        yield from _questions(address, size, settings)
        yield from _under_load(address, size, settings)
        yield _observations(address, settings)


def site_table(count: int, seed: int) -> ObjectTable:
    """Return made-up objects, one on each square meter."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(count)))
    xy = np.column_stack(np.divmod(np.arange(count), side)) + rng.uniform(0, 0.5, (count, 2))
    size = rng.uniform(0.1, 0.5, count)
    names = [*(f"thing {number}" for number in range(NAMES)), RARE]
    codes = rng.integers(0, NAMES, count).astype(np.int32)
    codes[rng.choice(count, RARE_COUNT, replace=False)] = NAMES
    boxes: Any = shapely.box(*xy.T, *(xy.T + size))
    return ObjectTable(
        ids=np.arange(count),
        codes=codes,
        footprints=as_objects(boxes),
        tags=as_objects((names[code],) for code in codes.tolist()),
        confidence=as_objects([(0.9,)] * count),
        existence=rng.uniform(0, 5, count),
        first_seen=np.full(count, 1.76e9),
        last_seen=np.full(count, 1.764e9),
        attributes=as_objects([{}] * count),
        vocabulary={name: code for code, name in enumerate(names)},
    )


def _filled(server: PrivateServer, sites: int, objects: int) -> str:
    import psycopg

    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.migrating import migrate
    from hypermap.fleet.store.pushing import push

    with psycopg.connect(server.address("postgres"), autocommit=True) as connection:
        connection.execute("CREATE DATABASE maps")
    address = server.address("maps")
    migrate(parse_address(address))
    database = Database(parse_address(address))
    for number in range(sites):
        layer = SemanticLayer.of_table("semantic", "map", site_table(objects, number))
        push(database, Hypermap([layer]), f"site {number}")
    database.connected().execute("VACUUM ANALYZE")
    database.close()
    return address


def _bulk_push(address: str, settings: Settings) -> Figure:
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.pushing import push

    count = BULK // 10 if settings.quick else BULK
    layer = SemanticLayer.of_table("semantic", "map", site_table(count, 1))
    database = Database(parse_address(address))
    times = []
    for number in range(1 if settings.quick else 3):
        begin = time.perf_counter()
        push(database, Hypermap([layer]), f"bulk {number}")
        times.append(time.perf_counter() - begin)
    database.close()
    work = f"push {count:,} objects as a new site"
    return Figure(work, tuple(times), "s", 5.0, less_is_better=True)


# Questions


def _questions(address: str, size: str, settings: Settings) -> Iterator[Row]:
    import psycopg

    from hypermap.fleet.store.finding import find_in_store

    hypermap: Any = open_map(f"{address}&site=site 3")
    plain = psycopg.connect(
        address,
        options="-c search_path=hypermap,public -c plan_cache_mode=force_custom_plan "
        "-c jit=off",  # as ours
        autocommit=True,
    )
    (layer,) = plain.execute(
        "SELECT layers.id FROM layers JOIN sites ON sites.id = site_id WHERE sites.name = 'site 3'"
    ).fetchall()[0]
    point = "ST_SetSRID(ST_MakePoint(20.3, 12.2), 990001)"
    rare = (
        "SELECT sites.name, objects.id, objects.name, x, y, ST_AsBinary(shape), last_seen, "
        "ST_Distance(shape, ST_SetSRID(ST_MakePoint(0, 0), 990001)) FROM objects "
        "JOIN layers ON layers.id = layer_id JOIN sites ON sites.id = site_id "
        "WHERE objects.valid_to IS NULL AND objects.name = %s"
    )
    races: list[tuple[str, Any, Any, float]] = [
        (
            "what is at a point",
            lambda: hypermap.label_at("semantic", [20.3, 12.2]).tolist(),
            lambda: [
                plain.execute(
                    "SELECT coalesce((SELECT name FROM objects WHERE layer_id = %s::int "
                    "AND valid_to "
                    f"IS NULL AND ST_Intersects(shape, {point}) ORDER BY area LIMIT 1), 'Empty')",
                    (layer,),
                ).fetchall()[0][0]
            ],
            3e-3,
        ),
        (
            "the 10 nearest of a name in a site",
            lambda: [
                hit.object.id for hit in hypermap.nearest("thing 7", [20.3, 12.2], 10, "semantic")
            ],
            lambda: [
                number
                for number, _ in plain.execute(
                    "SELECT id, ST_AsBinary(shape) FROM objects WHERE layer_id = %s::int "
                    "AND name = %s "
                    f"AND valid_to IS NULL ORDER BY shape <-> {point} LIMIT 10",
                    (layer, "thing 7"),
                ).fetchall()
            ],
            5e-3,
        ),
        (
            "a name over all sites",
            lambda: sorted(
                (each.site, each.id) for each in find_in_store(hypermap.database, [RARE])
            ),
            lambda: sorted(
                row[:2]
                for row in plain.execute(rare, (RARE,), binary=True).fetchall()  # as ours
            ),
            50e-3,
        ),
    ]
    for work, ours, theirs, asked in races:
        found = _one_by_one(f"{work}, {size}", ours, theirs, settings)
        yield found
        yield from _medians(found, asked)
    plain.close()
    hypermap.database.close()


def _one_by_one(
    work: str, ours: Callable[[], list[Any]], theirs: Callable[[], list[Any]], settings: Settings
) -> Race:
    """Return the times of single questions, one of ours and one of plain SQL after the other.

    Most of each is the time of the server, which others on the machine disturb; so the two of a
    pair are as near to each other as can be.
    """
    agreement = _same(ours(), theirs())
    for _ in range(10):  # until the server has planned both
        ours(), theirs()
    count = ASKED * settings.repeat
    mine, others = [], []
    for _ in range(count):
        begin = time.perf_counter()
        ours()
        between = time.perf_counter()
        theirs()
        mine.append(between - begin)
        others.append(time.perf_counter() - between)
    return Race(work, "plain SQL", tuple(mine), tuple(others), agreement)


def _same(ours: list[Any], theirs: list[Any]) -> str:
    if ours != theirs:
        raise Disagreement(f"ours {ours[:3]}, plain SQL {theirs[:3]}")
    return f"{len(ours)} equal answers"


def _medians(found: Race, asked: float) -> Iterator[Figure]:
    """Yield our milliseconds, and how many more than plain SQL's they are in the median."""
    ours, theirs = (1000 * statistics.median(times) for times in (found.ours, found.theirs))
    yield Figure(found.work, (ours,), "ms", 1000 * asked, less_is_better=True)
    allowed = max(SHARE_MORE * theirs, LEAST_MORE)
    work = f"{found.work}: more than plain SQL"
    yield Figure(work, (ours - theirs,), "ms", allowed, less_is_better=True)


# Many clients


def _under_load(address: str, size: str, settings: Settings) -> Iterator[Row]:
    seconds = 1.0 if settings.quick else 10.0
    with multiprocessing.get_context("spawn").Pool(5) as pool:
        asking = [pool.apply_async(_ask_much, (address, CLIENTS // 4, seconds)) for _ in range(4)]
        writing = pool.apply_async(_write_much, (address, seconds))
        latencies = np.concatenate([each.get() for each in asking])
        written = writing.get()
    median, p99 = np.percentile(latencies, [50, 99])
    work = f"{CLIENTS} clients ask while {WRITERS} write, {size}"
    note = (
        f"median {1000 * median:.1f} ms, 99 % within {1000 * p99:.1f} ms; "
        f"{len(latencies) / seconds:.0f} questions/s, {written / seconds:.0f} updates/s, no error"
    )
    yield Figure(f"{work}: p99", (p99 / median,), "medians", 10.0, less_is_better=True, note=note)


def _ask_much(address: str, clients: int, seconds: float) -> np.ndarray[Any, Any]:
    """Return the seconds that each question took, of some clients in threads."""

    def ask(client: int) -> list[float]:
        hypermap: Any = open_map(f"{address}&site=site {client}")
        rng = np.random.default_rng(client)
        end, times = time.perf_counter() + seconds, []
        while time.perf_counter() < end:
            begin = time.perf_counter()
            hypermap.label_at("semantic", rng.uniform(0, 30, 2))
            times.append(time.perf_counter() - begin)
        hypermap.database.close()
        return times

    with ThreadPoolExecutor(clients) as threads:
        return np.concatenate(list(threads.map(ask, range(clients))))


def _write_much(address: str, seconds: float) -> int:
    """Return how many updates some writers have written."""
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.updates import Update, apply

    def write(writer: int) -> int:
        database = Database(parse_address(address))
        end, count = time.perf_counter() + seconds, 0
        while time.perf_counter() < end:
            things = [square("new", writer, count)]
            apply(database, Update(f"site {writer}", "semantic", things))
            count += 1
        database.close()
        return count

    with ThreadPoolExecutor(WRITERS) as threads:
        return sum(threads.map(write, range(WRITERS)))


def _observations(address: str, settings: Settings) -> Figure:
    """Return how many observations a second are taken in, of robots on sites of their own."""
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.delivery import deliver

    rounds = 2 if settings.quick else 5

    def drive(robot: int) -> None:
        database = Database(parse_address(address))
        for step in range(rounds):
            deliver(database, _second_of(robot, step))
        database.close()

    drives = partial(ThreadPoolExecutor, 4)
    begin = time.perf_counter()
    with drives() as threads:
        list(threads.map(drive, range(ROBOTS)))
    rate = ROBOTS * rounds * OBSERVATIONS / (time.perf_counter() - begin)
    return Figure(f"observations of {ROBOTS} robots taken in", (rate,), "1/s", 1000.0)


def _second_of(robot: int, step: int) -> Any:
    """Return what a robot sends after a second: 10 views of 5 objects."""
    from hypermap.fleet.store.observed import Observed

    things = [square("cup", 2 * (5 * step + n), 0, id=5 * step + n) for n in range(5)]
    ids = np.tile([item.id or 0 for item in things], OBSERVATIONS // 5)
    views = OBSERVATIONS // 5
    evidence = EvidenceTable(
        object_ids=ids,
        views=np.repeat(np.arange(views), 5),
        scores=np.full(len(ids), 0.8),
        footprints=as_objects(things[n % 5].footprint for n in range(len(ids))),
        heights=np.tile([0.0, 0.3], (len(ids), 1)),
        stamps=1.76e9 + step + np.arange(views) / views,
        poses=np.tile(np.eye(4), (views, 1, 1)),
        areas=as_objects([square("", 0, 0, 8).footprint] * views),
    )
    name = f"robot {robot}"
    return Observed(f"site of {name}", "semantic", name, things, (), evidence)
