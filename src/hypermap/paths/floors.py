"""Paths over the floors of a building: maps that lifts and stairs connect.

A map's metadata name its `floor`, and under `connectors` the lifts and stairs that lead from it to
places on other maps.
"""

from __future__ import annotations

import heapq
import math
import os.path
import pathlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.masks import Zone
from hypermap.paths.find import NoPath
from hypermap.paths.places import Place
from hypermap.paths.planner import Approach, Path, Planner
from hypermap.paths.settings import STAND_OFF, PathSettings

FLOOR, CONNECTORS = "floor", "connectors"
"""Keys of a map's metadata."""

Point: TypeAlias = tuple[float, float]
_Node: TypeAlias = tuple[str, Point]  # a map's file and a point on it


@dataclass(frozen=True)
class Connector:
    """A lift or stairs from a place on one map to a place on another; they lead both ways.

    Attributes:
        kind: "lift", "stairs", or another word.
        at_xy: its position on the map that contains it, in the base frame [m].
        to: file of the other map, relative to the folder of the one that contains it.
        there_xy: the place on the other map, in its base frame [m].
        name: its name; may be empty.
        length: meters that it adds to a path.

    Raises:
        ValueError: If a number is not finite, or the length is negative.
    """

    kind: str
    at_xy: Point
    to: str
    there_xy: Point
    name: str = ""
    length: float = 0.0

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.at_xy, *self.there_xy))):
            raise ValueError(f"places must be finite, got {self.at_xy} and {self.there_xy}")
        if not 0 <= self.length < math.inf:
            raise ValueError(f"a length must be 0 or more, got {self.length}")

    @property
    def title(self) -> str:
        """Its name, such as "lift A"."""
        return self.name or self.kind


def connectors_on(hypermap: Hypermap) -> tuple[Connector, ...]:
    """Return the lifts and stairs in a map's metadata.

    Raises:
        HypermapError: If an entry is none.
    """
    entries = hypermap.metadata.get(CONNECTORS, [])
    if not isinstance(entries, list):
        raise HypermapError(f"metadata: {CONNECTORS} must be a list, got {type(entries).__name__}")
    return tuple(_connector(entry, number) for number, entry in enumerate(entries))


def with_connector(hypermap: Hypermap, connector: Connector) -> Hypermap:
    """Return a map with one more lift or stairs.

    It replaces one to the same map that has the same name or, without a name, begins at the same
    place.

    Raises:
        HypermapError: If the map's connectors cannot be read.
    """
    kept = [other for other in connectors_on(hypermap) if not _is_same(other, connector)]
    other = hypermap.with_layers(hypermap)
    other.metadata[CONNECTORS] = [_entry(each) for each in [*kept, connector]]
    return other


def relink(hypermap: Hypermap, source: str | pathlib.Path, target: str | pathlib.Path) -> None:
    """Let the lifts and stairs of a map lead to the same files when it is saved in another folder.

    Args:
        hypermap: the map; its metadata change.
        source: the file that it was read from.
        target: the file that it will be saved to.

    Raises:
        HypermapError: If the map's connectors cannot be read.
    """
    if pathlib.Path(source).absolute().parent == pathlib.Path(target).absolute().parent:
        return
    hypermap.metadata[CONNECTORS] = [
        _entry(each) | {"to": path_from(target, other_file(str(source), each))}
        for each in connectors_on(hypermap)
    ]


def path_from(file: str | pathlib.Path, other: str | pathlib.Path) -> str:
    """Return how a connector of the map in a file names another map; see `other_file`."""
    try:
        return os.path.relpath(other, pathlib.Path(file).parent)
    except ValueError:  # it is on another drive of Windows
        return str(pathlib.Path(other).absolute())


@dataclass(frozen=True, eq=False)
class FloorPart:
    """The part of a path that lies on one floor.

    Attributes:
        map: file of the map.
        floor: what the map calls its floor; empty if it does not.
        path: in the base frame of the map.
    """

    map: str
    floor: str
    path: Path


@dataclass(frozen=True, eq=False)
class FloorPath:
    """A path over floors.

    Attributes:
        parts: one for each floor on the way, in order.
        connectors: the lifts and stairs between them, with the names in the maps that contain them.
        length: of all parts, and the lengths that lifts and stairs add [m].
        approach: where the robot stands in front of the object; None if the goal is not an object.
    """

    parts: tuple[FloorPart, ...]
    connectors: tuple[Connector, ...]
    length: float
    approach: Approach | None = None


@dataclass(frozen=True)
class _Hop:
    """One way through a connector."""

    leaves: _Node
    arrives: _Node
    connector: Connector


