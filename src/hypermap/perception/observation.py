"""The observation of one frame: objects as shapes on the floor, and the visible area."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray
from hypermap.perception.depth_view import DepthView
from hypermap.perception.paint import Rgb
from hypermap.perception.segments import Segment


@dataclass(frozen=True, eq=False)
class ObservedObject:
    """One detected object, segmented and projected to the floor.

    Attributes:
        name: its class.
        score: the detector's, 0..1.
        footprint: polygon in the map frame [m].
        z_min: height of its lowest point in the map frame [m].
        z_max: height of its highest point in the map frame [m].
        segment: its points and its detection; None unless requested.
        detection: the number of its detection in the frame; None if it has none.
        pixel_count: how many pixels show it.
        pixels: row-major indices of some of these, from all over it; None if unknown.
        color: the median of its pixels, sRGB, 0..255; None if unknown.
    """

    name: str
    score: float
    footprint: BaseGeometry
    z_min: float = 0.0
    z_max: float = 0.0
    segment: Segment | None = None
    detection: int | None = None
    pixel_count: int = 0
    pixels: IntArray | None = None
    color: Rgb | None = None


@dataclass(frozen=True, eq=False)
class Observation:
    """Everything that the evidence map needs from one frame.

    Attributes:
        stamp: time [s].
        map_T_camera: pose of the camera's optical frame in the map, shape (4, 4).
        objects: what was detected.
        visible_area: polygon in the map frame [m] that this frame could have seen; may be empty.
            It is the hull of the points seen, and so extends behind objects.
        view: where the frame's rays ended; None if only the area is known.
        correction: how the recorded pose was corrected to `map_T_camera`: by x, y [m] and a
            rotation about the camera [rad]; zeros if it was not.

    Raises:
        ValueError: If the stamp or the pose is not finite.
    """

    stamp: float
    map_T_camera: NDArray[np.float64]
    objects: tuple[ObservedObject, ...]
    visible_area: BaseGeometry
    view: DepthView | None = None
    correction: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        pose = self.map_T_camera.ravel().tolist()
        if not all(map(math.isfinite, (self.stamp, *self.correction, *pose))):
            raise ValueError(f"the stamp and the pose must be finite, got the stamp {self.stamp}")
