"""Pieces of free space, and which of them are one room.

The pieces lie between all lines at which a room may end; here they are joined again where the line
is not a door and neither side is a room that stands open.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from hypermap.core.arrays import FloatArray
from hypermap.rooms.settings import RoomSettings

# Shares, of what the names say.
_OPEN = 0.28  # of a room's outline is open at most; of a square without one wall 0.25 is
_COUNTS = 0.6  # of a piece's width is a passage at least that makes it open
_ROOM = 2.0  # [m^2] is a room's area at least, if nothing but its shape says that it is one
_NARROW = 0.5  # [m] is a door's width at least that makes a small piece a room
_LARGE = 4.0  # [m^2] what is smaller and no room is part of what it opens to, as a niche
_LONG = 2.5  # times its width is a corridor's length at least
_DOOR = 0.85  # of the narrower side's width is a door at most
_BOTTLENECK = 0.65  # of the narrower corridor's width is a passage between corridors at most
_ALIKE = 0.9  # least ratio of widths where a corridor continues
_SAME = 1.1  # of a gap's width is what it is measured as at most
_HALL = 2.5  # times a corridor's width is a hall's, of which the corridor is no part


@dataclass(frozen=True)
class Passage:
    """A way between two pieces.

    Attributes:
        one: number of a piece.
        other: likewise.
        width: meters.
        in_wall: whether it is a gap in a wall that continues on both sides.
    """

    one: int
    other: int
    width: float
    in_wall: bool = False


class Pieces:
    """Pieces of free space that are joined to rooms.

    Attributes:
        area: of each piece [m^2], by its number; 0 is none.
        perimeter: length of its outline [m].
        clear: largest distance in it to a wall or to a line where it may end [m].
    """

    def __init__(
        self,
        area: FloatArray,
        perimeter: FloatArray,
        clear: FloatArray,
        passages: Iterable[Passage],
        settings: RoomSettings,
    ) -> None:
        self.area: list[float] = area.tolist()
        self.perimeter: list[float] = perimeter.tolist()
        self.clear: list[float] = clear.tolist()
        self._settings = settings
        self._parent = list(range(len(self.area)))
        # Lines side by side, as at both ends of a deep door, lead to the same place: the widest.
        self._widths: list[dict[int, float]] = [{} for _ in self.area]
        self._gaps: list[dict[int, float]] = [{} for _ in self.area]
        for passage in passages:
            self._add(self._widths, passage.one, passage.other, passage.width)
            if passage.in_wall:
                self._add(self._gaps, passage.one, passage.other, passage.width)

    def room_of(self) -> list[int]:
        """Join the pieces, and return the number of one piece of its room for each."""
        self._join(self._is_too_small)
        self._join(self._are_corridors)
        self._join(self._goes_on)
        self._join(self._are_one_large_room)
        self._join(self._is_niche)
        self._join(self._opens_to_one_room)
        return [self._find(i) for i in range(len(self._parent))]

    # Whether two pieces with a passage of some width [m] between them are one

    def _is_too_small(self, a: int, b: int, width: float) -> bool:
        small = a if self.area[a] < self.area[b] else b
        least = max(self._settings.least_area, _ROOM if width < _NARROW else 0.0)
        return self.area[small] < least and width == max(self._widths[small].values())

    def _is_niche(self, a: int, b: int, width: float) -> bool:
        small = a if self.area[a] < self.area[b] else b
        return (
            self.area[small] < _LARGE
            and not self._is_room(small)
            and not self._is_door(a, b, width)
        )

    def _goes_on(self, a: int, b: int, width: float) -> bool:
        """Return whether a corridor continues in the other piece, with the same width."""
        widths = [2 * self.clear[piece] for piece in (a, b)]
        alike = all(_ALIKE * own <= width <= own / _ALIKE for own in widths)
        return alike and max(map(self._length, (a, b))) >= _LONG

    def _are_corridors(self, a: int, b: int, width: float) -> bool:
        if self._is_room(a) or self._is_room(b) or self._is_hall(a, b, width):
            return False
        if self._is_gap(a, b, width) and self._is_door(a, b, width):
            return False
        return width > _BOTTLENECK * 2 * min(self.clear[a], self.clear[b])

    def _are_one_large_room(self, a: int, b: int, width: float) -> bool:
        if not (self._is_room(a) and self._is_room(b)):
            return False
        return width > self._settings.widest_door or not self._is_door(a, b, width)

    def _opens_to_one_room(self, a: int, b: int, width: float) -> bool:
        small = a if self.area[a] <= self.area[b] else b
        return (
            not self._is_room(small)
            and self._openness(small) > _OPEN
            and width == max(self._widths[small].values())
            and not self._is_door(a, b, width)
        )

    def _is_door(self, a: int, b: int, width: float) -> bool:
        return width <= _DOOR * 2 * min(self.clear[a], self.clear[b])

    def _is_gap(self, a: int, b: int, width: float) -> bool:
        """Return whether the passage is no wider than a gap in a wall; it may be a pixel wider."""
        return width <= _SAME * self._gaps[a].get(b, 0.0)

    def _is_hall(self, a: int, b: int, width: float) -> bool:
        """Return whether one is a corridor that leads into the other, a hall."""
        thin, wide = (a, b) if self.clear[a] <= self.clear[b] else (b, a)
        return (
            width <= self._settings.widest_door
            and self.clear[wide] > _HALL * self.clear[thin]
            and self._length(thin) >= 2
            and self.area[thin] >= _LARGE
        )

    # What a piece is

    def _is_room(self, piece: int) -> bool:
        """Return whether a piece is a room by its shape, even if it is open."""
        return (
            self.area[piece] >= _ROOM
            and self._length(piece) < _LONG
            and self._openness(piece) <= _OPEN
        )

    def _length(self, piece: int) -> float:
        """Return how many times its width a piece is long, as if it were straight."""
        return float(self.area[piece] / (2 * self.clear[piece]) ** 2)

    def _openness(self, piece: int) -> float:
        """Return the share of a piece's outline where it is open to others."""
        least = _COUNTS * 2 * self.clear[piece]
        open_ = sum(width for width in self._widths[piece].values() if width > least)
        return float(open_ / max(self.perimeter[piece], 1e-6))

    # Joining

    def _join(self, are_one: Callable[[int, int, float], bool]) -> None:
        """Join pieces, those with the widest passage first, until no two are one."""
        waiting: list[tuple[float, int, int]] = []

        def look_at(piece: int) -> None:
            for other, width in self._widths[piece].items():
                a, b = min(piece, other), max(piece, other)
                if are_one(a, b, width):
                    heapq.heappush(waiting, (-width, a, b))

        for piece in range(len(self._widths)):
            look_at(piece)
        while waiting:
            negative, a, b = heapq.heappop(waiting)
            if self._widths[a].get(b) == -negative and are_one(a, b, -negative):
                kept = self._merge(a, b)
                look_at(kept)
                for other in list(self._widths[kept]):
                    look_at(other)

    def _merge(self, a: int, b: int) -> int:
        if self.area[b] > self.area[a]:
            a, b = b, a
        between = self._widths[a][b]
        for widths in (self._widths, self._gaps):
            for other, width in widths[b].items():
                del widths[other][b]
                if other != a:
                    self._add(widths, a, other, width)
            widths[b] = {}
        self._parent[b] = a
        self.area[a] += self.area[b]
        outline = self.perimeter[a] + self.perimeter[b] - 2 * between
        # That of a sliver is too short, as it is simplified. No outline is shorter than a circle.
        self.perimeter[a] = max(outline, 2 * math.sqrt(math.pi * self.area[a]))
        self.clear[a] = max(self.clear[a], self.clear[b])
        return a

    @staticmethod
    def _add(widths: list[dict[int, float]], one: int, other: int, width: float) -> None:
        """Note how wide the widest passage between two pieces is."""
        widths[one][other] = widths[other][one] = max(width, widths[one].get(other, 0.0))

    def _find(self, piece: int) -> int:
        while self._parent[piece] != piece:
            piece = self._parent[piece]
        return piece
