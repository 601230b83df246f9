"""Rooms and doors as a graph."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import MissingExtra
from hypermap.rooms.rooms import Rooms


@dataclass(frozen=True, eq=False)
class Graph:
    """Rooms as nodes and doors as edges, as plain arrays.

    Attributes:
        ids: of the rooms, int64, shape (N,).
        names: of the rooms, shape (N,).
        places_xy: a point in each room [m], shape (N, 2).
        edges: both rooms of each door, as rows of the arrays above, int64, shape (M, 2).
        doors_xy: middle of each door [m], shape (M, 2).
        widths: of each door [m], shape (M,).
    """

    ids: NDArray[np.int64]
    names: tuple[str, ...]
    places_xy: NDArray[np.float64]
    edges: NDArray[np.int64]
    doors_xy: NDArray[np.float64]
    widths: NDArray[np.float64]

    def parts(self) -> NDArray[np.int64]:
        """Return the connected component of each room, as a number, shape (N,)."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        ones = np.ones(len(self.edges))
        matrix = coo_array((ones, tuple(self.edges.T)), shape=(len(self.ids), len(self.ids)))
        return connected_components(matrix, directed=False)[1].astype(np.int64)

    def is_reachable(self, start: int, goal: int) -> bool:
        """Return whether doors lead from one room to another, which are given by id.

        Raises:
            ValueError: If there is no such room.
        """
        parts = self.parts()
        one, other = (parts[self._row(number)] for number in (start, goal))
        return bool(one == other)

    def to_networkx(self) -> Any:
        """Return a `networkx.MultiGraph` whose nodes are the rooms' ids.

        Nodes have `name` and `place`, edges `width` and `place`.

        Raises:
            MissingExtra: If networkx is not installed.
        """
        try:
            import networkx
        except ImportError:
            raise MissingExtra("a graph of networkx", "graph") from None
        result: Any = networkx.MultiGraph()
        for number, name, place in zip(self.ids, self.names, self.places_xy, strict=True):
            result.add_node(int(number), name=name, place=tuple(place.tolist()))
        for rows, place, width in zip(self.edges, self.doors_xy, self.widths, strict=True):
            one, other = self.ids[rows].tolist()
            result.add_edge(one, other, width=float(width), place=tuple(place.tolist()))
        return result

    def _row(self, number: int) -> int:
        (rows,) = np.nonzero(self.ids == number)
        if not len(rows):
            raise ValueError(f"there is no room with the id {number}")
        return int(rows[0])


def graph(rooms: Rooms, robot_radius: float = 0.0) -> Graph:
    """Return the rooms and those doors through which a robot of a radius [m] fits.

    Raises:
        ValueError: If the radius is negative or not finite.
    """
    if not 0 <= robot_radius < np.inf:
        raise ValueError(f"a robot's radius is 0 or more, got {robot_radius}")
    doors = [door for door in rooms.doors if door.lets_pass(robot_radius)]
    row = {room.id: place for place, room in enumerate(rooms)}
    points = [room.outline.representative_point() for room in rooms]
    return Graph(
        np.array([room.id for room in rooms], dtype=np.int64),
        tuple(room.name for room in rooms),
        np.array([[point.x, point.y] for point in points]).reshape(-1, 2),
        np.array([[row[i] for i in door.rooms] for door in doors], dtype=np.int64).reshape(-1, 2),
        np.array([door.place_xy for door in doors]).reshape(-1, 2),
        np.array([door.width for door in doors]),
    )
