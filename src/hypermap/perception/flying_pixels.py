"""Flying pixels: depths between two surfaces, which time of flight and stereo mix at edges.

They are on rays between an object and the background, and so make shapes on the floor longer.
Structured light has hardly any; there, pixels between two surfaces mostly show a thin object or
a table top seen from a little above it. So they are removed only if a frame has many of them.

Source: flying pixels: Sarbolandi, Lefloch, Kolb, "Kinect range sensing: structured-light versus
time-of-flight Kinect", CVIU 139, 2015. Counting support is the idea of PCL's radius outlier filter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, IntArray

SAME = 4.0  # standard deviations of noise between depths of one surface, at most
CLOSEST = 0.02  # meters by which they may always differ
MANY = 0.06  # remove them if this share of the pixels at depth edges flies


def without_flying(
    depth: NDArray[np.float32],
    valid: BoolArray,
    boxes: NDArray[np.float32],
    noise: float,
    support: int,
) -> BoolArray:
    """Return the valid pixels without those in some boxes that fly between two surfaces.

    A pixel flies if it has both a nearer and a farther neighbor, of the eight around it, and fewer
    than `support` at its depth. All stay if few of the pixels at depth edges fly, not counting
    those on planes seen edge-on.

    Args:
        depth: along the optical axis [m], shape (H, W).
        valid: which pixels have a point, shape (H, W).
        boxes: xmin, ymin, xmax, ymax [pixels], shape (N, 4); they may extend past the image.
        noise: standard deviation of the depth divided by its square [1/m].
        support: neighbors that a pixel needs; 0 keeps all pixels.

    Returns:
        Shape (H, W).
    """
    if support == 0:
        return valid
    kept, (height, width) = valid.copy(), depth.shape
    limits = np.float32(SAME * noise), np.float32(CLOSEST)
    low = np.floor(np.clip(np.nan_to_num(boxes[:, :2]), 1, [width - 1, height - 1]))
    high = np.ceil(np.clip(np.nan_to_num(boxes[:, 2:]), 1, [width - 1, height - 1]))
    counts = np.zeros(2, np.int64)
    for left, top, right, bottom in np.hstack([low, high]).astype(int).tolist():
        _drop_flying(depth, valid, left, top, right, bottom, *limits, support, kept, counts)
    jumps, flying = counts.tolist()
    return kept if flying > MANY * jumps else valid


@loop()
def _drop_flying(
    depth: NDArray[np.float32],
    valid: BoolArray,
    left: int,
    top: int,
    right: int,
    bottom: int,
    slope: np.float32,
    closest: np.float32,
    support: int,
    kept: BoolArray,
    counts: IntArray,
) -> None:
    """Set the flying pixels of a box in `kept` to False, except on the image's border.

    Adds to `counts` how many valid pixels are at depth edges, and how many of these surely fly.
    """
    for row in range(top, bottom):
        for col in range(left, right):
            z = depth[row, col]
            tolerance = max(slope * z * z, closest)
            # Most pixels are not at an edge. Comparisons with NaN are false.
            jumps = abs(depth[row, col - 1] - z) > tolerance
            jumps |= abs(depth[row, col + 1] - z) > tolerance
            jumps |= abs(depth[row - 1, col] - z) > tolerance
            jumps |= abs(depth[row + 1, col] - z) > tolerance
            if jumps and valid[row, col]:
                counts[0] += 1
                if _flies(depth, valid, row, col, tolerance, support):
                    counts[1] += not _is_on_plane(depth, row, col, tolerance)
                    kept[row, col] = False


@inner_loop()
def _flies(
    depth: NDArray[np.float32],
    valid: BoolArray,
    row: int,
    col: int,
    tolerance: np.float32,
    support: int,
) -> bool:
    """Return whether a pixel is between two surfaces, and on neither."""
    z = depth[row, col]
    same, nearer, farther = -1, False, False  # -1, since the pixel counts itself
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            if valid[row + dy, col + dx]:
                gap = depth[row + dy, col + dx] - z
                same += abs(gap) <= tolerance
                nearer |= gap < -tolerance
                farther |= gap > tolerance
    return same < support and nearer and farther


@inner_loop()
def _is_on_plane(depth: NDArray[np.float32], row: int, col: int, tolerance: np.float32) -> bool:
    """Return whether a pixel is on a plane with two opposite neighbors, as on a table top.

    Seen from a little above, its rows are far apart; but on a plane, disparity is linear.
    """
    z = depth[row, col]
    across = 1 / depth[row, col - 1] + 1 / depth[row, col + 1] - 2 / z
    down = 1 / depth[row - 1, col] + 1 / depth[row + 1, col] - 2 / z
    return bool(min(abs(across), abs(down)) * z * z <= tolerance)
