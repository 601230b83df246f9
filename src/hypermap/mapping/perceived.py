"""Perception of a single frame: its detections, its observation and its cells."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.mapping.frame_log import floor_motion
from hypermap.mapping.occupancy import OccupancyMapper
from hypermap.mapping.seen_cells import SeenCells
from hypermap.mapping.stages import OccupancyConfig
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.sources import detections_of
from hypermap.perception.frame import DetectionSource, RgbdFrame
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe, usable_detections


@dataclass(frozen=True, eq=False)
class FrameDetections:
    """The detections of one frame, independent of its pose.

    Attributes:
        detections: those used.
        surplus: how many were dropped because there were too many.
    """

    detections: Detections
    surplus: int


@dataclass(frozen=True, eq=False)
class Perceived(FrameDetections):
    """What one frame shows.

    Attributes:
        observation: the footprints of the objects on the floor.
        cells: the cells that it shows occupied or free; None if not wanted, or there are none.
    """

    observation: Observation
    cells: SeenCells | None

    def corrected_from(self, recorded: NDArray[np.float64]) -> Perceived:
        """Return it as of a frame whose pose was corrected.

        Args:
            recorded: `map_T_camera` before that, shape (4, 4).
        """
        now = self.observation.map_T_camera
        x, y = (now[:2, 3] - recorded[:2, 3]).tolist()
        correction = x, y, floor_motion(recorded, now)[0].yaw
        return replace(self, observation=replace(self.observation, correction=correction))

    def at(self, time: float) -> Perceived:
        """Return it as of a time of the map [s]."""
        if time == self.observation.stamp:
            return self
        return replace(self, observation=replace(self.observation, stamp=time))


@dataclass(frozen=True)
class Perceiver:
    """Perceives single frames; its result depends on the frame alone.

    Attributes:
        source: returns the detections of a frame.
        perception: settings of segmentation and footprints.
        occupancy: settings of the occupancy layer; None if it is not made from depth.
        is_watched: whether an observer needs the color and the segments of the objects.
    """

    source: DetectionSource
    perception: PerceptionConfig
    occupancy: OccupancyConfig | None
    is_watched: bool = False

    def __call__(self, frame: RgbdFrame) -> Perceived:
        """Return what a frame shows.

        Raises:
            HypermapError: As `found` does.
        """
        return self.perceived(frame, self.found(frame))

    def found(self, frame: RgbdFrame) -> FrameDetections:
        """Return the detections of a frame.

        Raises:
            HypermapError: If the source fails, or the color cannot be read.
        """
        if self.is_watched:
            _ = frame.color  # decoded now, so a damaged one leaves the map unchanged
        found = detections_of("the source of detections", lambda: self.source(frame))
        masks, shape = found.masks, frame.depth.shape
        if masks is not None and len(masks) and masks.shape[1:] != shape:
            raise HypermapError(
                f"the masks of the detections have the shape {masks.shape[1:]}, the image {shape}"
            )
        usable = usable_detections(found, self.perception)
        surplus = np.count_nonzero(found.scores >= self.perception.min_score) - len(usable)
        return FrameDetections(usable, int(surplus))

    def perceived(self, frame: RgbdFrame, found: FrameDetections) -> Perceived:
        """Return what a frame with these detections shows, by its pose."""
        # Only observers need the segments, which refer to the usable detections.
        observation = observe(
            frame, found.detections, self.perception, keep_segments=self.is_watched
        )
        cells = None if self.occupancy is None else OccupancyMapper(self.occupancy).seen_in(frame)
        return Perceived(found.detections, found.surplus, observation, cells)


def no_detections(_frame: RgbdFrame) -> Detections:
    """Return none, for a map without objects."""
    return Detections.of([], [])
