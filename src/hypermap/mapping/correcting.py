"""Correct poses afterwards: rebuild the map from the logged frames at their corrected poses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.trajectory import Trajectory, invert, trajectory_of
from hypermap.formats.collector import paused_collector
from hypermap.mapping.completion import FreeShare
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.drives import Drive, numbers_of_drives, rows_of_drives
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_buffer import FoundEvidence, evidence_from_frames
from hypermap.mapping.floor_motions import FloorMotions
from hypermap.mapping.frame_log import FrameLog, LoggedFrame, LogPart, MapBefore
from hypermap.mapping.known_ids import with_known_ids
from hypermap.mapping.moved_frames import ROUNDING, moved_frames
from hypermap.mapping.observed_colors import colors_in
from hypermap.mapping.occupancy import OccupancyMapper
from hypermap.mapping.tracks import TrackTable
from hypermap.mapping.usable import FARTHEST_POSE
from hypermap.text import counted

_AT_ONCE = 64  # frames that are moved together
_MOST_TILT = 15.0  # [degrees] by which a correction may tilt the camera, as its median


class CannotCorrect(HypermapError):
    """The poses of a map's frames cannot be replaced."""


@dataclass(frozen=True, eq=False)
class Correction:
    """The effect of a correction of poses.

    Attributes:
        frames: how many frames were moved.
        kept: how many stayed, because no new pose is known for their drive.
        mean: mean displacement of the moved frames over the floor [m].
        most: largest displacement [m].
        motions: returns the motion of the map near each frame.
    """

    frames: int
    kept: int
    mean: float
    most: float
    motions: Callable[[], FloorMotions]

    @classmethod
    def of(
        cls,
        log: FrameLog,
        drives: Sequence[Drive],
        after: NDArray[np.float64],
        is_moved: NDArray[np.bool_],
        is_under_way: bool,
    ) -> Correction:
        """Return the effect of new poses on the logged frames.

        The arguments are those of `corrected_poses` and its results.
        """
        stamps, before = log.stamps, log.poses
        drive_of = numbers_of_drives(len(stamps), drives)
        moves = np.linalg.norm((after - before)[is_moved, :2, 3], axis=1)
        count = int(is_moved.sum())
        motions = partial(FloorMotions.between, stamps, before, after, drive_of, is_under_way)
        return cls(count, len(is_moved) - count, float(moves.mean()), float(moves.max()), motions)

    def sentence(self) -> str:
        """Return it as a sentence."""
        stayed = f"; {self.kept} of other drives stayed" if self.kept else ""
        by = f"{self.mean:.2f} m on average, {self.most:.2f} m at most"
        return f"corrected the poses of {counted(self.frames, 'frame')} by {by}{stayed}"


@dataclass(frozen=True, eq=False)
class MappedAgain:
    """The map rebuilt from the logged frames at other poses."""

    evidence: EvidenceMap
    occupancy: OccupancyMapper
    log: FrameLog


