"""Settings for finding rooms: lengths and areas."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class RoomSettings:
    """Lengths [m], areas [m^2] and shares by which free space is cut into rooms.

    Attributes:
        least_area: minimum area of a room.
        widest_door: a wider passage between two large rooms makes them one room.
        widest_opening: maximum width of the gap in a wall through which a room is open to a
            corridor.
        largest_obstacle: a smaller obstacle that touches no wall, such as a chair, does not divide
            a room.

    Raises:
        ValueError: If one is not a positive, finite number.
    """

    least_area: float = 1.0
    widest_door: float = 2.2
    widest_opening: float = 4.5
    largest_obstacle: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{field.name} must be a positive number, got {value}")
