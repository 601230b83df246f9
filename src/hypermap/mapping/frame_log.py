"""The log of mapped frames, from which they can be mapped again at corrected poses.

A frame is kept as mapping has interpreted it, without images: the observed objects, where its rays
ended, and the cells that it has shown. All of this moves over the floor with the camera's pose;
corrections of roll and pitch are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import as_objects
from hypermap.core.frames import Pose2D
from hypermap.formats.array_file import ArrayFile, dump_arrays, packed_shapes
from hypermap.mapping.color_arrays import packed_colors
from hypermap.mapping.packed_frames import FORMAT, VERSION, packed
from hypermap.mapping.seen_cells import SeenCells
from hypermap.mapping.tracks import TrackTable
from hypermap.perception.depth_view import DepthView
from hypermap.perception.observation import Observation

PART = 1000
"""Frames in a part of the log; before each part, one state of the map is kept."""
FARTHEST_CELL = 1e10
"""Cells from the origin; cells in files must not be farther away."""
_PARTS = 3  # kept at most; each drive begins one, so short drives do not add up
_COLUMNS = 80  # of a kept view, which is subsampled


@dataclass(frozen=True, eq=False)
class LoggedFrame:
    """What a frame has shown.

    Attributes:
        observation: its objects and rays.
        seen: the cells that it has shown; None for none.
        finds_objects: whether a detector ran, so that objects not found are missed detections.
    """

    observation: Observation
    seen: SeenCells | None
    finds_objects: bool = True

    def later(self, by: float) -> LoggedFrame:
        """Return it with a later stamp; by how much [s]."""
        observation = replace(self.observation, stamp=self.observation.stamp + by)
        return replace(self, observation=observation)


def floor_motion(before: NDArray[np.float64], after: NDArray[np.float64]) -> tuple[Pose2D, float]:
    """Return how the map near a camera moves over the floor when the camera's pose is corrected.

    Args:
        before: `map_T_camera`, shape (4, 4).
        after: the corrected `map_T_camera`, shape (4, 4).

    Returns:
        The transform of points from their old to their new places, and how far they rise [m].
    """
    ((motion, rise),) = floor_motions(before[np.newaxis], after[np.newaxis])
    return motion, rise


def floor_motions(
    before: NDArray[np.float64], after: NDArray[np.float64]
) -> list[tuple[Pose2D, float]]:
    """Return `floor_motion` of many cameras, whose poses have the shape (N, 4, 4)."""
    turns = after[:, :3, :3] @ before[:, :3, :3].transpose(0, 2, 1)
    yaws = np.arctan2(turns[:, 1, 0] - turns[:, 0, 1], turns[:, 0, 0] + turns[:, 1, 1])
    c, s = np.cos(yaws), np.sin(yaws)
    x, y = before[:, :2, 3].T
    moves = after[:, :2, 3] - np.column_stack([c * x - s * y, s * x + c * y])
    rises = (after[:, 2, 3] - before[:, 2, 3]).tolist()
    motions = map(Pose2D, *moves.T.tolist(), yaws.tolist())
    return list(zip(motions, rises, strict=True))


def packed_frame(frame: LoggedFrame) -> bytes:
    """Return a frame as a few kilobytes.

    Objects without area are left out, because mapping ignores them. Of the view, about 80 columns
    are kept, as float16. Their low bytes, which compress by 4 %, follow the compressed rest.
    """
    observation = frame.observation
    objects = [one for one in observation.objects if one.footprint.area > 0]
    numbers = [(one.score, one.z_min, one.z_max) for one in objects]
    shapes = [observation.visible_area, *(one.footprint for one in objects)]
    view, view_arrays, low_bytes = _packed_view(observation.view)
    cells, cell_arrays = _packed_cells(frame.seen)
    facts = {
        "stamp": observation.stamp,
        "names": [one.name for one in objects],
        "finds_objects": frame.finds_objects,
        "correction": list(observation.correction),
        "view": view,
        "cells": cells,
    }
    arrays = {
        "pose": observation.map_T_camera.astype(np.float64),
        "objects": np.array(numbers, np.float64).reshape(-1, 3),
        **packed_colors("colors", [one.color for one in objects]),
        **packed_shapes("shapes", as_objects(shapes)),
        **view_arrays,
        **cell_arrays,
    }
    return packed(dump_arrays(ArrayFile(facts, arrays), FORMAT, VERSION), low_bytes)


_Arrays = Mapping[str, NDArray[Any]]


def _packed_view(view: DepthView | None) -> tuple[dict[str, Any] | None, _Arrays, bytes]:
    if view is None:
        return None, {}, b""
    step = -(-view.camera.width // _COLUMNS)
    camera = view.camera.every(step)
    farthest = view.max_range if math.isfinite(view.max_range) else None
    facts = {"K": camera.K.tolist(), "size": [camera.height, camera.width], "max_range": farthest}
    facts["every"] = view.every * step
    reach = np.ascontiguousarray(view.reach[::step, ::step], np.float16)
    low, high = np.ascontiguousarray(reach.view(np.uint8).reshape(-1, 2).T)
    return facts, {"reach": high}, low.tobytes()


def _packed_cells(seen: SeenCells | None) -> tuple[list[int] | None, _Arrays]:
    if seen is None:
        return None, {}
    bits = np.packbits(np.stack([seen.is_hit, seen.is_free]))
    return list(seen.is_hit.shape), {"first_cell": seen.first, "cells": bits}


@dataclass(frozen=True, eq=False)
class MapBefore:
    """The map before a frame, from which this frame can be mapped again.

    Attributes:
        tracks: with their evidence, which other tables share; must not be changed.
        first_cell: row and column of the first cell of `log_odds`, from the origin of the map
            frame, int64, shape (2,).
        log_odds: of the cells of the occupancy layer, NaN if never seen, float32, shape (H, W);
            None if the layer is not made from depth.
    """

    tracks: TrackTable
    first_cell: NDArray[np.int64]
    log_odds: NDArray[np.float32] | None

    @classmethod
    def of(
        cls,
        tracks: TrackTable,
        first_cell: NDArray[np.int64],
        log_odds: NDArray[np.float32] | None,
    ) -> MapBefore:
        """Return it with a copy of the tracks, without pictures."""
        for track in tracks.objects:
            track.buffer.pictures, track.buffer.embedding = (), None
        return cls(tracks, first_cell, log_odds)


@dataclass(frozen=True, eq=False)
class LogPart:
    """Consecutive frames.

    Attributes:
        before: the map before the first frame.
        stamps: of the frames [s].
        frames: packed by `packed_frame`, at the poses at which they were first mapped.
        poses: the present `map_T_camera` of each, shape (4, 4).
    """

    before: MapBefore
    stamps: list[float] = field(default_factory=list)
    frames: list[bytes] = field(default_factory=list)
    poses: list[NDArray[np.float64]] = field(default_factory=list)

    def copy(self) -> LogPart:
        """Return an independent copy."""
        return LogPart(self.before, list(self.stamps), list(self.frames), list(self.poses))


class FrameLog:
    """The newest frames, in parts: a few drives, and at least `PART` frames of long ones.

    Attributes:
        parts: oldest first.
    """

    def __init__(self, parts: Iterable[LogPart] = ()) -> None:
        self.parts = [part.copy() for part in parts]
        self._is_drive_over = False

    @property
    def is_full(self) -> bool:
        """Whether the next frame begins another part."""
        is_over = self._is_drive_over or not self.parts
        return is_over or len(self.parts[-1].frames) >= PART

    def end_drive(self) -> None:
        """End the drive: the next frame belongs to another one."""
        self._is_drive_over = True

    def begin_part(self, before: MapBefore) -> None:
        """Begin a part with the map before its first frame."""
        self._is_drive_over = False
        while len(self.parts) >= _PARTS or sum(len(p.frames) for p in self.parts[1:]) >= PART:
            del self.parts[0]
        self.parts.append(LogPart(before))

    def add(self, stamp: float, frame: bytes, map_T_camera: NDArray[np.float64]) -> None:
        """Add a packed frame with its pose, shape (4, 4), to the newest part."""
        part = self.parts[-1]
        part.stamps.append(stamp)
        part.frames.append(frame)
        part.poses.append(map_T_camera)

    @property
    def frames(self) -> list[bytes]:
        """All packed frames."""
        return [frame for part in self.parts for frame in part.frames]

    @property
    def stamps(self) -> NDArray[np.float64]:
        """The stamps of all frames [s], shape (N,)."""
        return np.array([stamp for part in self.parts for stamp in part.stamps], np.float64)

    @property
    def poses(self) -> NDArray[np.float64]:
        """The present `map_T_camera` of all frames, shape (N, 4, 4)."""
        poses = [pose for part in self.parts for pose in part.poses]
        return np.array(poses, np.float64).reshape(-1, 4, 4)


def packed_log(parts: Iterable[LogPart]) -> dict[str, NDArray[Any]]:
    """Return a log as arrays, without the maps before its parts."""
    parts = list(parts)
    frames = [frame for part in parts for frame in part.frames]
    return {
        "log.frames": _joined(frames),
        "log.frame_lengths": _lengths(frames),
        "log.part_lengths": _lengths([part.frames for part in parts]),
        "log.stamps": FrameLog(parts).stamps,
        "log.poses": FrameLog(parts).poses,
    }


def unpacked_befores(arrays: _Arrays) -> list[bytes]:
    """Return the files of the states before each part, in the form of an earlier version.

    Raises:
        KeyError, ValueError: If the arrays contain anything else.
    """
    if "log.before" not in arrays:
        return []
    return _parted(arrays["log.before"], arrays["log.before_lengths"])


def unpacked_log(arrays: _Arrays, befores: Sequence[MapBefore]) -> tuple[LogPart, ...]:
    """Return the parts that `packed_log` has packed; none if the arrays contain no log.

    Args:
        arrays: the arrays of `packed_log`, among others.
        befores: the map before each part.

    Raises:
        KeyError, ValueError: If the arrays are damaged.
    """
    if "log.frames" not in arrays:
        return ()
    frames = _parted(arrays["log.frames"], arrays["log.frame_lengths"])
    ends = np.cumsum(arrays["log.part_lengths"]).tolist()
    begins = [0, *ends[:-1]]
    stamps, poses = arrays["log.stamps"].tolist(), list(arrays["log.poses"].reshape(-1, 4, 4))
    if not (ends[-1] if ends else 0) == len(frames) == len(stamps) == len(poses):
        raise ValueError("the log of frames does not match its poses")
    return tuple(
        LogPart(before, stamps[begin:end], frames[begin:end], poses[begin:end])
        for before, begin, end in zip(befores, begins, ends, strict=True)
    )


def _joined(pieces: Sequence[bytes]) -> NDArray[np.uint8]:
    return np.frombuffer(b"".join(pieces), np.uint8)


def _lengths(pieces: Sequence[Sized]) -> NDArray[np.int64]:
    return np.array([len(piece) for piece in pieces], np.int64)


def _parted(joined: NDArray[np.uint8], lengths: NDArray[np.int64]) -> list[bytes]:
    if (lengths < 0).any() or lengths.sum() != len(joined):
        raise ValueError("the lengths of the log of frames do not match the data")
    content, ends = joined.tobytes(), np.cumsum(lengths).tolist()
    return [content[end - n : end] for end, n in zip(ends, lengths.tolist(), strict=True)]