def corrected_poses(
    log: FrameLog, drives: Sequence[Drive], trajectory: Trajectory, is_under_way: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the poses of all logged frames, and which of them are from the trajectory.

    The frames of a drive are corrected together, or none of them. Of drives with the same stamps,
    as from simulators, the newest is corrected. The first and last frames of a drive, if they are
    beyond the poses by no more than gaps are bridged, get the nearest correction.

    Args:
        log: the frames.
        drives: the drives that the frames belong to, oldest first.
        trajectory: of the camera's optical frame in the map.
        is_under_way: whether the last drive continues: its frames before and after the trajectory
            get the nearest correction.

    Returns:
        Shapes (N, 4, 4) and (N,).

    Raises:
        CannotCorrect: If the trajectory lacks poses for some frames of a drive, or for all frames.
    """
    stamps, poses = log.stamps, log.poses
    begin, end = float(trajectory.stamps[0]), float(trajectory.stamps[-1])
    can_be, is_covered = can_be_corrected(log, drives), trajectory.covers(stamps)
    if is_covered.any() and not (is_covered & can_be).any():
        raise CannotCorrect(
            f"several drives have frames from {begin:.6f} to {end:.6f} s, and stamps do not tell "
            "which the poses are of; correct the map of one drive before it is merged or continued"
        )
    is_covered &= can_be
    rows_of = rows_of_drives(len(stamps), drives)
    if is_under_way and is_covered.any():
        is_covered[rows_of[-1]] = True
    is_near = _are_near_a_pose(stamps, trajectory) & can_be
    for drive, rows in zip(drives, rows_of, strict=True):
        if is_covered[rows].any():
            is_covered[rows] |= is_near[rows]
        missing = stamps[rows][~is_covered[rows]]
        if len(missing) and is_covered[rows].any():
            raise CannotCorrect(
                f"no pose for {len(missing)} of the {counted(len(stamps[rows]), 'frame')} of the "
                f"drive {drive.name!r}, the first at {missing[0]:.6f} s: the poses reach from "
                f"{begin:.6f} to {end:.6f} s, and gaps up to {trajectory.max_gap:g} s are bridged "
                "(--max-pose-gap)"
            )
    if not is_covered.any():
        known = f", from {stamps.min():.6f} to {stamps.max():.6f} s" if len(stamps) else ""
        is_between = bool(((begin <= stamps) & (stamps <= end)).any())
        gaps = f": there are gaps of more than {trajectory.max_gap:g} s" if is_between else ""
        raise CannotCorrect(
            f"the poses, from {begin:.6f} to {end:.6f} s, are of no frame of the {len(stamps)} "
            f"that the map keeps for this{known}{gaps}"
        )
    moved = _moved_along(stamps[is_covered], poses[is_covered], trajectory)
    _check_tilts(poses[is_covered], moved)
    poses[is_covered] = moved
    if not (np.abs(poses[:, :3, 3]) <= FARTHEST_POSE).all():
        raise CannotCorrect(f"a pose is farther away than {FARTHEST_POSE:g} m")
    return poses, is_covered


def _are_near_a_pose(stamps: NDArray[np.float64], trajectory: Trajectory) -> NDArray[np.bool_]:
    """Return which frames are as near to a pose as gaps between poses are bridged, shape (N,).

    A SLAM system saves keyframes, and the first and last frames may be beyond these. Across gaps of
    any length, frames beyond the poses are near to none.
    """
    if not np.isfinite(trajectory.max_gap):
        return np.zeros(len(stamps), dtype=bool)
    after = np.searchsorted(trajectory.stamps, stamps).clip(max=len(trajectory.stamps) - 1)
    beside = trajectory.stamps[np.stack([after, np.maximum(after - 1, 0)])]
    return np.asarray(np.abs(beside - stamps).min(axis=0) <= trajectory.max_gap)


def can_be_corrected(log: FrameLog, drives: Sequence[Drive]) -> NDArray[np.bool_]:
    """Return which logged frames a trajectory can move, shape (N,).

    Its stamps do not tell drives apart whose clocks began again: of these, it is of the newest. Of
    those of two robots at the same time, it is of none.
    """
    found = np.ones(len(log.frames), dtype=bool)
    for number, rows in enumerate(rows_of_drives(len(found), drives)):
        drive, later = drives[number], drives[number + 1 :]
        found[rows] = not (
            drive.is_beside or any(drive.overlaps(o) and drive.offset != o.offset for o in later)
        )
    return found


def _moved_along(
    stamps: NDArray[np.float64], poses: NDArray[np.float64], trajectory: Trajectory
) -> NDArray[np.float64]:
    """Return the poses as corrected by the trajectory, shape (N, 4, 4).

    This interpolates the corrections, not the poses: they change slowly even while the camera
    turns. Frames outside of the trajectory get the nearest correction.
    """
    own_stamps, rows = np.unique(stamps, return_index=True)
    own = trajectory_of(own_stamps, poses[rows])
    known = trajectory.stamps[own.covers(trajectory.stamps)]
    if len(known) == 0:  # all frames are between two poses of the trajectory
        known = np.clip(own_stamps, trajectory.stamps[0], trajectory.stamps[-1])
        known = np.unique(known)
    corrections = trajectory_of(known, trajectory.at(known) @ invert(own.at(known)))
    return corrections.at(np.clip(stamps, known[0], known[-1])) @ poses


def _check_tilts(before: NDArray[np.float64], after: NDArray[np.float64]) -> None:
    """Make sure that new poses are of the same camera: a correction hardly tilts it.

    Raises:
        CannotCorrect: If it does.
    """
    up = np.einsum("nij,nij->ni", before[:, :3, :3], after[:, :3, :3])[:, 2]
    tilt = float(np.degrees(np.arccos(np.clip(np.median(up), -1, 1))))
    if tilt > _MOST_TILT:
        raise CannotCorrect(
            f"the poses tilt the camera by {tilt:.0f} degrees from where it was: they have to be "
            "those of its optical frame (x right, y down, z forward) in the map, with quaternions "
            "in the order x, y, z, w, or of another --pose-convention (w-first: w, x, y, z)"
        )


@paused_collector()  # there is no garbage, and searching for it takes a tenth of the time
def map_again(
    log: FrameLog,
    poses: NDArray[np.float64],
    before: EvidenceMap,
    config: MappingConfig,
    is_free: FreeShare | None,
    on_progress: Callable[[int, int], None] | None = None,
) -> MappedAgain:
    """Return the map rebuilt from the logged frames at other poses.

    Objects keep their ids, pictures and edits made by hand; images are not needed. The parts of the
    log before the first frame that moves stay unchanged.

    Args:
        log: the frames, and the map before them.
        poses: `map_T_camera` of each frame, shape (N, 4, 4).
        before: the present map.
        config: the configuration that made it.
        is_free: as in `EvidenceMap`.
        on_progress: called with the number of frames done and the number of all frames to map.

    Raises:
        FormatError: If the log is damaged.
    """
    stay = _parts_that_stay(log, poses)
    first, begin = log.parts[stay].before, sum(len(part.frames) for part in log.parts[:stay])
    evidence = EvidenceMap(config.evidence, is_free)
    evidence.go_on_with(first.tracks.snapshot(), first.tracks.hand_edits())
    occupancy = _cells_of(first, poses[begin:], config)
    again = FrameLog(log.parts[:stay])
    again.end_drive()
    contents, stamps = log.frames[begin:], log.stamps.tolist()
    moved = frames_with_evidence(contents, poses[begin:], config)
    for number, (content, (frame, found)) in enumerate(zip(contents, moved, strict=True)):
        if again.is_full:
            is_made = first.log_odds is not None
            again.begin_part(first if number == 0 else map_now(evidence, occupancy, is_made))
        add_logged(frame, found, evidence, occupancy)
        again.add(stamps[begin + number], content, poses[begin + number])
        if on_progress is not None:
            on_progress(number + 1, len(poses) - begin)
    fixed = frozenset(track.id for track in first.tracks.objects)
    tracks = with_known_ids(evidence.tracks(), before.tracks(), fixed, config.evidence)
    again.parts = with_ids_in_log(again.parts, log.parts, tracks, fixed, config)
    evidence.go_on_with(tracks, before.hand_edits())
    evidence.left_out = before.left_out
    return MappedAgain(evidence, occupancy, again)


def _cells_of(
    first: MapBefore, poses: NDArray[np.float64], config: MappingConfig
) -> OccupancyMapper:
    """Return the cells of a map, with room for those that frames at some poses will see."""
    occupancy = OccupancyMapper(config.occupancy)
    if first.log_odds is not None:
        occupancy.go_on_with(first.first_cell, first.log_odds.copy())
        places, reach = poses[:, :2, 3], config.occupancy.max_range
        occupancy.make_room(places.min(axis=0) - reach, places.max(axis=0) + reach)
    return occupancy


def frames_with_evidence(
    contents: Sequence[bytes],
    poses: Sequence[NDArray[np.float64]] | NDArray[np.float64],
    config: MappingConfig,
    a_T_b: Pose2D | None = None,
    later: float = 0.0,
) -> Iterator[tuple[LoggedFrame, FoundEvidence]]:
    """Yield the frames of a log at other poses, with their evidence; some at a time are faster.

    The arguments are those of `moved_frames`; all stamps are later by `later` [s].
    """
    for begin in range(0, len(contents), _AT_ONCE):
        some = slice(begin, begin + _AT_ONCE)
        resolution = config.occupancy.resolution
        frames = moved_frames(contents[some], poses[some], resolution, "the log of frames", a_T_b)
        if later:
            frames = [frame.later(later) for frame in frames]
        observations = [frame.observation for frame in frames]
        yield from zip(
            frames, evidence_from_frames(observations, config.evidence.abstain), strict=True
        )


def add_logged(
    frame: LoggedFrame, found: FoundEvidence, evidence: EvidenceMap, occupancy: OccupancyMapper
) -> None:
    """Map a logged frame again; if that fails, the map is of no use."""
    change = occupancy.change_by(frame.seen)
    if frame.finds_objects:
        evidence.update_for_good(frame.observation, found)
        evidence.add_colors(frame.observation.stamp, colors_in(frame.observation))
    change()


def _parts_that_stay(log: FrameLog, poses: NDArray[np.float64]) -> int:
    """Return how many parts of a log, except the last, are before the first frame that moves."""
    ends = np.cumsum([len(part.frames) for part in log.parts])
    moves = np.abs(poses - log.poses).max(axis=(1, 2)) > ROUNDING
    first = int(np.argmax(moves)) if moves.any() else len(poses)
    return min(int(np.searchsorted(ends, first, side="right")), len(log.parts) - 1)


def map_now(evidence: EvidenceMap, occupancy: OccupancyMapper, makes_occupancy: bool) -> MapBefore:
    """Return the present map, from which later frames can be mapped again."""
    first_cell, log_odds = occupancy.log_odds()
    return MapBefore.of(evidence.tracks(), first_cell, log_odds if makes_occupancy else None)


def with_ids_in_log(
    parts: Sequence[LogPart],
    older: Sequence[LogPart],
    known: TrackTable,
    fixed: frozenset[int],
    config: MappingConfig,
) -> list[LogPart]:
    """Return the parts of a log whose maps have the final ids of their tracks.

    Args:
        parts: of the log.
        older: of the log before its frames were mapped again; their maps have these ids.
        known: the tracks with the final ids.
        fixed: ids that mean the same object in all of them.
        config: of the maps.
    """
    have_ids = {id(part.before) for part in older}
    return [
        part
        if id(part.before) in have_ids
        else dataclasses.replace(part, before=_with_ids_of(known, part.before, fixed, config))
        for part in parts
    ]


def _with_ids_of(
    known: TrackTable, before: MapBefore, fixed: frozenset[int], config: MappingConfig
) -> MapBefore:
    """Return the map before a part of the log with the ids of the same objects in `known`."""
    tracks = with_known_ids(before.tracks, known, fixed, config.evidence)
    return MapBefore.of(tracks, before.first_cell, before.log_odds)
