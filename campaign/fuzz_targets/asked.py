"""What is asked: by agents, in words, of the store; and corrected poses, and the spool."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

import numpy as np

from campaign.full_map import MeanColors, corrected_trajectory, full_map
from campaign.fuzz_targets.servers import answered, mutate_request, parsed_request
from campaign.fuzz_targets.target import Target
from campaign.mutation import mutate_any, mutate_json, mutate_text
from hypermap import HypermapError, SemanticLayer, SemanticObject, open_map, save_map
from hypermap.agents.toolbox import tools_for
from hypermap.agents.tools import Picture
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import ROOMS
from hypermap.core.trajectory import pose_matrix, trajectory_of
from hypermap.mapping.mapper import Mapper
from hypermap.questions.asking import answer_to
from hypermap.recordings.tum import read_trajectory
from hypermap.testing import square

_POINT = [1.7, 1.1]  # which is free
_CALLS: list[tuple[str, dict[str, Any]]] = [
    ("find_objects", {"names": ["sink"], "near": _POINT, "within": 1.5, "limit": 3}),
    ("find_objects", {"near_name": "sink", "which": "largest", "limit": 3}),
    ("nearest", {"name": "person", "start": _POINT, "by": "path", "limit": 2}),
    ("what_is_at", {"point": _POINT}),
    ("find_notes", {"words": "tile", "near": _POINT, "within": 3.0, "since": "7d"}),
    ("path_to", {"goal": "sink", "start": _POINT}),
    ("ask", {"question": "what is near the sink?", "position": _POINT, "heading": 90}),
    ("changes", {"since": "2026-11-20T10:00+01:00"}),
    ("show_object", {"id": 1, "number": 1}),
    ("render_view", {"center": _POINT, "size": 2.0, "pixels": 200}),
    ("add_zone", {"name": "wet", "corners": [[0, 0], [1, 0], [1, 1]]}),
    ("rename", {"id": 1, "name": "stool"}),
    ("mark_gone", {"id": 1}),
    ("add_note", {"text": "wet floor", "point": _POINT}),
]


def tools(folder: Path) -> Target:
    """Calls of the tools for agents, as JSON."""
    path = folder / "map.hmap"
    save_map(full_map(), path)
    saved = path.read_bytes()

    def opened() -> dict[str, Any]:
        path.write_bytes(saved)
        return {tool.name: tool for tool in tools_for(path, allow_edits=True)}

    known = opened()

    def ask(data: bytes) -> None:
        nonlocal known
        try:
            call = json.loads(data)
        except (ValueError, RecursionError):
            return
        tool = known.get(str(call.get("tool"))) if isinstance(call, dict) else None
        if tool is None:
            return
        arguments = call.get("arguments")
        answer = tool(arguments if isinstance(arguments, dict) else None)
        if tool.is_edit:
            known = opened()
        if answer is not None and not isinstance(answer, Picture):
            json.dumps(answer, ensure_ascii=False, allow_nan=False).encode()

    corpus = [json.dumps({"tool": name, "arguments": given}).encode() for name, given in _CALLS]
    return Target(ask, corpus, mutate_json)


def questions(_: Path) -> Target:
    """Questions in English, and queries as JSON."""
    hypermap, encoder = full_map(), MeanColors()
    rooms = [square("kitchen", 0, 0, 3.0, id=1), square("hall", 3.1, 0, 4.0, id=2)]
    hypermap = hypermap.with_layers([*hypermap, SemanticLayer(ROOMS, "map", rooms)])
    near = {"relation": "near", "what": {"names": ["sink"]}, "within": 1.5}
    queries: list[dict[str, Any]] = [
        {"give": "count", "names": ["person"], "where": [near]},
        {"like": "red", "count": 3},
        {"names": ["person"], "count": 3, "which": "nearest", "start": {"point": _POINT}},
        {"give": "labels", "start": {"point": _POINT}, "layers": ["warmth", "notes"]},
        {"as_of": "2023-11-14T22:15:00+00:00", "tags": ["cupboard"]},
        {"when": {"seen": "new", "since": "2023-11-14T22:13:00Z"}},
        {"measured": {"layer": "warmth", "above": 19.0}, "names": ["person"]},
    ]
    texts = ["which sinks are within 1 m of a person?", "how many sinks are there"]
    texts += ["what is at 1.0, 2.0", "where was the sink on 2026-11-20?", "what looks like: red"]
    texts += ["how big is the largest room?", "which cups are in the same room as a sink?"]
    texts += ["how many persons are in each room?", "which sinks are left of a person?"]

    def ask(data: bytes) -> None:
        answer = answer_to(hypermap, data.decode(errors="surrogateescape"), encoder=encoder)
        json.dumps(answer.query.to_json(), allow_nan=False)

    corpus = [*(json.dumps(query) for query in queries), *texts]
    return Target(ask, [text.encode() for text in corpus], mutate_any)


def poses(folder: Path) -> Target:
    """Corrected poses for the frames of a map."""
    path, state = folder / "poses.txt", folder / "map.hmap"
    save_map(full_map(), state)
    hypermap = open_map(state)
    known = corrected_trajectory()
    rows = zip(known.stamps, known.positions, known.quats_xyzw, strict=True)
    lines = [" ".join(f"{n:.6f}" for n in (stamp, *p, *q)) for stamp, p, q in rows]

    def ask(data: bytes) -> None:
        path.write_bytes(data)
        read, _ = read_trajectory(path, 1e9)
        matrices = pose_matrix(read.positions, read.quats_xyzw)
        mapper = Mapper.onto(hypermap, None)
        mapper.correct(trajectory_of(read.stamps, matrices, 1e9))
        save_map(mapper.hypermap(), folder / "again.hmap")

    return Target(ask, ["\n".join(lines).encode()], _mutate_poses)


def _mutate_poses(data: bytes, draw: random.Random) -> bytes:
    """Change poses of a list and leave it one, by far for most lists; or its text."""
    rows = [line.split() for line in data.split(b"\n")]
    if draw.random() < 0.2 or not all(len(row) == 8 for row in rows):
        return mutate_text(data, draw)
    for _ in range(draw.choice([1, 1, 2, 5])):
        at, kind = draw.randrange(len(rows)), draw.random()
        if kind < 0.4:  # some or all of them, along one axis or turned
            column, by = draw.randrange(1, 8), draw.choice(_STEPS)
            for row in rows[at:] if draw.random() < 0.5 else rows[at : at + 1]:
                row[column] = _added(row[column], by)
        elif kind < 0.6:  # at another time
            by = draw.choice(_STEPS)
            for row in rows[at:]:
                row[0] = _added(row[0], by)
        elif kind < 0.8:
            del rows[at + 1 : at + 1 + draw.choice([1, 3, 100])]
        elif kind < 0.9:
            rows.insert(at, [_added(rows[at][0], -1e-6), *draw.choice(rows)[1:]])
        else:
            rows[at][draw.randrange(8)] = draw.choice([b"nan", b"1e308", b"-1e9", b"0", b"1e-320"])
    return b"\n".join(b" ".join(row) for row in rows)


_STEPS = [1e-9, -1e-6, 0.01, -0.1, 0.5, -1.0, 3.0, 100.0, -1e4, 1e6, 9.9e8]


def _added(number: bytes, by: float) -> bytes:
    try:
        return b"%.6f" % (float(number) + by)
    except (ValueError, OverflowError):
        return number


def spool(folder: Path) -> Target:
    """What a robot has learned and could not send yet: one entry, or the file of all."""
    from hypermap.fleet.store.observed import Observed
    from hypermap.fleet.store.seen_cells import ChangedCells
    from hypermap.fleet.store.spool import Spool

    seen = np.full((3, 4), 100, np.int8)
    cells = ChangedCells("occupancy", "map", GridGeometry(4, 3, 0.5), seen)

    def observed(number: int) -> Observed:
        things: list[SemanticObject] = [square("cup", 0, 0, id=number), square("chair", 2, 0, id=9)]
        return Observed("site", "semantic", "robot", things, [3], full_map().semantic().evidence())

    path = folder / "spool"
    first = Spool(path)
    first.put(dataclasses.replace(observed(1), cells=cells))
    entry = first._file.execute("SELECT content FROM waiting").fetchone()[0].encode()
    first.close()

    def ask(data: bytes) -> None:
        path.unlink(missing_ok=True)
        is_file = data.startswith(b"SQLite")
        if is_file:
            path.write_bytes(data)
        opened = Spool(path)
        try:
            if not is_file:
                text = data.decode(errors="replace")
                opened._file.execute("INSERT INTO waiting (content) VALUES (?)", (text,))
            with contextlib.suppress(HypermapError):
                opened.first()
            opened.put(observed(2))
            opened.remove(1)
            len(opened)
        finally:
            opened.close()
            path.with_name("spool-journal").unlink(missing_ok=True)

    return Target(ask, [entry, path.read_bytes()], mutate_any)


_CUP = {
    "type": "Feature",
    "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]},
    "properties": {"name": "cup", "tags": ["mug"]},
}
_TOKEN = "a token of the campaign"


def store_api(_: Path) -> Target:
    """Requests to the service of a store: of PostgreSQL where that is here, else of none."""
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.service.app import StoreService
    from hypermap.testing.postgres import why_no_server

    started = contextlib.ExitStack()
    service = StoreService(parse_address(_store(started)), _TOKEN, allows_edits=True)
    app, known = service.app, _first_collection(service)
    worst = 503 if why_no_server() is None else 504  # else there is no store, and 503 says so

    def ask(data: bytes) -> None:
        scope, body = parsed_request(data)
        status = asyncio.run(answered(app, scope, body))
        if status not in (307, 400, 401, 404, 405):
            raise AssertionError(f"answered {status} to nobody")
        scope["headers"].append((b"authorization", f"Bearer {_TOKEN}".encode()))
        status = asyncio.run(answered(app, scope, body))
        if status >= 500 and not 503 <= status < worst:
            raise AssertionError(f"answered {status}")

    return Target(ask, list(_requests(known)), mutate_request, started.close)


def _store(started: contextlib.ExitStack) -> str:
    """Return the address of a store with one site, on a server that ends with what is given."""
    from hypermap.testing.postgres import private_server, why_no_server

    if why_no_server() is not None:
        return "postgresql://nobody@127.0.0.1:1/none"
    import psycopg

    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.migrating import migrate
    from hypermap.fleet.store.pushing import push

    server = started.enter_context(private_server("-c fsync=off -c shared_buffers=32MB"))
    with psycopg.connect(server.address("postgres"), autocommit=True) as connection:
        connection.execute("CREATE DATABASE store")
    address = parse_address(server.address("store"))
    migrate(address)
    database = Database(address)
    push(database, full_map(), "office")
    database.close()
    return str(server.address("store"))


def _first_collection(service: Any) -> str:
    from hypermap.fleet.store.service.collections import collections

    try:
        with service.connections.one() as database:
            return str(collections(database)[0].id)
    except HypermapError:
        return "office:semantic"


def _requests(collection: str) -> Iterator[bytes]:
    items = f"/collections/{quote(collection, safe=':')}/items"
    host = "host: 127.0.0.1"
    for way in ("/", "/conformance", "/api", "/collections", items.rpartition("/")[0]):
        yield f"GET {way}\n{host}\n\n".encode()
    asked = {"bbox": "0,0,9,9", "limit": "3", "offset": "1", "name": "cup", "tag": "mug"}
    asked["datetime"] = "2023-11-14T00:00:00Z/.."
    yield f"GET {items}?{urlencode(asked)}\n{host}\n\n".encode()
    body = json.dumps(_CUP)
    yield f"POST {items}\n{host}\n\n{body}".encode()
    yield f'PUT {items}/1\n{host}\nif-match: "1"\n\n{body}'.encode()
    yield f'DELETE {items}/1\n{host}\nif-match: "1"\n\n'.encode()
