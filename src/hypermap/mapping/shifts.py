"""By how much corrected poses have shifted objects, so that the history tells this from moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.history import History
from hypermap.core.objects import ObjectTable
from hypermap.core.samples import Samples
from hypermap.mapping.drives import Drive, numbers_of_drives
from hypermap.mapping.floor_motions import FloorMotions
from hypermap.mapping.frame_log import FrameLog
from hypermap.mapping.going_on import SEMANTIC

_SAME = 1e-6  # [m] by which rounding moves poses


class Shifts:
    """The shifts of the objects in the last version that a map's history knows.

    An object shifts by the mean of the motions near the frames of its last drive that saw it first
    and last; where an earlier drive saw it first, by that of the last. Frames that are not in the
    log do not move.
    """

    def __init__(self, history: History | None) -> None:
        """Begin with those of corrections since that version, before mapping continued the map."""
        layer = None if history is None else history.layers.get(SEMANTIC)
        self._objects = ObjectTable.of([]) if layer is None else layer.table
        earlier = None if history is None or history.mapped is None else history.mapped.shifts
        self._by: NDArray[np.float64] | None = None
        if earlier is not None:
            ids = self._objects.ids.tolist()
            self._by = np.array([earlier.get(number, (0.0, 0.0)) for number in ids]).reshape(-1, 2)

    def add(self, before: FrameLog, after: FrameLog, drives: Sequence[Drive]) -> None:
        """Add a correction of poses.

        Args:
            before: the frames at the poses before it.
            after: the frames at the corrected poses; newer ones may follow.
            drives: those of the frames after it, oldest first.
        """
        begin, count = _common(before, after)
        poses = before.poses[begin : begin + count], after.poses[:count]
        if np.allclose(*poses, rtol=0, atol=_SAME):
            return
        numbers = numbers_of_drives(len(after.frames), drives)[:count]
        offsets = np.array([drive.offset for drive in drives])
        stamps = after.stamps[:count] + offsets[numbers]
        motions = FloorMotions.between(stamps, *poses, numbers)
        centers = shapely.centroid(self._objects.footprints)
        begun = np.column_stack([shapely.get_x(centers), shapely.get_y(centers)])
        shifted = begun if self._by is None else begun + self._by
        none = np.zeros(len(begun))
        first, last = self._objects.first_seen, self._objects.last_seen
        begins = np.sort([drive.first for drive in drives] + offsets)
        drive_of = np.maximum(np.searchsorted(begins, last, side="right") - 1, 0)
        first = np.where(first >= begins[drive_of], first, last)
        ends = [
            motions.moved(Samples(shifted, none, none.astype(bool), seen)).points_xy
            for seen in (first, last)
        ]
        self._by = np.mean(ends, axis=0) - begun

    def by_id(self) -> dict[int, tuple[float, float]] | None:
        """Return x and y [m] by the objects' ids; None if no poses were corrected."""
        if self._by is None:
            return None
        ids, by = self._objects.ids.tolist(), self._by.tolist()
        return {number: (x, y) for number, (x, y) in zip(ids, by, strict=True)}


def _common(before: FrameLog, after: FrameLog) -> tuple[int, int]:
    """Return where the first frame of one log is in another one, and how many both contain.

    Logs lose their oldest frames.
    """
    frames, first = before.frames, after.frames[:1]
    if not first or first[0] not in frames:
        return 0, 0
    begin = frames.index(first[0])
    return begin, min(len(frames) - begin, len(after.frames))
