"""Logged frames as if taken from other poses, many at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise, repeat
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.formats.array_file import ArrayFile, parse_arrays, unpacked_shapes
from hypermap.mapping.color_arrays import unpacked_colors
from hypermap.mapping.frame_log import FARTHEST_CELL, LoggedFrame, floor_motions
from hypermap.mapping.packed_frames import FORMAT, VERSION, unpacked
from hypermap.mapping.seen_cells import SeenCells
from hypermap.perception.depth_view import DepthView
from hypermap.perception.frame import Camera
from hypermap.perception.observation import Observation, ObservedObject

ROUNDING = 1e-9
"""Largest difference between the numbers of equal poses."""

_WRONG = (
    *(KeyError, TypeError, ValueError, IndexError, OverflowError),
    *(AttributeError, shapely.GEOSException),
)
_FLOAT32 = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)

_Arrays = Mapping[str, NDArray[Any]]


class _Way(NamedTuple):
    """How a frame moves.

    Attributes:
        motion: over the floor.
        rise: how far it rises [m].
        pose: its new `map_T_camera`, shape (4, 4).
        with_map: whether it moves as its whole map does.
        turn: of that map [rad].
    """

    motion: Pose2D
    rise: float
    pose: NDArray[np.float64]
    with_map: bool
    turn: float


def moved_frames(
    contents: Sequence[bytes],
    poses: Sequence[NDArray[np.float64]] | NDArray[np.float64],
    resolution: float,
    path: str,
    a_T_b: Pose2D | None = None,
) -> list[LoggedFrame]:
    """Return logged frames as if taken from other poses, whose roll and pitch are ignored.

    Those that move in their map were not corrected by a map: their poses are the recorded ones from
    now on. Many at once are faster.

    Args:
        contents: the frames, as `packed_frame` has packed them.
        poses: new `map_T_camera` of each, shape (4, 4).
        resolution: side of a cell [m].
        path: name of their file in messages.
        a_T_b: how their whole map moves; None if it does not.

    Raises:
        FormatError: If one is damaged, or of a later version.
    """
    try:
        parts = [unpacked(one) for one in contents]
        files = [parse_arrays(plain, FORMAT, VERSION, path) for plain, _ in parts]
        if not files:
            return []
        before = np.array([file.arrays["pose"].reshape(4, 4) for file in files])
        motions, rises = zip(*floor_motions(before, np.asarray(poses)), strict=True)
        matrices = np.array([motion.matrix() for motion in motions])
        after = _in_space(matrices, rises) @ before
        turn = 0.0 if a_T_b is None else a_T_b.yaw
        whole = before if a_T_b is None else _in_space(a_T_b.matrix()[np.newaxis], [0.0]) @ before
        with_map = (np.abs(after - whole).max(axis=(1, 2)) <= ROUNDING).tolist()
        each = zip(
            *(files, [rest for _, rest in parts], _moved_shapes(files, matrices)),
            map(_Way, motions, rises, after, with_map, repeat(turn)),
            strict=True,
        )
        return [_frame(*one, resolution) for one in each]
    except _WRONG as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def turned(correction: tuple[float, float, float], yaw: float) -> tuple[float, float, float]:
    """Return how a pose was corrected, in a frame that is turned by an angle [rad]."""
    if yaw == 0:
        return correction
    ((x, y),) = Pose2D(yaw=yaw).apply([correction[:2]]).tolist()
    return x, y, correction[2]


def _moved_shapes(
    files: Sequence[ArrayFile], matrices: NDArray[np.float64]
) -> list[list[shapely.Polygon]]:
    """Return the moved shapes of each frame: its visible area, and its footprints.

    Args:
        files: N frames.
        matrices: homogeneous, of how the floor moves, shape (N, 3, 3).
    """
    names = "shapes.points", "shapes.wkb", "shapes.lengths"
    joined = {name: np.concatenate([f.arrays[name] for f in files], axis=-1) for name in names}
    x, y = joined["shapes.points"]
    sizes = [file.arrays["shapes.points"].shape[1] for file in files]
    (a, b, c), (d, e, f) = np.repeat(matrices[:, :2].transpose(1, 2, 0), sizes, axis=2)
    joined["shapes.points"] = np.stack([a * x + b * y + c, d * x + e * y + f])
    shapes = unpacked_shapes("shapes", joined).tolist()
    ends = np.cumsum([len(file.arrays["shapes.lengths"]) for file in files]).tolist()
    return [shapes[begin:end] for begin, end in pairwise([0, *ends])]


def _in_space(motions: NDArray[np.float64], rises: Sequence[float]) -> NDArray[np.float64]:
    """Return motions over the floor, shape (N, 3, 3), with rises [m], as matrices (N, 4, 4)."""
    matrices = np.tile(np.eye(4), (len(motions), 1, 1))
    rows = np.array([0, 1, 3])
    matrices[:, rows[:, np.newaxis], rows] = motions
    matrices[:, 2, 3] = rises
    return matrices


def _frame(
    file: ArrayFile,
    low_bytes: bytes,
    shapes: Sequence[shapely.Polygon],
    way: _Way,
    resolution: float,
) -> LoggedFrame:
    """Return a frame that moves, whose shapes have moved already."""
    facts, arrays = file.facts, file.arrays
    area, *footprints = shapes
    numbers = arrays["objects"].reshape(-1, 3).tolist()
    colors = unpacked_colors("colors", arrays, len(numbers))
    objects = tuple(
        ObservedObject(str(name), score, footprint, z_min + way.rise, z_max + way.rise, color=color)
        for name, footprint, (score, z_min, z_max), color in zip(
            facts["names"], footprints, numbers, colors, strict=True
        )
    )
    view = _view(facts["view"], arrays, low_bytes, way.pose)
    x, y, yaw = map(float, facts.get("correction", (0, 0, 0)))  # not in earlier versions
    correction = turned((x, y, yaw), way.turn) if way.with_map else (0.0, 0.0, 0.0)
    observation = Observation(float(facts["stamp"]), way.pose, objects, area, view, correction)
    seen = _cells(facts["cells"], arrays)
    seen = None if seen is None else seen.moved(way.motion, resolution)
    return LoggedFrame(observation, seen, bool(facts["finds_objects"]))


def _view(
    facts: Mapping[str, Any] | None,
    arrays: _Arrays,
    low_bytes: bytes,
    pose: NDArray[np.float64],
) -> DepthView | None:
    if facts is None:
        return None
    height, width = facts["size"]
    camera = _camera(tuple(map(tuple, facts["K"])), int(width), int(height))
    if arrays["reach"].ndim == 2:  # version 1
        low, high = arrays["reach"].reshape(2, -1)
    else:
        low, high = np.frombuffer(low_bytes, np.uint8), arrays["reach"]
    if high.dtype != np.uint8 or not (height * width,) == low.shape == high.shape:
        raise ValueError(f"there are {len(low)} ends of rays, not {height} x {width} in bytes")
    reach = np.empty((height, width), np.float32)
    _join_halves(low, high, _FLOAT32, reach)
    farthest = np.inf if facts["max_range"] is None else float(facts["max_range"])
    return DepthView(camera, pose, reach, farthest, int(facts.get("every", 1)))


@lru_cache(maxsize=4)
def _camera(K: tuple[tuple[float, ...], ...], width: int, height: int) -> Camera:
    return Camera(np.array(K, np.float64), width, height)  # all frames of a drive have the same


@loop()
def _join_halves(
    low: NDArray[np.uint8],
    high: NDArray[np.uint8],
    float32: NDArray[np.float32],
    reach: NDArray[np.float32],
) -> None:
    """Put numbers together of the low and the high bytes of float16.

    Args:
        low: shape (H W,), as `high`.
        high: likewise.
        float32: the value of each float16, shape (65536,).
        reach: filled, shape (H, W).
    """
    for row in range(reach.shape[0]):
        begin = row * reach.shape[1]
        for col in range(reach.shape[1]):
            bits = np.uint16(low[begin + col]) | np.uint16(high[begin + col]) << np.uint16(8)
            reach[row, col] = float32[bits]


def _cells(shape: list[int] | None, arrays: _Arrays) -> SeenCells | None:
    if shape is None:
        return None
    height, width = shape
    if min(height, width) < 0 or 2 * height * width > 8 * arrays["cells"].size:
        raise ValueError(f"there are fewer than {height} x {width} cells")
    first = arrays["first_cell"].reshape(2)
    if max(map(abs, first.tolist())) > FARTHEST_CELL:
        raise ValueError(f"a cell is more than {FARTHEST_CELL:g} cells away")
    bits = np.unpackbits(arrays["cells"], count=2 * height * width)
    is_hit, is_free = bits.view(np.bool_).reshape(2, height, width)
    return SeenCells(first, is_hit, is_free)
