"""Instance masks from prototypes, as in YOLOv5, v8, 11 and 26."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, FloatArray
from hypermap.perception.detectors.placement import Placement, sample_bilinear


def mix_masks(
    mixture: FloatArray,
    prototypes: NDArray[np.float32],
    boxes: FloatArray,
    placement: Placement,
) -> BoolArray:
    """Return the pixels of each object.

    Args:
        mixture: weight of each prototype in the mask, shape (N, M).
        prototypes: shape (M, h, w), over the whole input of the network.
        boxes: xyxy in pixels of the image, shape (N, 4); a mask stays within its box.
        placement: where the image is in the input.

    Returns:
        Bool, shape (N, H, W) with the image's rows and columns.

    Source: Bolya et al., "YOLACT", ICCV 2019, section 3.1 (sigmoid > 0.5 is mixture > 0).
    """
    _, height, width = prototypes.shape
    image_width, image_height = placement.image_size
    masks = np.zeros((len(boxes), image_height, image_width), dtype=bool)
    for mask, weights, box in zip(masks, mixture, boxes, strict=True):
        xmin, ymin, xmax, ymax = np.ceil(box).astype(int)
        x, y = placement.to_input(np.arange(xmin, xmax) + 0.5, np.arange(ymin, ymax) + 0.5)
        columns = x * (width / placement.input_size[0]) - 0.5
        rows = y * (height / placement.input_size[1]) - 0.5
        mixed = np.tensordot(weights, prototypes, axes=1)
        mask[ymin:ymax, xmin:xmax] = sample_bilinear(mixed, rows, columns) > 0
    return masks
