"""Questions in English to a map of many objects, and what tools of agents add to them."""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from hypermap import Hypermap, Pose2D, SemanticLayer, SemanticObject, save_map
from hypermap.agents import Tool
from hypermap.agents.looking import Looking
from hypermap.agents.open_map import OpenMap
from hypermap.agents.toolbox import tools_of
from hypermap.questions.asking import answer_to
from suite.race import Figure, Row, Settings, run_of

if TYPE_CHECKING:
    from mcp import Client

NAMES = ("chair", "table", "cup", "monitor", "plant", "sofa", "book", "lamp", "bottle", "printer")
SPACING = 1.0  # [m] between objects
QUESTIONS = (
    "where is the nearest cup?",
    "how many chairs are there?",
    "which chairs are within 2 m of me?",
    "which chairs are within 1 m of a table?",
    "what is new since 2026-11-20?",
    "which room has the most chairs?",
    "what is in this room?",
)
ROOMS = 10  # along each side
ASKED, ASKED_BEYOND = 50.0, 20.0  # [ms] for a question, and for a tool's call beyond it


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the time of each question, and of a tool's call beyond the question itself."""
    count = 1000 if settings.quick else 100_000
    hypermap, side = _floor(count)
    asker = Pose2D(side / 2, side / 2)

    def milliseconds(work: Callable[[], object]) -> tuple[float, ...]:
        work()  # builds the indexes
        run = run_of(work)
        return tuple(1e3 * run() for _ in range(settings.repeat))

    for question in QUESTIONS:
        values = milliseconds(partial(answer_to, hypermap, question, asker))
        work = f"{question!r} among {count:,} objects"
        yield Figure(work, values, "ms", ASKED, less_is_better=True)

    file = settings.build / "asking.hmap"
    save_map(hypermap, file)
    looking, tools = _tools(file)
    start = side / 2, side / 2
    arguments = {"name": "cup", "start": start}
    alone = milliseconds(partial(looking.nearest, name="cup", start=start))
    tool = next(tool for tool in tools if tool.name == "nearest")
    values = _beyond(alone, milliseconds(partial(tool, arguments)))
    yield Figure(
        "a tool's call beyond its question", values, "ms", ASKED_BEYOND, less_is_better=True
    )
    if importlib.util.find_spec("mcp") is not None:
        values = _beyond(alone, _over_mcp(tools, looking, arguments, settings))
        work = "a call over MCP beyond its question, client and server in one process"
        yield Figure(work, values, "ms", ASKED_BEYOND, less_is_better=True)


def _floor(count: int) -> tuple[Hypermap, float]:
    """Return a map of so many objects, and the length of its sides [m]."""
    rng = np.random.default_rng(count)
    side = SPACING * float(np.sqrt(count))
    corners = rng.uniform(0, side, (count, 2))
    sizes = rng.uniform(0.1, 1.0, (count, 1))
    boxes = np.asarray(shapely.box(*corners.T, *(corners + sizes).T))
    first = 1_795_000_000.0 + rng.uniform(-30, 30, count) * 86_400
    names = rng.integers(0, len(NAMES), count)
    things = [
        SemanticObject(NAMES[name], box, existence=3.0, first_seen=seen, last_seen=seen + 3600)
        for name, box, seen in zip(names.tolist(), boxes, first.tolist(), strict=True)
    ]
    edges = np.linspace(0, side, ROOMS + 1)
    outlines = [
        shapely.box(x0, y0, x1, y1)
        for x0, x1 in itertools.pairwise(edges)
        for y0, y1 in itertools.pairwise(edges)
    ]
    rooms = [SemanticObject(f"office {number}", box) for number, box in enumerate(outlines)]
    layers = [SemanticLayer("semantic", "map", things), SemanticLayer("rooms", "map", rooms)]
    return Hypermap(layers), side


def _tools(file: Path) -> tuple[Looking, list[Tool]]:
    opened = OpenMap(file)
    looking = Looking(opened.current)
    return looking, tools_of(opened, looking, allow_edits=False)


def _beyond(alone: tuple[float, ...], with_it: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(whole - part for part, whole in zip(alone, with_it, strict=True))


def _over_mcp(
    tools: list[Tool], looking: Looking, arguments: dict[str, Any], settings: Settings
) -> tuple[float, ...]:
    """Return the milliseconds of a call in each run."""
    import time

    import anyio
    from mcp import Client

    from hypermap.agents.mcp_server import server_of

    calls = 20

    async def run(client: Client) -> float:
        start = time.perf_counter()
        for _ in range(calls):
            result = await client.call_tool("nearest", arguments)
            assert not result.is_error
        return 1e3 * (time.perf_counter() - start) / calls

    async def runs() -> tuple[float, ...]:
        async with Client(server_of(tools, looking)) as client:
            await run(client)
            return tuple([await run(client) for _ in range(settings.repeat)])

    return anyio.run(runs)
