"""The thesis' way to cut an object out: the largest smooth region of the points in its box.

`organised` looks for neighbors in the image and is fast; `unorganised` looks for them in a k-d
tree of all points, as PCL does, and is the reference for it. Others know this front alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.region_growing import organised, unorganised


def largest_regions(
    frame: RgbdFrame, valid: BoolArray, objects: Sequence[IntArray], config: PerceptionConfig
) -> list[IntArray]:
    """Return the pixels of each object's largest region that may be one; none if there is none.

    Args:
        frame: depth or points, and intrinsics.
        valid: which of its pixels hold a point, shape (H, W).
        objects: increasing row-major indices of the valid pixels of each object, none empty.
        config: which of the two methods, neighbors and thresholds.
    """
    if config.method == "organised":
        regions = organised.grow_regions(frame, valid, objects, config)
    else:
        regions = unorganised.grow_regions(frame.points(), valid, objects, config)
    return [
        _largest(pixels, region_of, config.min_cluster, config.max_cluster)
        for pixels, region_of in zip(objects, regions, strict=True)
    ]


def _largest(pixels: IntArray, region_of: IntArray, fewest: int, most: int) -> IntArray:
    """Return the pixels of the largest region that may be an object; none if there is none."""
    sizes = np.bincount(region_of)
    sizes[(sizes < fewest) | (sizes > most)] = 0
    largest = sizes.argmax()
    return pixels[region_of == largest] if sizes[largest] > 0 else pixels[:0]
