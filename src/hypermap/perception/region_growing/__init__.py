"""The thesis' segmentation: the largest smooth region of the points in an object's box.

`organised` looks up neighbors in the image and is fast; `unorganised` finds them in a k-d
tree of all points, as PCL does, and is its reference. Other modules import only this package.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.region_growing import organised


def largest_regions(
    frame: RgbdFrame, valid: BoolArray, objects: Sequence[IntArray], config: PerceptionConfig
) -> list[IntArray]:
    """Return the pixels of each object's largest region of valid size; empty if there is none.

    Args:
        frame: depth or points, and intrinsics.
        valid: which of its pixels have a point, shape (H, W).
        objects: increasing row-major indices of the valid pixels of each object, none empty.
        config: method, neighbors and thresholds.
    """
    if config.method == "organised":
        regions = organised.grow_regions(frame, valid, objects, config)
    else:
        # Only here, as its k-d tree takes a fifth of a second to import.
        from hypermap.perception.region_growing import unorganised

        regions = unorganised.grow_regions(frame.points(), valid, objects, config)
    return [
        _largest(pixels, region_of, config.min_cluster, config.max_cluster)
        for pixels, region_of in zip(objects, regions, strict=True)
    ]


def _largest(pixels: IntArray, region_of: IntArray, fewest: int, most: int) -> IntArray:
    """Return the pixels of the largest region of valid size; empty if there is none."""
    sizes = np.bincount(region_of)
    sizes[(sizes < fewest) | (sizes > most)] = 0
    largest = sizes.argmax()
    return pixels[region_of == largest] if sizes[largest] > 0 else pixels[:0]
