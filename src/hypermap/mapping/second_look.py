"""A second look: whether a drive has detected an object that its map lacks.

Two maps of one place may differ although nothing has changed: an object is lost among others like
it, or had too few detections for one of the maps. The frames of both drives tell this apart from
objects that came or went: where these were not, the detector has found nothing like them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.core.history import ADDED, Change
from hypermap.core.objects import SemanticObject
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.drives import Drive, rows_of_drives
from hypermap.mapping.frame_log import FrameLog, LoggedFrame
from hypermap.mapping.moved_frames import moved_frames
from hypermap.mapping.occlusion import sample_points, visible_shares
from hypermap.mapping.prepared_polygon import PreparedPolygon

_VISIBLE = 0.5  # share of an object that a frame must be able to see
_BESIDE = 0.1  # [m] between an object and a detection of it, at most
_FOUND = 0.8  # share of such frames that detect an object which is there
_FALSE = 0.05  # share of those that detect one which is not there


@dataclass(frozen=True, eq=False)
class SecondLook:
    """The logged frames of the newest drives.

    Attributes:
        log: the frames.
        drives: all drives; the last one is the present one.
        config: of the map.
    """

    log: FrameLog
    drives: Sequence[Drive]
    config: MappingConfig
    _unpacked: dict[int, LoggedFrame] = field(default_factory=dict, init=False, repr=False)

    def chance(self, change: Change) -> float:
        """Return how likely it is that an object did not come or go, 0..1.

        One that came may have been there in the last of the earlier drives that could see its
        place, and one that is gone may still be there in the present drive. Before a drive could
        see the place, both are as likely; without one, the answer is 0.
        """
        present, *earlier = rows_of_drives(len(self.log.frames), self.drives)[::-1]
        for rows in earlier if change.kind == ADDED else (present,):
            shown, detected = self._looks(change.object, rows)
            if shown:
                return _chance(shown, detected)
        return 0.0

    def _looks(self, item: SemanticObject, rows: slice) -> tuple[int, int]:
        """Return how many frames of a drive could see an object, and how many of them detect it."""
        heights = [item.attributes.get(name) for name in ("z_min", "z_max")]
        if item.footprint.is_empty or not all(isinstance(one, int | float) for one in heights):
            return 0, 0
        samples, config = sample_points([PreparedPolygon.of(item.footprint)]), self.config.evidence
        shown = detected = 0
        for frame in self._frames_near(item, rows):
            view = frame.observation.view
            if view is None or not frame.finds_objects:
                continue
            seen = visible_shares(view, samples, np.array([heights], float), config.tolerance)
            if seen.visible[0] >= _VISIBLE:
                shown += 1
                detected += _detects(frame, item)
        return shown, detected

    def _frames_near(self, item: SemanticObject, rows: slice) -> list[LoggedFrame]:
        """Return the frames of a drive within the range in which an object can be missed."""
        poses = self.log.poses
        x, y = item.footprint.centroid.coords[0]
        far = np.hypot(poses[rows, 0, 3] - x, poses[rows, 1, 3] - y)
        near = rows.start + np.flatnonzero(far <= self.config.evidence.max_range)
        try:
            self._unpack([row for row in near.tolist() if row not in self._unpacked], poses)
        except FormatError:  # a damaged log must not keep a map from being saved
            return []
        return [self._unpacked[row] for row in near.tolist()]

    def _unpack(self, rows: list[int], poses: NDArray[np.float64]) -> None:
        """Unpack frames and keep them for other objects: this takes most of the time."""
        if rows:
            contents = self.log.frames
            some, resolution = [contents[row] for row in rows], self.config.occupancy.resolution
            moved = moved_frames(some, poses[rows], resolution, "the log of frames")
            self._unpacked.update(zip(rows, moved, strict=True))


def _detects(frame: LoggedFrame, item: SemanticObject) -> bool:
    return any(
        one.name == item.name and shapely.dwithin(one.footprint, item.footprint, _BESIDE)
        for one in frame.observation.objects
    )


def _chance(shown: int, detected: int) -> float:
    """Return how likely an object is there that so many frames could see, and so many detect.

    Before them, it is as likely to be there as not.
    """
    odds = detected * math.log(_FOUND / _FALSE)
    odds += (shown - detected) * math.log((1 - _FOUND) / (1 - _FALSE))
    return 0.5 * (1 + math.tanh(odds / 2))
