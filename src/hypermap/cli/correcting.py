"""`--poses`: correct the poses of the frames in a map."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.cli.onto import named
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.trajectory import Trajectory
    from hypermap.recordings import RecordingOptions


def corrected(
    base: Hypermap | None, onto: Path | None, poses: Path, options: RecordingOptions
) -> Hypermap:
    """Return the map of `--onto` as it is with other poses.

    Args:
        base: the map.
        onto: its file.
        poses: a trajectory of the camera's optical frame, in TUM format.
        options: what the user says of the recording's world and clock.

    Raises:
        HypermapError: If there is no map, a file cannot be read, or the poses are not those of the
            map's frames.
    """
    from hypermap.cli.progress import counting
    from hypermap.mapping.correcting import CannotCorrect
    from hypermap.mapping.mapper import Mapper

    if base is None:
        raise HypermapError("--poses: corrects the frames of a map; name it with --onto")
    trajectory = _trajectory(poses, options)
    with named(onto):
        mapper = Mapper.onto(base, None)
    try:
        with ExitStack() as shown:
            bar: list[Callable[[], None]] = []  # opened once all poses are known to fit

            def tell(_done: int, total: int) -> None:
                if not bar:
                    bar.append(shown.enter_context(counting("mapping again", total, "frame")))
                bar[0]()

            correction = mapper.correct(trajectory, tell)
    except CannotCorrect as error:
        raise HypermapError(f"{poses}: {error}") from error
    note(correction.sentence())
    return mapper.hypermap()


def _trajectory(path: Path, options: RecordingOptions) -> Trajectory:
    """Return the poses in the map at the time of the images."""
    from hypermap.core.trajectory import pose_matrix, trajectory_of
    from hypermap.recordings.tum import read_trajectory

    read, notes = read_trajectory(path, options.max_pose_gap)
    for text in notes:
        note(text)
    map_T_camera = options.poses_in_map(pose_matrix(read.positions, read.quats_xyzw))
    return trajectory_of(read.stamps - options.time_offset, map_T_camera, options.max_pose_gap)