class Building:
    """Plans paths over maps that lifts and stairs connect.

    Args:
        maps: by file; connectors lead only to maps that are listed here.
        settings: the robot; None for a point.
        keepout: zones around objects that the robot's center must not enter.
        occupancy: name of the layer; None for the only one of each map.

    Raises:
        HypermapError: If the connectors of a map cannot be read.
    """

    def __init__(
        self,
        maps: Mapping[str, Hypermap],
        settings: PathSettings | None = None,
        *,
        keepout: Iterable[Zone] = (),
        occupancy: str | None = None,
    ) -> None:
        self._maps = dict(maps)
        self._settings, self._keepout, self._occupancy = settings, tuple(keepout), occupancy
        self._planners: dict[str, Planner] = {}
        self._hops: list[_Hop] = []
        for file, hypermap in self._maps.items():
            for each in connectors_on(hypermap):
                here, there = (file, each.at_xy), (other_file(file, each), each.there_xy)
                if there[0] in self._maps:
                    self._hops += [_Hop(here, there, each), _Hop(there, here, each)]

    def planner(self, file: str) -> Planner:
        """Return the planner of one map.

        Raises:
            HypermapError: If there is no such map here, or none can plan over it.
        """
        if file not in self._maps:
            known = ", ".join(self._maps)
            raise HypermapError(
                f"no lift or stairs leads to {file}; known: {known}; `hypermap connect` adds one"
            )
        if file not in self._planners:
            self._planners[file] = Planner(
                self._maps[file],
                self._settings,
                keepout=self._keepout,
                occupancy=self._occupancy,
            )
        return self._planners[file]

    def path(
        self, start: tuple[str, Place], goal: tuple[str, Place], distance: float = STAND_OFF
    ) -> FloorPath:
        """Return the shortest path between places, each given by the file of a map and a place.

        Args:
            start: from where.
            goal: to where; to an object it leads to where a robot can stand in front of it.
            distance: from there to the object [m].

        Raises:
            NoPath: If none leads there.
            HypermapError: If there is no such map or place, or the robot cannot be there.
        """
        begin, end = self._node(start), self._node(goal)
        parts, at = [], begin
        hops = self._hops_between(begin, end)
        for hop in hops:
            parts.append(self._part(at, hop.leaves[1]))
            at = hop.arrives
        planner, place = self.planner(end[0]), goal[1]
        approach = None
        if isinstance(place, str | int) and planner.places.room(place) is None:
            approach = planner.approach(place, distance, at[1])
            assert approach.path is not None
            parts.append(FloorPart(end[0], self._floor(end[0]), approach.path))
        else:
            parts.append(self._part(at, end[1]))
        connectors = tuple(hop.connector for hop in hops)
        length = sum(part.path.length for part in parts) + sum(each.length for each in connectors)
        return FloorPath(tuple(parts), connectors, length, approach)

    def _node(self, where: tuple[str, Place]) -> _Node:
        file, place = where
        x, y = self.planner(file).point_of(place).tolist()
        return file, (x, y)

    def _part(self, at: _Node, to: Point) -> FloorPart:
        return FloorPart(at[0], self._floor(at[0]), self.planner(at[0]).path(at[1], to))

    def _floor(self, file: str) -> str:
        return str(self._maps[file].metadata.get(FLOOR, ""))

    def _hops_between(self, begin: _Node, end: _Node) -> list[_Hop]:
        """Return the lifts and stairs of the shortest path, by Dijkstra's algorithm."""
        far = {begin: 0.0}
        last: dict[_Node, tuple[_Node, _Hop | None]] = {}
        waiting, done = [(0.0, begin)], set()
        reasons: list[str] = []
        while waiting:
            length, node = heapq.heappop(waiting)
            if node == end:
                break
            if node in done:
                continue
            done.add(node)
            for other, more, hop in self._ways(node, end, begin, reasons):
                if length + more < far.get(other, math.inf):
                    far[other], last[other] = length + more, (node, hop)
                    heapq.heappush(waiting, (length + more, other))
        else:
            why = "".join(f"; {reason}" for reason in dict.fromkeys(reasons))
            raise NoPath(
                f"no path leads from ({begin[1][0]:.2f}, {begin[1][1]:.2f}) on {begin[0]} to "
                f"({end[1][0]:.2f}, {end[1][1]:.2f}) on {end[0]}{why}"
            )
        hops, node = [], end
        while node != begin:
            node, hop = last[node]
            hops += [hop] if hop else []
        return hops[::-1]

    def _ways(
        self, node: _Node, end: _Node, begin: _Node, reasons: list[str]
    ) -> Iterator[tuple[_Node, float, _Hop | None]]:
        """Yield the neighbors of a node, with the distance and the lift or stairs."""
        here = [hop for hop in self._hops if hop.leaves == node]
        for hop in here:
            yield hop.arrives, hop.connector.length, hop
        file, point = node
        planner = self.planner(file)
        if node != begin:
            try:
                planner.space.place(point, f"{here[0].connector.title} on {file}")
            except HypermapError as error:  # the exit is blocked
                reasons.append(str(error))
                return
        others = [hop.leaves for hop in self._hops if hop.leaves[0] == file]
        others += [end] if end[0] == file else []
        lengths = planner.distances(point).at(np.reshape([xy for _, xy in others], (-1, 2)))
        for other, length in zip(others, lengths.tolist(), strict=True):
            yield other, length, None


def other_file(file: str, connector: Connector) -> str:
    """Return the file of the map that a connector leads to.

    >>> other_file("maps/ground.hmap", Connector("lift", (0, 0), "upper.hmap", (1, 1)))
    'maps/upper.hmap'
    """
    return os.path.normpath(pathlib.Path(file).parent / connector.to)


def _is_same(one: Connector, other: Connector) -> bool:
    if one.to != other.to:
        return False
    return one.name == other.name if other.name else one.at_xy == other.at_xy


def _entry(connector: Connector) -> dict[str, Any]:
    """Return the entry of the metadata that describes a connector."""
    return {
        "kind": connector.kind,
        "name": connector.name,
        "at": list(map(float, connector.at_xy)),
        "to": connector.to,
        "there": list(map(float, connector.there_xy)),
        "length": float(connector.length),
    }


def _connector(entry: Any, number: int) -> Connector:
    """Return the connector that an entry of the metadata describes."""
    try:
        (x, y), (there_x, there_y) = entry["at"], entry["there"]
        if not isinstance(entry["to"], str):
            raise TypeError("`to` is not a file")
        return Connector(
            str(entry.get("kind", "lift")),
            (float(x), float(y)),
            entry["to"],
            (float(there_x), float(there_y)),
            str(entry.get("name", "")),
            float(entry.get("length", 0.0)),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise HypermapError(
            f"metadata: {CONNECTORS}[{number}] is not a lift or stairs; expected at: [x, y], "
            f"to: FILE, there: [x, y] ({error})"
        ) from None
