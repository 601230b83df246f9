"""The outputs of the YOLO families: how to recognize them, and what they mean.

"Cells" are the squares of 8, 16 and 32 pixels into which a network divides its input, in this
order, row by row; each proposes one box (YOLOv5: three).
"""

from __future__ import annotations

import numpy as np

from hypermap.core.arrays import FloatArray
from hypermap.perception.detectors.layout import Candidates, Layout, Outputs, corners
from hypermap.perception.detectors.placement import top_left

YOLOX_STRIDES = (8, 16, 32)
STRIDES = (YOLOX_STRIDES, (16, 32), (4, 8, 16, 32), (8, 16, 32, 64))  # and "tiny", "p2", "p6"
BYTES = (1 / 255, 1 / 255, 1 / 255)  # pixels stay between 0 and 255


def _count_cells(input_size: tuple[int, int], strides: tuple[int, ...]) -> int:
    return sum((input_size[0] // s) * (input_size[1] // s) for s in strides)


def _counts(input_size: tuple[int, int]) -> list[int]:
    return [_count_cells(input_size, strides) for strides in STRIDES]


# YOLOv8: (x, y, w, h, class scores, mixture) down each column


def _is_yolov8(outputs: Outputs) -> bool:
    channels, boxes = outputs.table.shape
    has_scores = channels > 4 + len(outputs.prototypes)
    return has_scores and boxes in _counts(outputs.input_size)


def _decode_yolov8(outputs: Outputs) -> Candidates:
    rows = outputs.table.T
    masks_at = rows.shape[1] - len(outputs.prototypes)
    return Candidates.best(corners(rows[:, :4]), rows[:, 4:masks_at], rows[:, masks_at:])


# YOLOv5: (x, y, w, h, objectness, class scores, mixture)


def _is_yolov5(outputs: Outputs) -> bool:
    boxes, channels = outputs.table.shape
    has_scores = channels > 5 + len(outputs.prototypes)
    return has_scores and boxes in [3 * count for count in _counts(outputs.input_size)]


def _decode_yolov5(outputs: Outputs) -> Candidates:
    rows = outputs.table
    masks_at = rows.shape[1] - len(outputs.prototypes)
    scores = rows[:, 4:5] * rows[:, 5:masks_at]
    return Candidates.best(corners(rows[:, :4]), scores, rows[:, masks_at:])


# YOLOX and YOLOv6 share a shape: (x, y, w, h, objectness, class scores). YOLOv6 has no
# objectness and writes 1. YOLOX has (x, y, log w, log h) in units of the cell and from its corner,
# unless the export includes decoding: then centers are near their cells in pixels.


def _is_yolov6(outputs: Outputs) -> bool:
    return _has_yolox_shape(outputs) and bool((outputs.table[:, 4] == 1).all())


def _is_decoded_yolox(outputs: Outputs) -> bool:
    if not _has_yolox_shape(outputs) or _is_yolov6(outputs):
        return False
    cells, strides = _cells(outputs.input_size)
    centers = outputs.table[:, :2]
    return bool(np.median(np.abs(centers / strides - cells)) < np.median(np.abs(centers)))


def _is_yolox(outputs: Outputs) -> bool:
    return _has_yolox_shape(outputs) and not _is_yolov6(outputs) and not _is_decoded_yolox(outputs)


def _decode_yolox(outputs: Outputs) -> Candidates:
    rows = outputs.table
    cells, strides = _cells(outputs.input_size)
    xywh = np.hstack([rows[:, :2] + cells, np.exp(rows[:, 2:4])]) * strides
    return Candidates.best(corners(xywh), rows[:, 4:5] * rows[:, 5:])


def _has_yolox_shape(outputs: Outputs) -> bool:
    boxes, channels = outputs.table.shape
    has_scores = channels > 5 and not len(outputs.prototypes)
    return has_scores and boxes == _count_cells(outputs.input_size, YOLOX_STRIDES)


def _cells(input_size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return (column, row) of every cell, shape (N, 2), and its stride, shape (N, 1)."""
    cells, strides = [], []
    for stride in YOLOX_STRIDES:
        rows, columns = np.indices((input_size[1] // stride, input_size[0] // stride))
        cells.append(np.stack([columns.ravel(), rows.ravel()], axis=1))
        strides.append(np.full((columns.size, 1), stride))
    return np.concatenate(cells).astype(np.float32), np.concatenate(strides).astype(np.float32)


# End to end: (xmin, ymin, xmax, ymax, score, class, mixture)


def _is_end_to_end(outputs: Outputs) -> bool:
    channels = outputs.table.shape[1]
    return channels == 6 + len(outputs.prototypes) and not outputs.is_relative


def _decode_end_to_end(outputs: Outputs) -> Candidates:
    rows = outputs.table
    return Candidates(rows[:, :4], rows[:, 4], np.rint(rows[:, 5]).astype(int), rows[:, 6:], None)


# YOLOv7 with suppression: (image, xmin, ymin, xmax, ymax, class, score), without a batch


def _is_final_yolov7(outputs: Outputs) -> bool:
    return [array.shape[1:] for array in outputs.arrays.values()] == [(7,)]


def _decode_final_yolov7(outputs: Outputs) -> Candidates:
    (rows,) = outputs.arrays.values()
    return Candidates(rows[:, 1:5], rows[:, 6], np.rint(rows[:, 5]).astype(int), rows[:, :0], None)


LAYOUTS = (
    Layout("YOLOv8, YOLO11", "(1, 4 + classes, cells)", _is_yolov8, _decode_yolov8),
    Layout("YOLOv5, YOLOv7", "(1, 3 cells, 5 + classes)", _is_yolov5, _decode_yolov5),
    Layout("YOLOv6", "(1, cells, 5 + classes)", _is_yolov6, _decode_yolov5),
    Layout(
        "YOLOX",
        "(1, cells, 5 + classes)",
        _is_yolox,
        _decode_yolox,
        place=top_left,
        is_bgr=True,
        std=BYTES,
    ),
    Layout(
        "YOLOX, decoded",
        "(1, cells, 5 + classes)",
        _is_decoded_yolox,
        _decode_yolov5,
        place=top_left,
        is_bgr=True,
        std=BYTES,
    ),
    Layout(
        "YOLOv10, YOLO26",
        "(1, boxes, 6)",
        _is_end_to_end,
        _decode_end_to_end,
        is_final=True,
    ),
    Layout(
        "YOLOv7 with suppression",
        "(boxes, 7)",
        _is_final_yolov7,
        _decode_final_yolov7,
        is_final=True,
    ),
)
