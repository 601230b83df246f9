"""Paths over a whole map: to points, objects and rooms, in its base frame."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arguments import check_kind
from hypermap.core.arrays import IntArray, PointsLike, as_point_xy
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import FoundObject, Hypermap
from hypermap.core.layer import check_count
from hypermap.core.masks import Zone
from hypermap.core.occupancy import OccupancyLayer
from hypermap.paths.find import Distances, NoPath, distances, find_path, length_of
from hypermap.paths.free_space import FreeSpace
from hypermap.paths.narrowest import why_no_path
from hypermap.paths.passed import passed
from hypermap.paths.places import Place, Places, title
from hypermap.paths.settings import STAND_OFF, PathSettings
from hypermap.paths.sight import Sight
from hypermap.rooms.rooms import Door, Room

REACH = 1.0
"""Maximum distance [m] from which a visible object counts as reached."""

_ROOM_TO_MOVE = 20  # cells; up to this clearance, more clearance makes a place better


@dataclass(frozen=True, eq=False)
class Path:
    """A path over free space, in the base frame of the map.

    Attributes:
        points_xy: from the start to the goal [m], shape (N, 2).
        length: of it [m].
        rooms: those that it passes, in order; none where the map has no layer of rooms.
        doors: those that it passes, in order.
    """

    points_xy: NDArray[np.float64]
    length: float
    rooms: tuple[Room, ...] = ()
    doors: tuple[Door, ...] = ()

    @property
    def line(self) -> shapely.LineString:
        """The path as a geometry."""
        return shapely.LineString(self.points_xy)


@dataclass(frozen=True, eq=False)
class Approach:
    """Where a robot can stand to face an object.

    Attributes:
        pose: of the robot in the base frame; it looks at the object's centroid.
        distance: from there to the object's shape [m].
        object: the object.
        path: that leads there; None where no start was given.
    """

    pose: Pose2D
    distance: float
    object: FoundObject
    path: Path | None = None


class Planner:
    """Plans paths over a map for a robot; shared data are prepared once.

    Attributes:
        space: where the robot can be, in the base frame.
        places: the rooms and objects of the map.
        sight: lines of sight, prepared at the first access.

    Args:
        hypermap: the map, which must not change meanwhile.
        settings: the robot; None for a point.
        keepout: zones around objects, or areas in the base frame, that the robot's center stays
            out of.
        occupancy: name of the layer; None for the only one.

    Raises:
        HypermapError: If there is not one such layer, or it is empty.
        FrameError: If its frame is not connected to the base frame.
        TypeError: If it is not a map, or the settings or a zone are something else.

    >>> import numpy as np
    >>> from hypermap import GridGeometry, Hypermap, OccupancyLayer
    >>> cells = np.zeros((20, 40), dtype=np.int8)
    >>> cells[:15, 20] = 100  # a wall with a gap at its upper end
    >>> office = Hypermap([OccupancyLayer("occupancy", "map", GridGeometry(40, 20, 0.1), cells)])
    >>> path = Planner(office).path([1.0, 1.0], [3.0, 1.0])
    >>> path.points_xy.round(2).tolist(), round(path.length, 2)
    ([[1.0, 1.0], [2.0, 1.5], [2.1, 1.5], [3.0, 1.0]], 2.25)
    """

    def __init__(
        self,
        hypermap: Hypermap,
        settings: PathSettings | None = None,
        *,
        keepout: Iterable[Zone | BaseGeometry] = (),
        occupancy: str | None = None,
    ) -> None:
        check_kind(hypermap, Hypermap)
        areas = [area for zone in keepout for area in _areas(hypermap, zone)]
        self.space = FreeSpace.of(_in_base_frame(hypermap, occupancy), settings, areas)
        self.places = Places(hypermap)

    def path(self, start: Place, goal: Place) -> Path:
        """Return the shortest path between two places, or the cheapest, by the settings.

        A path starts from where an object is in sight. To an object, it leads to where the robot
        can stand in front of it (`approach`). The place of a room is its middle.

        Raises:
            NoPath: If none leads there.
            HypermapError: If there is no such place, several have that name, or the robot cannot be
                there.
        """
        begin = self.point_of(start)
        if isinstance(goal, str | int) and self.places.room(goal) is None:
            there = self.approach(goal, start=begin).path
            assert there is not None
            return there
        return self._path(begin, self.point_of(goal))

    def distances(self, start: Place) -> Distances:
        """Return the lengths of the shortest paths to all cells, in one sweep.

        Raises:
            HypermapError: If there is no such place, or the robot cannot be there.
        """
        return distances(self.space, self.point_of(start))

    def nearest(
        self,
        what: str | float | None,
        start: Place,
        k: int | None = 1,
        layer: str | None = None,
    ) -> list[FoundObject]:
        """Return the k objects of a name or id with the shortest paths to them, nearest first.

        An object is reached where it is in sight and at most a meter away; its distance is the
        length of the path to there, and from there to its shape. Others are left out.

        Args:
            what: which objects; None for all.
            start: from where.
            k: how many at most; None for all.
            layer: the one that contains them; None for all but the layer of rooms.

        Raises:
            HypermapError: If there is no such place, or the robot cannot be there.
            ValueError: If `k` is below 1.
        """
        if k is not None:
            check_count(k)
        known = self.places.objects(layer)
        asked = [i for i in known if what is None or what in (i.object.name, i.object.id)]
        return self.by_path(asked, start)[:k]

    def by_path(self, objects: Iterable[FoundObject], start: Place) -> list[FoundObject]:
        """Return objects with the lengths of the shortest paths to them, nearest first.

        Unreachable objects are left out; raises like `nearest`.
        """
        meters = self.distances(start).meters.ravel()
        found = []
        for item in objects:
            cells, gaps = self.sight.around(item.object.footprint, 0.0, REACH)
            far = meters[cells] + gaps
            chosen = self.sight.first_that_sees(item.object.footprint, cells, far)
            if chosen is not None:
                found.append(replace(item, distance=float(far[chosen])))
        return sorted(found, key=lambda item: item.distance or 0.0)

    def approach(
        self, what: str | int, distance: float = STAND_OFF, start: Place | None = None
    ) -> Approach:
        """Return where a robot can stand, facing an object that no wall hides.

        Args:
            what: an object's id, its name, or both, such as "cup 3".
            distance: from the robot's center to the object's shape [m].
            start: choose the place with the shortest path from here; None to prefer distance from
                walls.

        Raises:
            NoPath: If it cannot be reached; it says why.
            HypermapError: If there is no such object, several have that name, or the distance is
                below the robot's radius.
        """
        radius = self.space.settings.robot_radius
        if not radius <= distance < math.inf:
            raise HypermapError(
                f"a robot of a radius of {radius:g} m cannot stand {distance:g} m from an object"
            )
        item = self.places.object(what)
        shape = item.object.footprint
        half = 0.75 * self.space.grid.resolution
        cells, gaps = self.sight.around(shape, max(0.0, distance - half), distance + half)
        why = f"{title(item)} cannot be reached, because"
        if not len(cells):
            at = f"{distance:g} m from it" if distance else "at it"
            raise NoPath(f"{why} no place {at} is free for a radius of {radius:g} m")
        begin = None if start is None else self.point_of(start)
        order = -self._clearance(cells) if begin is None else self._lengths(begin, cells)
        chosen = self.sight.first_that_sees(shape, cells, order)
        if chosen is not None:
            pose = self._facing(int(cells[chosen]), item)
            way = None if begin is None else self._path(begin, np.array([pose.x, pose.y]))
            return Approach(pose, float(gaps[chosen]), item, way)
        nearest = self.sight.first_that_sees(shape, cells, gaps)
        if begin is None or nearest is None:
            raise NoPath(f"{why} it is not visible from any free place {distance:g} m from it")
        _, first = self.space.place(begin, "the start")
        narrow = why_no_path(self.space, first, int(cells[nearest]))
        raise NoPath(f"{why} no path leads there for a radius of {radius:g} m; {narrow}")

    def is_reachable(self, start: Place, goal: Place) -> bool:
        """Return whether a path leads from one place to another.

        Raises:
            HypermapError: If there is no such place, or the robot cannot be there.
        """
        _, cell = self.space.place(self.point_of(goal), "the goal")
        return bool(np.isfinite(self.distances(start).meters.ravel()[cell]))

    def point_of(self, place: Place) -> NDArray[np.float64]:
        """Return the position of a robot at a place, in the base frame, shape (2,).

        Raises:
            NoPath: If there is no free place in the room, or from where the object is seen.
            HypermapError: If there is no such place, or several have that name.
        """
        if not isinstance(place, str | int):
            return as_point_xy(place)
        room = self.places.room(place)
        if room is not None:
            return self._middle(room)
        item = self.places.object(place)
        cells, gaps = self.sight.around(item.object.footprint, 0.0, REACH)
        chosen = self.sight.first_that_sees(item.object.footprint, cells, gaps)
        if chosen is None:
            why = f"it is not visible from any free place within {REACH:g} m"
            raise NoPath(f"{title(item)} cannot be reached, because {why}")
        return self._center(int(cells[chosen]))

    @functools.cached_property
    def sight(self) -> Sight:
        """Lines of sight over the grid, past mapped objects."""
        return Sight(self.space, (item.object.footprint for item in self.places.objects()))

    # Over the grid

    def _middle(self, room: Room) -> NDArray[np.float64]:
        """Return the free cell of a room that is nearest to its middle, shape (2,)."""
        middle = self.space.middle_of(room.outline)
        if middle is None:
            radius = self.space.settings.robot_radius
            raise NoPath(f"room {room.name!r} has no free place for a radius of {radius:g} m")
        return middle

    def _center(self, cell: int) -> NDArray[np.float64]:
        row, col = divmod(cell, self.space.grid.width)
        center: NDArray[np.float64] = self.space.grid.centers([row], [col])[0]
        return center

    def _lengths(self, begin: PointsLike, cells: IntArray) -> NDArray[np.float64]:
        """Return the length of the path to each of some cells [m]."""
        return distances(self.space, begin).meters.ravel()[cells].astype(np.float64)

    def _clearance(self, cells: IntArray) -> NDArray[np.float64]:
        """Return the clearance of neighboring cells [cells]."""
        rows, cols = np.divmod(cells, self.space.grid.width)
        row, col = (max(0, int(each.min()) - _ROOM_TO_MOVE) for each in (rows, cols))
        part = self.space.free[row : rows.max() + _ROOM_TO_MOVE, col : cols.max() + _ROOM_TO_MOVE]
        far = scipy.ndimage.distance_transform_edt(np.pad(part, 1))[1:-1, 1:-1]
        return np.asarray(far[rows - row, cols - col])

    def _facing(self, cell: int, item: FoundObject) -> Pose2D:
        x, y = self._center(cell).tolist()
        return Pose2D(x, y, math.atan2(item.point_xy[1] - y, item.point_xy[0] - x))

    def _path(self, begin: NDArray[np.float64], end: NDArray[np.float64]) -> Path:
        points = find_path(self.space, begin, end)
        if self.places.rooms is None:
            return Path(points, length_of(points))
        on_the_way = passed(points, self.places.rooms, self.space.grid.resolution)
        return Path(points, length_of(points), *on_the_way)


def nearest_by_path(
    hypermap: Hypermap, what: str | float, point_xy: PointsLike, k: int, layer: str | None
) -> list[FoundObject]:
    """Return the k nearest objects of a name or id by path; for `Hypermap.nearest`."""
    return Planner(hypermap).nearest(what, point_xy, k, layer)


def _in_base_frame(hypermap: Hypermap, name: str | None) -> OccupancyLayer:
    """Return the occupancy layer of a map, with its grid in the base frame."""
    layer = hypermap.occupancy(name)
    if layer.grid is None or layer.frame_id == hypermap.base_frame:
        return layer
    pose = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    grid = replace(layer.grid, origin=pose @ layer.grid.origin)
    return OccupancyLayer(layer.name, hypermap.base_frame, grid, layer.cells)


def _areas(hypermap: Hypermap, zone: Zone | BaseGeometry) -> list[BaseGeometry]:
    """Return the areas of a keepout zone, in the base frame."""
    if isinstance(zone, BaseGeometry):
        return [zone]
    check_kind(zone, Zone)
    return [
        shapely.buffer(item.object.footprint, zone.margin) for item in hypermap.objects(zone.name)
    ]
