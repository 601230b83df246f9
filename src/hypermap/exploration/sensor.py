"""Range and field of view of a robot's sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Sensor:
    """Range and field of view of a sensor, in the plane of the floor.

    Attributes:
        max_range: maximum range [m].
        min_range: minimum range [m]; a camera does not see the floor right in front of the robot.
        fov_deg: horizontal field of view [degrees]; 360 for a laser that scans all around.

    Raises:
        ValueError: If a value is out of range.
    """

    max_range: float = 4.0
    min_range: float = 0.0
    fov_deg: float = 60.0

    def __post_init__(self) -> None:
        if not 0 < self.max_range <= 100:
            raise ValueError(f"max_range must be above 0 and at most 100 m, got {self.max_range}")
        if not 0 <= self.min_range < self.max_range:
            raise ValueError(
                f"min_range must be 0 or more, and below max_range, got {self.min_range}"
            )
        if not 0 < self.fov_deg <= 360:
            raise ValueError(f"fov_deg must be above 0 and at most 360, got {self.fov_deg}")

    @property
    def fov(self) -> float:
        """Horizontal field of view [rad]."""
        return math.radians(self.fov_deg)
