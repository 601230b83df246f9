"""Reads the camera poses of a folder whose files carry the numbers of their frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.recordings.layouts import FoundFiles
from hypermap.recordings.options import nearest_rigid
from hypermap.recordings.textfiles import parse_numbers, read_lines, read_matrix, words_of

_LEAST_POSES = 20  # of which an order can be told

# As recorded, shape (4, 4); None where tracking was lost; or why it cannot be read.
NumberedPose = NDArray[np.float64] | HypermapError | None


def read_numbered_poses(files: FoundFiles) -> dict[int, NumberedPose]:
    """Return the poses of a folder by the number of their frame.

    Raises:
        FormatError: If one file of all poses cannot be read.
    """
    if files.trajectory is None:
        return {number: _pose_in(path) for number, path in files.poses.items()}
    poses = _poses_in(files.trajectory)
    numbers = list(files.depth)
    if len(numbers) == len(poses):
        return dict(zip(numbers, poses, strict=True))
    # Some are absent, so the numbers of the images count.
    return dict(enumerate(poses, start=_first_number(min(numbers), max(numbers), len(poses))))


def are_sorted_as_text(poses: Sequence[NumberedPose]) -> bool:
    """Return whether poses seem to be in the order 0, 1, 10, 11, 2, as files are often listed.

    The camera then goes less than half as far if they are taken in the order of their numbers.
    """
    known = [pose[:3, 3] for pose in poses if isinstance(pose, np.ndarray)]
    if len(known) < max(len(poses), _LEAST_POSES):
        return False
    listed = np.array(known)
    for first in (0, 1):
        order = np.argsort([str(first + i) for i in range(len(listed))])
        numbered = np.empty_like(listed)
        numbered[order] = listed
        if 2 * _length(numbered) < _length(listed):
            return True
    return False


def _length(positions: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def _first_number(first: int, last: int, poses: int) -> int:
    """Return whether numbers from `first` to `last` are from 0 on, as in most data sets, or 1."""
    if first == 0 or last == poses - 1:
        return 0
    return int(first == 1 or last == poses)


def _pose_in(path: Path) -> NumberedPose:
    try:
        return _rigid(read_matrix(path, 4), path)
    except (FileMissing, FormatError) as error:
        return error


def _poses_in(path: Path) -> list[NumberedPose]:
    """Return the poses of a file of all: a matrix a line, or four rows after a line of three.

    A line has the 16 numbers of a 4 x 4 matrix, or the first 12 of them, as in KITTI's files.
    Source of the second format: Choi et al., CVPR 2015 (Redwood), as Open3D writes it.
    """
    lines = [(key, parse_numbers(words_of(text), path, key)) for key, text in read_lines(path)]
    if path.suffix == ".log":
        lengths, expected = [3, 4, 4, 4, 4], "groups of three numbers and four rows of four"
    else:
        length = 12 if lines and len(lines[0][1]) == 12 else 16
        lengths, expected = [length], "16 or 12 numbers in each line"
    count = len(lengths)
    wrong = [key for i, (key, row) in enumerate(lines) if len(row) != lengths[i % count]]
    if wrong or not lines or len(lines) % count:
        place = wrong[0] if wrong else lines[-1][0] if lines else None
        what = f"expected {expected}, row by row of a 4 x 4 matrix"
        raise FormatError(what, path=path, key=place)
    rows = [row for _, row in lines]
    poses = [np.concatenate(rows[i : i + count])[-16:] for i in range(0, len(rows), count)]
    matrices = [pose.reshape(-1, 4) for pose in poses]
    return [_rigid_or_error(np.vstack([pose, np.eye(4)[len(pose) :]]), path) for pose in matrices]


def _rigid_or_error(matrix: NDArray[np.float64], path: Path) -> NumberedPose:
    try:
        return _rigid(matrix, path)
    except FormatError as error:
        return error


def _rigid(matrix: NDArray[np.float64], path: Path) -> NDArray[np.float64] | None:
    """Return the pose in a matrix; None if a number says that tracking was lost.

    Raises:
        FormatError: If it is not that of a rigid transform.
    """
    if not np.isfinite(matrix).all():
        return None
    try:
        return nearest_rigid(matrix)
    except ValueError as error:
        raise FormatError(str(error), path=path) from None
