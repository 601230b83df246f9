"""An image cut into surfaces: planes first, then other connected parts.

All in disparity, 1 / depth [1/m], because there a plane is an affine function of the pixel, and
the noise of a depth camera, which grows with the square of the depth, is constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera
from hypermap.perception.planes import UNFIT, find_planes

SAME = 4.0  # standard deviations of the noise by which two pixels may differ beyond `max_gap`
STEEP = 8.0  # slope, depth per width, at which neighbors may still be on one surface: 83 degrees
REACH = 2  # rows and columns between pixels of one surface, as edges often lose a pixel
LOST = 4  # pixels without depth across which two regions still border on each other
UNSURE = 0.1  # weight of an end behind what is nearer on the other side of a wider gap


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The surfaces of an image; the first `planes` of them are planes.

    Attributes:
        labels: the surface of each pixel, -1 where there is no point, int32, shape (H, W).
        disparity: 1 / depth [1/m], 0 where there is no point, float32, shape (H, W).
        sizes: pixels of each surface, shape (N,).
        own_border: the share of each surface's depth edges where it is the nearer
            side, 1 if there are none, shape (N,). A wall seen between the legs of a
            chair ends only where something is in front of it, and so has 0.
        planes: how many of them are planes.
    """

    labels: NDArray[np.int32]
    disparity: NDArray[np.float32]
    sizes: IntArray
    own_border: NDArray[np.float64]
    planes: int


def find_surfaces(
    depth: NDArray[np.float32], valid: BoolArray, camera: Camera, config: PerceptionConfig
) -> Surfaces:
    """Return the surfaces of an image.

    Args:
        depth: along the optical axis [m], shape (H, W).
        valid: which of its pixels have a point, shape (H, W).
        camera: intrinsics.
        config: noise and thresholds.
    """
    height, width = valid.shape
    disparity = np.empty((height, width), np.float32)
    _invert(depth, valid, disparity)
    labels, planes = find_planes(disparity, camera, config)
    thresholds = (
        config.max_gap,
        STEEP / min(camera.K[0, 0], camera.K[1, 1]),
        SAME * config.depth_noise,
    )
    count = _label_rest(
        disparity.ravel(),
        labels.ravel(),
        width,
        planes,
        thresholds,
        starts=np.empty(disparity.size, np.int32),
        ends=np.empty(disparity.size, np.int32),
        roots=np.empty(disparity.size, np.int32),
        first_of_row=np.zeros(height + 1, np.int64),
    )
    # The last one, index -1, is for pixels on no surface.
    sizes, near, far = np.zeros(count + 1, np.int64), np.zeros(count + 1), np.zeros(count + 1)
    above, farthest = np.full(width, -1, np.int32), np.float32(config.max_depth)
    _measure(depth, disparity, labels, farthest, above, sizes, near, far, thresholds)
    sizes, near, far = sizes[:count], near[:count], far[:count]
    ends = near + far
    return Surfaces(
        labels=labels,
        disparity=disparity,
        sizes=sizes,
        own_border=np.divide(near, ends, out=np.ones(count), where=ends > 0),
        planes=planes,
    )


@loop()
def _invert(depth: NDArray[np.float32], valid: BoolArray, disparity: NDArray[np.float32]) -> None:
    """Fill in the disparity of each pixel, 0 where none is valid, shapes (H, W)."""
    for row in range(valid.shape[0]):
        z, is_valid, inverse = depth[row], valid[row], disparity[row]
        for col in range(len(z)):
            inverse[col] = np.float32(1) / z[col] if is_valid[col] else np.float32(0)


@inner_loop()
def _is_near(one: float, other: float, max_gap: float, steep: float, tolerance: float) -> bool:
    """Return whether two depths, given as disparities, may be of neighbors on one surface.

    They differ by less than the gap, and by less than on the steepest surface, plus noise. From
    near, a step of a centimeter between two things is many times wider than their pixels.
    """
    return abs(one - other) < min(max_gap * one * other, steep * min(one, other)) + tolerance


@loop()
def _label_rest(
    pixels: NDArray[np.float32],
    flat_labels: NDArray[np.int32],
    width: int,
    first: int,
    thresholds: tuple[float, float, float],
    starts: NDArray[np.int32],
    ends: NDArray[np.int32],
    roots: NDArray[np.int32],
    first_of_row: NDArray[np.int64],
) -> int:
    """Label the connected components off the planes, from `first` on; return the next label.

    Adjacent pixels of a row that are near each other form a run. Connected runs get one
    root, the first of them. Starts, ends and roots have room for as many runs as there are pixels;
    the first run of each row is initially 0.
    """
    height = len(pixels) // width
    count = 0
    for row in range(height):
        end = UNFIT
        for pixel in range(row * width, (row + 1) * width):
            if flat_labels[pixel] != UNFIT or pixels[pixel] == 0:
                continue
            one, other = pixels[pixel - 1], pixels[pixel]
            if pixel != end or not _is_near(one, other, *thresholds):
                roots[count], starts[count] = count, pixel
                count += 1
            ends[count - 1] = end = pixel + 1
        first_of_row[row + 1] = count
        for up in range(min(REACH, row) + 1):
            begin, above = first_of_row[row - up], up * width
            for run in range(first_of_row[row], count):
                while begin < run and ends[begin] + above + REACH <= starts[run]:
                    begin += 1
                for other in range(begin, min(run, first_of_row[row - up + 1])):
                    if starts[other] + above >= ends[run] + REACH:
                        break
                    one_root, other_root = _root(roots, run), _root(roots, other)
                    if one_root != other_root and _are_connected(
                        pixels,
                        (starts[run], ends[run]),
                        (starts[other], ends[other]),
                        above,
                        thresholds,
                    ):
                        roots[max(one_root, other_root)] = min(one_root, other_root)
    label = first
    for run in range(count):
        if roots[run] == run:
            roots[run] = label
            label += 1
        else:
            roots[run] = roots[roots[run]]  # the root already has its label
        for pixel in range(starts[run], ends[run]):
            flat_labels[pixel] = roots[run]
    return label


