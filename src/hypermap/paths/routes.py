"""The route graph of a map: rooms, doors and turns, connected by straight segments."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.paths.find import NoPath, distances, find_path
from hypermap.paths.free_space import FreeSpace
from hypermap.paths.planner import Planner
from hypermap.rooms.rooms import NO_ROOMS, Door, Room

_AROUND = 0.5  # [m] how far a path in a room may leave its outline, as in doors
_DECIMALS = 3  # of a meter; closer turns are merged


@dataclass(frozen=True, eq=False)
class RouteGraph:
    """Places as nodes, and straight segments that a robot can drive as edges.

    Attributes:
        frame_id: of all points.
        points_xy: of the nodes [m], shape (N, 2).
        stops: the room or door at each node; None for a turn on the way.
        edges: the nodes at both ends, the lower one first, int64, shape (M, 2).
        rooms: the room that each edge lies in.
        too_narrow: the doors that are too narrow for the robot; they have no node.
    """

    frame_id: str
    points_xy: NDArray[np.float64]
    stops: tuple[Room | Door | None, ...]
    edges: NDArray[np.int64]
    rooms: tuple[Room, ...]
    too_narrow: tuple[Door, ...]

    @property
    def lengths(self) -> NDArray[np.float64]:
        """How long the edges are [m], shape (M,)."""
        begin, end = (self.points_xy[self.edges[:, side]] for side in (0, 1))
        lengths: NDArray[np.float64] = np.hypot(*(end - begin).T)
        return lengths


def route_graph(planner: Planner) -> RouteGraph:
    """Return the route graph of a map with rooms, for the robot of a planner.

    In each room, shortest paths lead from its middle to its doors and from door to door. Their
    turns are nodes, so edges are straight. A room without a free place has no node.

    Raises:
        HypermapError: If the map has no rooms.
    """
    rooms = planner.places.rooms
    if rooms is None:
        raise HypermapError(NO_ROOMS)
    space, graph = planner.space, _Growing()
    passable: list[tuple[Door, NDArray[np.float64]]] = []
    too_narrow = []
    for door in rooms.doors:
        near = space.middle_of(door.line.buffer(space.grid.resolution), door.place_xy)
        if near is not None and door.lets_pass(space.settings.robot_radius):
            passable.append((door, near))
        else:
            too_narrow.append(door)
    for room in rooms:
        graph.add(room, [each for each in passable if room.id in each[0].rooms], space)
    return graph.done(space.frame_id, tuple(too_narrow))


class _Growing:
    """A route graph, room by room."""

    def __init__(self) -> None:
        self._points: list[NDArray[np.float64]] = []
        self._stops: list[Room | Door | None] = []
        self._nodes: dict[tuple[float, ...], int] = {}  # at rounded points
        self._edges: dict[tuple[int, int], Room] = {}

    def add(
        self, room: Room, doors: list[tuple[Door, NDArray[np.float64]]], space: FreeSpace
    ) -> None:
        """Add the paths in a room between its middle and its doors, given as points [m]."""
        inside = space.within(room.outline.buffer(_AROUND))
        if inside is None:
            return
        reached = np.isfinite(distances(inside, doors[0][1]).meters) if doors else None
        middle = inside.middle_of(room.outline, preferred=reached)
        places: list[tuple[Room | Door, NDArray[np.float64]]] = [*doors]
        if middle is not None:
            places.append((room, middle))
        for stop, point in places:
            self._node(point, stop)
        for (_, begin), (_, end) in itertools.combinations(places, 2):
            self._way(inside, begin, end, room)

    def done(self, frame_id: str, too_narrow: tuple[Door, ...]) -> RouteGraph:
        """Return the graph."""
        return RouteGraph(
            frame_id,
            np.array(self._points).reshape(-1, 2),
            tuple(self._stops),
            np.array(list(self._edges), dtype=np.int64).reshape(-1, 2),
            tuple(self._edges.values()),
            too_narrow,
        )

    def _way(
        self, space: FreeSpace, begin: NDArray[np.float64], end: NDArray[np.float64], room: Room
    ) -> None:
        try:
            points = find_path(space, begin, end)
        except NoPath:  # blocked by furniture
            return
        nodes = [self._node(point) for point in points]
        for one, other in itertools.pairwise(nodes):
            if one != other:
                self._edges.setdefault((min(one, other), max(one, other)), room)

    def _node(self, point: NDArray[np.float64], stop: Room | Door | None = None) -> int:
        """Return the number of the node at a point, which is made where there is none."""
        key = tuple(point.round(_DECIMALS).tolist())
        number = self._nodes.setdefault(key, len(self._points))
        if number == len(self._points):
            self._points.append(point)
            self._stops.append(stop)
        elif stop is not None:
            self._stops[number] = stop
        return number
