"""Whether trees of shapely could replace our own grids of boxes in a semantic layer.

Both answer the same questions to the same layer, in turns; only what finds boxes is another. The
trees are log-structured: what changes have written goes into a short list, which becomes a tree
when it is full, and trees of about the same size become one.

    python benchmarks/tree_index.py [--objects 1000000] [--repeat 3]

Source: O'Neil et al., The Log-Structured Merge-Tree, 1996.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from unittest import mock

import numpy as np
import shapely
from numpy.typing import NDArray
from suite.objects import Floor, floor

from hypermap.core.arrays import IntArray
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.store import object_log

BULK, ONE_BY_ONE = 100_000, 1000
_LISTED = 64  # boxes in no tree
_GROWTH = 8  # a tree takes in those before it that are not so many times smaller

Near = tuple[float, float, float, float, int]


class TreeGrid:
    """Answers like a `BoxGrid`, from one tree over the boxes."""

    cell = 1.0  # of no use to trees

    def __init__(self, boxes: NDArray[np.float64], sizes: NDArray[np.float64]) -> None:
        """Sort boxes, (N, 4), with their sizes, (N,), into a tree."""
        self._boxes, self._sizes = boxes, sizes
        self._tree = shapely.STRtree(shapely.box(*boxes.T))

    def near(self, x: float, y: float) -> list[Near]:
        """Return the boxes at one point, the smallest first."""
        rows = self._tree.query(shapely.points(x, y))
        if len(rows) > 1:
            rows.sort()
            rows = rows[np.argsort(self._sizes[rows], kind="stable")]
        return [(*self._boxes[row].tolist(), row) for row in rows.tolist()]

    def meeting(self, x0: float, y0: float, x1: float, y1: float) -> list[int]:
        """Return the rows of the boxes that meet a box, ascending."""
        rows: list[int] = np.sort(self._tree.query(shapely.box(x0, y0, x1, y1))).tolist()
        return rows

    def at_all(self, points_xy: NDArray[np.float64]) -> tuple[IntArray, IntArray]:
        """Return which of the points, (N, 2), lies in which box: places, and rows."""
        places, rows = self._tree.query(shapely.points(points_xy))
        return places, rows


class GrowingTrees:
    """Answers like `RecentBoxes`, from a few trees and a short list."""

    def __init__(self, capacity: int, _: float) -> None:
        """Make room for boxes."""
        self.boxes = np.zeros((capacity, 4))
        self._ends = [0]  # tree i holds the positions from its end to the next one
        self._trees: list[shapely.STRtree] = []
        self._listed: list[tuple[float, float, float, float]] = []

    def put(self, position: int, box: tuple[float, float, float, float]) -> None:
        """Add a box."""
        self.boxes[position] = box
        self._listed.append(box)
        if len(self._listed) < _LISTED:
            return
        size = len(self._listed)
        while self._trees and self._ends[-1] - self._ends[-2] < _GROWTH * size:
            size += self._ends[-1] - self._ends[-2]
            self._trees.pop()
            self._ends.pop()
        boxes = self.boxes[position + 1 - size : position + 1]
        self._trees.append(shapely.STRtree(shapely.box(*boxes.T)))
        self._ends.append(position + 1)
        self._listed = []

    def at(self, x: float, y: float, count: int) -> list[int]:
        """Return the positions below `count` of the boxes at one point."""
        found, end = [], self._ends[-1]
        for position, (x0, y0, x1, y1) in enumerate(self._listed, end):
            if x0 <= x <= x1 and y0 <= y <= y1:
                found.append(position)
        point = shapely.points(x, y)
        for start, tree in zip(self._ends, self._trees, strict=False):
            found += (tree.query(point) + start).tolist()
        return [position for position in found if position < count]

    def at_all(self, points_xy: NDArray[np.float64], count: int) -> tuple[IntArray, IntArray]:
        """Return which of the points, (N, 2), lies in which box: places, and positions."""
        return self._query(shapely.points(points_xy), count)

    def meeting(self, x0: float, y0: float, x1: float, y1: float, count: int) -> IntArray:
        """Return the positions below `count` of the boxes that meet a box, ascending."""
        return np.sort(self._query(shapely.box([x0], [y0], [x1], [y1]), count)[1])

    def _query(self, shapes: NDArray[np.object_], count: int) -> tuple[IntArray, IntArray]:
        listed = shapely.STRtree([shapely.box(*box) for box in self._listed])
        trees = zip(self._ends, [*self._trees, listed], strict=True)
        found = [np.add(tree.query(shapes), [[0], [start]]) for start, tree in trees]
        places, positions = np.concatenate(found, axis=1)
        was_there = positions < count
        return places[was_there], positions[was_there]


@contextmanager
def _index(name: str) -> Iterator[None]:
    """Let layers that are asked within find boxes by the grids or the trees."""
    if name == "grids":
        yield
        return
    with (
        mock.patch.object(object_log, "BoxGrid", TreeGrid),
        mock.patch.object(object_log, "RecentBoxes", GrowingTrees),
    ):
        yield


def _one_by_one(layer: SemanticLayer, points: list[list[float]]) -> None:
    for point in points:
        layer.value_at(point)


def _areas(layer: SemanticLayer, areas: list[shapely.Polygon]) -> None:
    for area in areas:
        layer.values_in(area)


def _change(layer: SemanticLayer, things: list[SemanticObject], rounds: int) -> None:
    """Add, move and remove one object after the other."""
    for number in range(rounds):
        added = layer.add(things[number % len(things)])
        layer.update(added, things[(number + 1) % len(things)])
        layer.remove(added)


def _seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _measure(world: Floor, round_: int) -> tuple[dict[str, float], list[NDArray[np.int64]]]:
    """Return figures of processor time by name, in us but for the first, and answers."""
    layer = world.layer()
    table = layer.table
    for column in ("boxes", "areas", "centroids"):  # which both need, and the table makes once
        getattr(table, column)
    figures = {"the first question [s]": _seconds(lambda: layer.value_at(world.points))}
    figures["a point of 100,000"] = _seconds(lambda: layer.value_at(world.points)) / BULK
    few = world.points[:ONE_BY_ONE].tolist()
    new = world.points[(round_ + 1) * ONE_BY_ONE :][:ONE_BY_ONE].tolist()
    areas = list(np.asarray(shapely.box(*world.areas[0].T)))
    _one_by_one(layer, few)
    figures["one point"] = _seconds(lambda: _one_by_one(layer, few)) / ONE_BY_ONE
    figures["one point, new place"] = _seconds(lambda: _one_by_one(layer, new)) / ONE_BY_ONE
    _areas(layer, areas)
    figures["1 m2"] = _seconds(lambda: _areas(layer, areas)) / len(areas)
    boxes = np.asarray(shapely.box(*world.points[:1000].T, *(world.points[:1000] + 0.5).T))
    things = [SemanticObject("class 1", box) for box in boxes]
    rounds = len(world.shapes) // 30  # so many that the log is full once
    figures["a change"] = _seconds(lambda: _change(layer, things, rounds)) / (3 * rounds)
    half = max(1, len(world.shapes) // 100)
    _change(layer, things, half)  # so that there is something behind the table
    figures["a point of 100,000, changed"] = _seconds(lambda: layer.value_at(world.points)) / BULK
    figures["one point, changed"] = _seconds(lambda: _one_by_one(layer, few)) / ONE_BY_ONE
    figures["1 m2, changed"] = _seconds(lambda: _areas(layer, areas)) / len(areas)
    answers = [layer.value_at(world.points), *(layer.values_in(area).values for area in areas)]
    return {name: value * (1 if "[s]" in name else 1e6) for name, value in figures.items()}, answers


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=int, default=1_000_000)
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    world = floor(arguments.objects, BULK)
    kept: dict[str, list[dict[str, float]]] = {"grids": [], "trees": []}
    for round_ in range(arguments.repeat):
        answers = []
        for name, runs in kept.items():
            with _index(name):
                figures, answer = _measure(world, round_)
            runs.append(figures)
            answers.append(answer)
        for one, other in zip(*answers, strict=True):
            np.testing.assert_array_equal(one, other)
    print(f"{arguments.objects:,} objects, medians of {arguments.repeat} in turns, answers equal")
    print("| work | grids | trees | ratio |\n| --- | ---: | ---: | ---: |")
    for work in kept["grids"][0]:
        ours, theirs = (statistics.median(run[work] for run in runs) for runs in kept.values())
        unit = "" if "[s]" in work else " [us]"
        print(f"| {work}{unit} | {ours:.3g} | {theirs:.3g} | x{theirs / ours:.2f} |")


if __name__ == "__main__":
    main()