@inner_loop()
def _root(roots: NDArray[np.int32], run: int) -> int:
    """Return the root of a run, with path halving."""
    while roots[run] != run:
        roots[run] = roots[roots[run]]
        run = roots[run]
    return run


@inner_loop()
def _are_connected(
    pixels: NDArray[np.float32],
    run: tuple[int, int],
    other: tuple[int, int],
    above: int,
    thresholds: tuple[float, float, float],
) -> bool:
    """Return whether a pixel of a run is near one of another run, up to `REACH` columns apart.

    Args:
        pixels: disparity of all [1/m].
        run: where it begins and ends.
        other: where the other one begins and ends.
        above: by how many pixels the other run's row comes before.
        thresholds: as in `_measure`.
    """
    for pixel in range(
        max(run[0], other[0] + above - REACH), min(run[1], other[1] + above + REACH)
    ):
        neighbor = pixel - above
        for near in range(max(neighbor - REACH, other[0]), min(neighbor + REACH + 1, other[1])):
            if _is_near(pixels[pixel], pixels[near], *thresholds):
                return True
    return False


@loop()
def _measure(
    depth: NDArray[np.float32],
    disparity: NDArray[np.float32],
    labels: NDArray[np.int32],
    farthest: np.float32,
    above: NDArray[np.int32],
    sizes: IntArray,
    near: NDArray[np.float64],
    far: NDArray[np.float64],
    thresholds: tuple[float, float, float],
) -> None:
    """Count the pixels of each surface, and how often it ends in front of and behind another one.

    What is farther than `farthest` is behind all surfaces. What has no depth may be too far away to
    be measured, or dark and near. So a surface beside a wide gap ends in front of what is farther
    on the other side, or of the image's border; but that it ends behind what is nearer is unsure.

    Args:
        depth: of each pixel [m], shape (H, W).
        disparity: as in `Surfaces`.
        labels: as there.
        farthest: pixels with more depth are on no surface [m].
        above: a buffer, -1 in each of W columns: the last row that has a depth.
        sizes: zeros, shape (N + 1,); the last one counts pixels on no surface.
        near: zeros, shape (N + 1,): ends in front of something farther.
        far: zeros, shape (N + 1,): ends behind something nearer.
        thresholds: `max_gap` as in the configuration [m], the steepest slope per pixel [1],
            and what is noise [1/m].
    """
    height, width = disparity.shape
    for row in range(height):
        left, left_label, size = -1, np.int32(UNFIT), 0  # the same of this row, and its run
        for col in range(width):
            d, label, up = disparity[row, col], labels[row, col], above[col]
            if d == 0 and not depth[row, col] > farthest:
                continue
            if left >= 0:
                neighbor, is_wide = disparity[row, left], col - left > LOST
                _end(near, far, label, d, left_label, neighbor, is_wide, thresholds)
            elif col > LOST:
                near[label] += 1
            if up >= 0:
                other, neighbor, is_wide = labels[up, col], disparity[up, col], row - up > LOST
                _end(near, far, label, d, other, neighbor, is_wide, thresholds)
            elif row > LOST:
                near[label] += 1
            if label != left_label:
                sizes[left_label] += size
                size = 0
            size += 1
            left, left_label, above[col] = col, label, row
        sizes[left_label] += size
        if left >= 0 and width - 1 - left > LOST:
            near[left_label] += 1
    for col in range(width):
        if above[col] >= 0 and height - 1 - above[col] > LOST:
            near[labels[above[col], col]] += 1


@inner_loop()
def _end(
    near: NDArray[np.float64],
    far: NDArray[np.float64],
    label: np.int32,
    d: float,
    other_label: np.int32,
    other_d: float,
    is_wide: bool,
    thresholds: tuple[float, float, float],
) -> None:
    """Count which surface ends in front of the other and which behind, if both end here."""
    if label != other_label and not _is_near(d, other_d, *thresholds):
        near[label if d > other_d else other_label] += 1
        far[other_label if d > other_d else label] += UNSURE if is_wide else 1.0
