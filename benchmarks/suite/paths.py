"""Paths, distances and frontiers: how long, how fast, and beside scikit-image and networkx.

The known questions are those of the folder `paths` of the real data, whose README tells where they
come from.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from hypermap import GridGeometry, Hypermap, OccupancyLayer
from hypermap.core.arrays import BoolArray
from hypermap.exploration import Explorer
from hypermap.paths import FreeSpace, PathSettings, distances, find_path
from hypermap.paths.find import length_of
from suite.race import Disagreement, Figure, Race, Row, Settings, library, race, seconds_of

_LONG = 20.0  # cells; shorter questions say little of a percentage
_SECONDS = {"path": 0.3, "sweep": 1.0, "frontiers": 5.0}  # asked for 4000 x 4000 cells
_PEERS = {"MCP_Geometric": 3.0, "networkx": 50.0}  # how many times faster we mean to be
_DIAGONAL = 1.09  # by how much eight directions are longer than straight lines, at most


def rows(settings: Settings) -> Iterator[Row]:
    """Yield lengths against known ones, and times on large grids."""
    yield from _lengths(settings)
    for side in (200,) if settings.quick else (500, 4000):
        for name, free in (("free", np.ones((side, side), bool)), ("boxes", _boxes(side))):
            yield from _times(f"{side} x {side} cells, {name}", free, side, settings)
        yield _frontiers(side, settings)


def _lengths(settings: Settings) -> Iterator[Row]:
    folder = settings.folder("paths")
    with Image.open(folder / "cape.png") as image:
        free = np.asarray(image)[::-1] == 254
    with (folder / "cape.csv").open(encoding="utf-8") as file:
        questions = [[float(text) for text in row] for row in list(csv.reader(file))[1:]]
    space, height = _space(free), len(free)
    errors, times = [], []
    for x0, y0, x1, y1, optimum in questions:
        begin = time.perf_counter()
        points = find_path(space, [x0, height - y0], [x1, height - y1])
        times.append(time.perf_counter() - begin)
        if optimum > _LONG:
            errors.append(abs(length_of(points) / optimum - 1) * 100)
    note = f"{len(errors)} of {len(questions)} paths, longer than {_LONG:g} cells"
    mean = (float(np.mean(errors)),)
    yield Figure("length of a path off the optimum, mean", mean, "%", 1.0, True, note)
    yield Figure("length of a path off the optimum, worst", (max(errors),), "%", 3.0, True, note)
    yield Figure("a path of 768 x 768 cells", tuple(times[1:]), "s", note="AcrosstheCape")


def _times(what: str, free: BoolArray, side: int, settings: Settings) -> Iterator[Row]:
    space = _space(free)
    start, goal = (np.array(place) + 0.5 for place in ((1, 1), (side - 2, side // 2)))
    _ = space.strips  # prepared once for a robot

    def path() -> float:
        return length_of(find_path(space, start, goal))

    def sweep() -> float:
        return float(distances(space, start).at(goal)[0])

    for name, ours in (("path", path), ("sweep", sweep)):
        asked = _SECONDS[name] if side == 4000 else None
        yield Figure(f"a {name}, {what}", _timed(ours, settings.repeat), "s", asked, True)
        for peer, theirs in _peers(free, start, goal, name).items():
            if peer == "networkx" and side > 500:
                continue  # a node per cell takes all memory
            yield _raced(f"a {name}, {what}", peer, ours, theirs, settings, side > 500)


def _frontiers(side: int, settings: Settings) -> Figure:
    """Return how long it takes to find the frontiers of a map of boxes, two fifths unknown."""
    count = math.ceil(side / 8)
    patches = np.random.default_rng(2).normal(size=(count, count))
    smooth = np.kron(ndimage.gaussian_filter(patches, 4), np.ones((8, 8)))[:side, :side]
    cells = np.where(_boxes(side), 0, 100)
    cells[smooth > np.quantile(smooth, 0.6)] = -1
    grid = GridGeometry(side, side, 0.05)
    hypermap = Hypermap([OccupancyLayer("occupancy", "map", grid, cells)])
    robot = PathSettings(robot_radius=0.2)
    far = ndimage.distance_transform_edt(cells == 0)
    row, col = np.unravel_index(np.argmax(far), far.shape)
    start = grid.centers([row], [col])[0]
    found = Explorer(hypermap, start, robot).frontiers()

    def look() -> int:
        return len(Explorer(hypermap, start, robot).frontiers())

    note = f"{len(found)} frontiers for a robot of 0.2 m, from the map on"
    seconds = _timed(look, settings.repeat)
    asked = _SECONDS["frontiers"] if side == 4000 else None
    return Figure(f"frontiers, {side} x {side} cells, boxes", seconds, "s", asked, True, note)


def _peers(
    free: BoolArray, start: NDArray[np.float64], goal: NDArray[np.float64], work: str
) -> dict[str, Callable[[], float]]:
    """Return what peers do for a path, or for a sweep over all cells."""
    graph = library("skimage.graph")
    costs = np.where(free, 1.0, -1.0)  # it does not enter negative ones
    first, last = ((int(y), int(x)) for x, y in (start, goal))

    def mcp() -> float:
        search = graph.MCP_Geometric(costs, fully_connected=True)
        found, _ = search.find_costs([first], [last] if work == "path" else None)
        return float(found[last])

    peers = {"MCP_Geometric": mcp}
    if free.size <= 500 * 500:
        peers["networkx"] = _by_networkx(free, first, last, work)
    return peers


def _by_networkx(
    free: BoolArray, first: tuple[int, int], last: tuple[int, int], work: str
) -> Callable[[], float]:
    networkx = library("networkx")
    graph = networkx.Graph()
    for rows, cols, length in (
        (0, 1, 1.0),
        (1, 0, 1.0),
        (1, 1, math.sqrt(2)),
        (1, -1, math.sqrt(2)),
    ):
        height, width = free.shape
        r, c = np.nonzero(free)
        there = (r + rows < height) & (c + cols >= 0) & (c + cols < width)
        r, c = r[there], c[there]
        both = free[r + rows, c + cols]
        edges = np.column_stack([r, c, r + rows, c + cols])[both].tolist()
        graph.add_weighted_edges_from(((a, b), (d, e), length) for a, b, d, e in edges)

    def run() -> float:
        if work == "path":
            return float(networkx.dijkstra_path_length(graph, first, last))
        return float(networkx.single_source_dijkstra_path_length(graph, first)[last])

    return run


def _raced(
    work: str,
    peer: str,
    ours: Callable[[], float],
    theirs: Callable[[], float],
    settings: Settings,
    is_large: bool,
) -> Race:
    def agree(one: float, other: float) -> str:
        if not 1 - 1e-3 <= other / one <= _DIAGONAL:
            raise Disagreement(f"{one:.1f} cells in any direction, {other:.1f} in eight")
        return f"{one:.1f} cells in any direction, {other:.1f} in eight"

    if not is_large:
        return race(work, peer, ours, theirs, agree, settings, _PEERS[peer])
    seconds, answer = seconds_of(theirs)  # once, as it takes a minute
    mine = _timed(ours, settings.repeat)
    return Race(work, peer, mine, (seconds,), agree(ours(), answer), _PEERS[peer])


def _timed(work: Callable[[], float], repeat: int) -> tuple[float, ...]:
    work()  # compiles
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return tuple(times)


def _boxes(side: int) -> BoolArray:
    """Return free cells with boxes that block about a sixth of them."""
    rng = np.random.default_rng(1)
    free = np.ones((side, side), dtype=bool)
    for _ in range(side * side // 5000):
        row, col = rng.integers(3, side - 60, 2)
        height, width = rng.integers(3, 55, 2)
        free[row : row + height, col : col + width] = False
    free[:3] = free[-3:] = free[:, -3:] = True
    return free


def _space(free: BoolArray) -> FreeSpace:
    height, width = free.shape
    grid = GridGeometry(width, height, 1.0)
    return FreeSpace.of(OccupancyLayer("occupancy", "map", grid, ~free))
