"""Whether a drive shows the place of the map that it is mapped onto.

A drive through another place, or one whose poses are in another frame, would spoil the map. What
the drive shows by itself is therefore compared with the map before it: walls with walls, as far as
both know the area, and each sighting of an object with the objects of that name. If a drive has no
floor in common with the map, and is not next to it either, its poses are most probably in another
frame.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.alignment.grids import Field, Scan, scan_of, wall_tolerance
from hypermap.core.arrays import FloatArray
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.mapping.occupancy import OccupancyMapper
from hypermap.mapping.perceived import Perceived
from hypermap.mapping.stages import OccupancyConfig
from hypermap.perception.frame import RgbdFrame

_FIRST_LOOK = 16  # frames before the first comparison; each later one is at twice as many
_FEWEST = 8  # frames that can tell; by two alone, 8 of 143 honest drives through `lab` would differ
_NEAR = 0.3  # [m] up to which a sighting is of an object of that name
_LEAST_WALL, _LEAST_SIGHTINGS = 4.0, 15  # [m] of walls and number of sightings that can tell
_FEW_SIGHTINGS = 5  # tell something if none of them is near
_BESIDE = 0.5  # [m] from the map up to which a drive is next to it, as across a wall
# Shares of walls, beyond chance, and of sightings. On simulated drives a day apart through six
# worlds, with errors up to harsh, the walls of one place agreed by 0.44 and more, and the sightings
# by 0.54 and more, from 16 frames on. Of 120 drives through other places 118 are told
# (benchmarks/same_place.py); the others are through a bare corridor, which looks like many. Of maps
# of a part of `office` or `apartment`, none refuses a later drive through the rest from 16 frames
# on. On two more seeds, at half the rate, 928 comparisons of honest drives and quarters of them had
# some sightings near from the fifth on.
_WALLS_FIT, _WALLS_DIFFER, _WALLS_FEW_DIFFER, _WALLS_ALONE_DIFFER = 0.65, 0.55, 0.5, 0.4
_OBJECTS_FIT, _OBJECTS_DIFFER = 0.6, 0.5
_REMEDY = (
    "leave out --onto, map it to a file of its own and join the two: "
    "hypermap merge MAP DRIVE -o OUT"
)

_log = logging.getLogger(__name__)


class OtherPlace(HypermapError):
    """A drive does not show the place of the map that it is mapped onto."""


@dataclass(frozen=True)
class Likeness:
    """How much of what a drive shows is in the map before it.

    Attributes:
        wall: length of the walls that could agree: those where both know the area [m].
        agree: share of these that do, beyond what would agree by chance: 0 is no more than chance.
        telling: length of these that would not agree by chance [m]. Where maps share only a strip
            along walls, all of it is near walls, and nothing can be told.
        sightings: how many sightings of objects could agree: in the area that the map knows, of a
            name that it has.
        near: how many of these are near an object of that name.
        gap: between the two, if they have no floor in common, so that nothing can agree; else 0
            [m]. Where the camera was is floor, too.
    """

    wall: float
    agree: float
    telling: float
    sightings: int
    near: int
    gap: float = 0.0

    @property
    def is_apart(self) -> bool:
        """Whether the drive is not even next to the map, as in another room of the same place."""
        return self.gap > _BESIDE

    @property
    def walls_tell(self) -> bool:
        """Whether there are enough walls to compare."""
        return self.telling >= _LEAST_WALL

    @property
    def objects_tell(self) -> bool:
        """Whether there are enough sightings of objects to compare."""
        return self.sightings >= _LEAST_SIGHTINGS

    @property
    def fits(self) -> bool:
        """Whether it is the same place, in the same frame."""
        if not self.objects_tell:
            return self.walls_tell and self.agree >= _WALLS_FIT
        needed = _OBJECTS_DIFFER if self.agree >= _WALLS_FIT else _OBJECTS_FIT
        return self.agree >= _WALLS_ALONE_DIFFER and self.near >= needed * self.sightings

    @property
    def differs(self) -> bool:
        """Whether it is another place, or another frame; what tells nothing does not count."""
        return self.walls_tell and not self.fits and self.agree < self._walls_needed

    @property
    def doubt(self) -> str:
        """Why it is hardly the same place: the two are "apart", or what they show "differs"."""
        return "apart" if self.is_apart else "differs" if self.differs else ""

    @property
    def _walls_needed(self) -> float:
        """The share of walls below which it is another place, as far as sightings tell."""
        if self.objects_tell:
            is_far = self.near < _OBJECTS_DIFFER * self.sightings
            return (_WALLS_DIFFER if self.near else _WALLS_FIT) if is_far else 0.0
        none_near = self.sightings >= _FEW_SIGHTINGS and not self.near
        return _WALLS_FEW_DIFFER if none_near else _WALLS_ALONE_DIFFER

    def sentence(self) -> str:
        """Return it in words."""
        if self.is_apart:
            return f"the two have no floor in common, and are {self.gap:.1f} m apart"
        share = max(self.agree, 0)
        walls = f"{share:.0%} of {self.wall:.0f} m of walls agree beyond chance"
        if not self.sightings:
            return walls
        return (
            f"{walls}, and {self.near} of {self.sightings} sightings of objects are near one of "
            "that name"
        )


class PlaceCheck:
    """Compares what a drive shows with the map that it is mapped onto.

    Attributes:
        likeness: at the last comparison; None before the first.
        remedy: what messages advise where the poses are in another frame.
    """

    def __init__(
        self,
        before: Hypermap,
        config: OccupancyConfig,
        layer: str = "occupancy",
        cameras_xy: FloatArray | None = None,
    ) -> None:
        """Prepare it.

        Args:
            before: the map before the drive.
            config: how the cells that frames show are found.
            layer: name of the occupancy layer that is continued; there may be others.
            cameras_xy: where its frames were taken, as far as that is known [m], shape (N, 2).
        """
        self.likeness: Likeness | None = None
        self.remedy = _REMEDY
        self._before, self._layer = before, layer
        self._cameras_before = np.empty((0, 2)) if cameras_xy is None else cameras_xy
        self._cameras: list[FloatArray] = []  # of the drive
        self._own = OccupancyMapper(config)
        self._frames, self._next = 0, _FIRST_LOOK
        self._sightings = self._near = 0
        self._doubted = 0  # comparisons with the same doubt, one after the other

    def check(self, drive: str, is_last: bool = False) -> None:
        """Make sure that it is one place, as far as that can be said by now.

        Two comparisons must differ, or the last one. A drive that has no floor in common with the
        map may still reach it, until its end.

        Args:
            drive: its name, for messages.
            is_last: whether the drive is over. If it then is not sure that it is one place, that
                is logged.

        Raises:
            OtherPlace: If it is another one.
        """
        likeness = self.compare() if is_last and not self._is_one_place else self.likeness
        finding = self.finding(drive, is_last)
        if finding and (is_last or self._doubt == "differs"):
            way_out = f"Then {self.remedy}; --same-place maps it anyway"
            if self._doubt == "apart":
                way_out = (
                    "If it is another part of the same place, in the frame of the map, "
                    f"--same-place maps it; otherwise {self.remedy}"
                )
            raise OtherPlace(f"{finding} {way_out}")
        if is_last and self._frames and not (likeness is not None and likeness.fits):
            unsure = self._unsure(drive)
            _log.warning("%s; if its poses are in another frame, %s", unsure, self.remedy)

    def finding(self, drive: str, is_last: bool = False) -> str:
        """Return what tells that a drive shows another place, in words; empty if nothing does.

        Args:
            drive: its name.
            is_last: whether one comparison suffices, because no other follows.
        """
        if self.likeness is None or not self._doubt or not (self._doubted >= 2 or is_last):
            return ""
        if self._doubt == "differs" and self._frames < _FEWEST:
            return ""
        return (
            f"{drive} does not fit the map: {self.likeness.sentence()}; is it another place, or "
            "are its poses in another frame?"
        )

    def _unsure(self, drive: str) -> str:
        likeness = self.likeness
        if likeness is None or not (likeness.walls_tell or likeness.objects_tell):
            return (
                f"could not check whether {drive} shows the place of the map: they share too little"
            )
        return f"not sure whether {drive} shows the place of the map: {likeness.sentence()}"

    @property
    def _doubt(self) -> str:
        return "" if self.likeness is None else self.likeness.doubt

    @property
    def _is_one_place(self) -> bool:
        """Whether this is sure by now; walls alone may look alike for long, as in corridors."""
        likeness = self.likeness
        return likeness is not None and likeness.fits and likeness.objects_tell

    def add(self, frame: RgbdFrame, perceived: Perceived) -> None:
        """Add a frame as it is mapped, and compare, now and then."""
        if self._is_one_place:
            return
        self._frames += 1
        if self._scan is None:
            return
        seen = perceived.cells or self._own.seen_in(frame)
        try:
            self._own.change_by(seen)()
        except HypermapError:  # the map itself grows too large, too, and says so
            return
        self._cameras.append(frame.map_T_camera[:2, 3])
        for item in perceived.observation.objects:
            known = self._objects.get(item.name)
            if known is not None and self._is_known(item.footprint.centroid):
                self._sightings += 1
                self._near += bool(known.distance(item.footprint) <= _NEAR)
        if self._frames >= self._next:
            self._next *= 2
            before, likeness = self._doubt, self.compare()
            is_same = likeness is not None and self._doubt == before
            self._doubted = self._doubted + 1 if is_same else 1

    def compare(self) -> Likeness | None:
        """Return how much of the drive so far is in the map; None if that cannot be said."""
        own = self._own.layer(frame_id=self._before.base_frame)
        if self._scan is None or own.cells is None:
            return None
        try:
            drive = scan_of(Hypermap([own]))
        except HypermapError:  # it has no walls, or nothing free, so far
            return None
        on_drive = Field.of(drive, drive.resolution, margin=0.0)
        within = wall_tolerance(drive, self._scan)
        assert self._field is not None
        total = np.zeros(4)
        for scan, field in ((drive, self._field), (self._scan, on_drive)):
            total += scan.resolution / 2 * np.array(_compared(scan, field, within))
        wall, same, by_chance, known = total.tolist()
        more, most = same - by_chance, wall - by_chance
        share = more / most if most > 0 else 0.0
        gap = 0.0 if known else self._gap(drive)
        self.likeness = Likeness(wall, share, most, self._sightings, self._near, gap)
        return self.likeness

    def _gap(self, drive: Scan) -> float:
        """Return the distance between the floor of the drive so far and that of the map [m]."""
        assert self._scan is not None
        before = np.concatenate([self._scan.known_xy, self._cameras_before])
        now = np.concatenate([drive.known_xy, np.reshape(self._cameras, (-1, 2))])
        return float(np.min(scipy.spatial.KDTree(before).query(now)[0]))

    def begin_again(self) -> None:
        """Forget the drive so far, as after its poses were corrected."""
        self.likeness = None
        self._own = OccupancyMapper(self._own.config)
        self._cameras = []
        self._frames, self._next = 0, _FIRST_LOOK
        self._sightings = self._near = self._doubted = 0

    @cached_property
    def _scan(self) -> Scan | None:
        """The map before as points; None if it has no walls, or nothing free."""
        try:
            return scan_of(self._before, self._layer)
        except HypermapError:
            return None

    @cached_property
    def _field(self) -> Field | None:
        return None if self._scan is None else Field.of(self._scan, self._scan.resolution, 0.0)

    @cached_property
    def _objects(self) -> dict[str, BaseGeometry]:
        """The shapes of the map's objects, by name; outlines may cross themselves."""
        shapes: dict[str, list[BaseGeometry]] = {}
        for layer in self._before:
            if isinstance(layer, SemanticLayer) and layer.frame_id == self._before.base_frame:
                for item in layer.objects():
                    shapes.setdefault(item.name, []).append(item.footprint)
        return {name: shapely.GeometryCollection(found) for name, found in shapes.items()}

    def _is_known(self, point: shapely.Point) -> bool:
        assert self._field is not None
        return bool(self._field.at(np.array([[point.x, point.y]]))[1][0])


def _compared(scan: Scan, field: Field, within: float) -> tuple[float, float, float, float]:
    """Return how many walls of a map those of another could be, and how many are.

    Args:
        scan: of the one map.
        field: of the other.
        within: how near a wall must be to be the same [m].

    Returns:
        Cells of walls where both maps know the area; of these, those that are the same in both;
        how many would be by chance, as any other known cells are; and all cells that both know.
    """
    near, known = _near(scan.occupied_xy, field, within)
    near_free, known_free = _near(scan.free_xy, field, within)
    share = (near + near_free) / max(1, known + known_free)
    return known, near, share * known, known + known_free


def _near(points_xy: FloatArray, field: Field, within: float) -> tuple[int, int]:
    """Return how many points are near walls of a map, and how many in the area that it knows."""
    height, width = field.known.shape
    at = (points_xy - field.origin_xy) / field.resolution
    is_on_it = ((at >= -1) & (at <= (width + 1, height + 1))).all(axis=1)
    distance, is_known = field.at(points_xy)
    is_near = is_on_it & (distance <= within)
    return int(np.count_nonzero(is_near)), int(np.count_nonzero(is_known | is_near))
