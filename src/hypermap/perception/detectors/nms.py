"""Non-maximum suppression: of several boxes around one object, keep the best."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import FloatArray, IntArray


def suppress(
    xyxy: FloatArray, scores: FloatArray, class_ids: IntArray, iou_threshold: float
) -> NDArray[np.intp]:
    """Return the indices of the boxes to keep, by descending score, shape (K,).

    A box is dropped if it overlaps a better one of its class by more than the threshold.

    Args:
        xyxy: the boxes [pixels], shape (N, 4).
        scores: of each, shape (N,).
        class_ids: of each, shape (N,).
        iou_threshold: the largest IoU of two boxes of a class that both stay.

    >>> boxes = np.array([[0, 0, 10, 10], [1, 0, 10, 10], [0, 0, 10, 9.0]])
    >>> suppress(boxes, np.array([0.8, 0.9, 0.7]), np.array([0, 0, 5]), 0.45)
    array([1, 2])
    """
    left = np.argsort(-scores, kind="stable")
    kept = []
    while left.size:
        best, left = left[0], left[1:]
        kept.append(best)
        goes = (class_ids[left] == class_ids[best]) & (_iou(xyxy[best], xyxy[left]) > iou_threshold)
        left = left[~goes]
    return np.array(kept, dtype=np.intp)


def _iou(box: FloatArray, others: FloatArray) -> FloatArray:
    """Return the intersection over union of one box with others (N, 4), shape (N,)."""
    upper_left = np.maximum(box[:2], others[:, :2])
    lower_right = np.minimum(box[2:], others[:, 2:])
    shared = np.clip(lower_right - upper_left, 0, None).prod(axis=1)
    union = (box[2:] - box[:2]).prod() + (others[:, 2:] - others[:, :2]).prod(axis=1) - shared
    iou: FloatArray = np.divide(shared, union, out=np.zeros_like(shared), where=union > 0)
    return iou
