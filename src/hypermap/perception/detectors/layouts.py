"""What the outputs of the known families of networks mean.

Each family is one `Layout`: how it wants the image, how to recognise its outputs, and how to turn
them into `Candidates`. A new family is two functions and a row in `LAYOUTS`.

"Cells" are the squares of 8, 16 and 32 pixels into which a network divides its input, in this
order, row by row; each proposes one box (YOLOv5: three).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import FloatArray, IntArray
from hypermap.perception.detectors.placement import Placement, centred, stretched, top_left

YOLOX_STRIDES = (8, 16, 32)
STRIDES = (YOLOX_STRIDES, (4, 8, 16, 32), (8, 16, 32, 64))  # the last two: "p2" and "p6" networks


@dataclass(frozen=True, eq=False)
class Outputs:
    """What a network answers to one image.

    Attributes:
        table: the boxes with what belongs to them, shape (A, B).
        prototypes: the masks from which all are mixed, shape (M, h, w); M = 0 if there are none.
        input_size: columns and rows of the network's input.
    """

    table: NDArray[np.float32]
    prototypes: NDArray[np.float32]
    input_size: tuple[int, int]

    @classmethod
    def of(cls, arrays: Iterable[NDArray[np.float32]], input_size: tuple[int, int]) -> Outputs:
        """Return what is in the arrays of a batch of one; inner layers' (1, 3, h, w, ...) are left.

        Raises:
            ValueError: If there is not one table, or more than one set of prototypes.
        """
        single = [array for array in arrays if array.ndim > 0 and len(array) == 1]
        tables = [array[0] for array in single if array.ndim == 3]
        prototypes = [array[0] for array in single if array.ndim == 4]
        if len(tables) != 1 or len(prototypes) > 1:
            raise ValueError("expected one table (1, A, B), and at most one (1, M, h, w)")
        nothing = np.zeros((0, 1, 1), np.float32)
        return cls(tables[0], prototypes[0] if prototypes else nothing, input_size)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Boxes that a network proposes, as parallel arrays.

    Attributes:
        xyxy: in pixels of the network's input, shape (N, 4).
        scores: 0..1, shape (N,).
        class_ids: shape (N,).
        mixture: how much of each prototype makes the mask, shape (N, M).
        class_count: how many classes the network tells apart; None if its outputs do not say.
    """

    xyxy: FloatArray
    scores: FloatArray
    class_ids: IntArray
    mixture: FloatArray
    class_count: int | None

    def __getitem__(self, index: Any) -> Candidates:
        return replace(
            self,
            xyxy=self.xyxy[index],
            scores=self.scores[index],
            class_ids=self.class_ids[index],
            mixture=self.mixture[index],
        )


@dataclass(frozen=True)
class Layout:
    """A family of networks.

    Attributes:
        name: of the family.
        shape: of its table, in words.
        fits: whether outputs are of this family.
        decode: turns outputs into candidates.
        place: puts an image into the input.
        is_bgr: channels in the order blue, green, red, instead of red, green, blue.
        white: value of a white pixel; black is 0.
        is_final: the candidates of one object have been reduced to one already.
    """

    name: str
    shape: str
    fits: Callable[[Outputs], bool]
    decode: Callable[[Outputs], Candidates]
    place: Callable[[tuple[int, int], tuple[int, int]], Placement] = centred
    is_bgr: bool = False
    white: float = 1.0
    is_final: bool = False


def recognise(outputs: Outputs) -> Layout:
    """Return the family whose outputs look like these.

    Raises:
        ValueError: If none is known.
    """
    for layout in LAYOUTS:
        if layout.fits(outputs):
            return layout
    raise ValueError("no known layout fits")


def _count_cells(input_size: tuple[int, int], strides: tuple[int, ...]) -> int:
    return sum((input_size[0] // s) * (input_size[1] // s) for s in strides)


# YOLOv8: (x, y, w, h, class scores, mixture) down each column


def _is_yolov8(outputs: Outputs) -> bool:
    channels, boxes = outputs.table.shape
    has_scores = channels > 4 + len(outputs.prototypes)
    return has_scores and boxes in [_count_cells(outputs.input_size, s) for s in STRIDES]


def _decode_yolov8(outputs: Outputs) -> Candidates:
    rows = outputs.table.T
    masks_at = rows.shape[1] - len(outputs.prototypes)
    return _best_class(_corners(rows[:, :4]), rows[:, 4:masks_at], rows[:, masks_at:])


# YOLOX: (x, y, log w, log h, objectness, class scores), in units of the cell and from its corner


def _is_yolox(outputs: Outputs) -> bool:
    boxes, channels = outputs.table.shape
    has_scores = channels > 5 and not len(outputs.prototypes)
    if not has_scores or boxes != _count_cells(outputs.input_size, YOLOX_STRIDES):
        return False
    # Exported with its decoding inside, or by YOLOv6, the same shape holds pixels.
    return bool(np.median(np.abs(outputs.table[:, :2])) < min(YOLOX_STRIDES))


def _decode_yolox(outputs: Outputs) -> Candidates:
    rows = outputs.table
    cells, strides = _cells(outputs.input_size)
    xywh = np.hstack([rows[:, :2] + cells, np.exp(rows[:, 2:4])]) * strides
    return _best_class(_corners(xywh), rows[:, 4:5] * rows[:, 5:], rows[:, :0])


def _cells(input_size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return (column, row) of every cell, shape (N, 2), and its stride, shape (N, 1)."""
    cells, strides = [], []
    for stride in YOLOX_STRIDES:
        rows, columns = np.indices((input_size[1] // stride, input_size[0] // stride))
        cells.append(np.stack([columns.ravel(), rows.ravel()], axis=1))
        strides.append(np.full((columns.size, 1), stride))
    return np.concatenate(cells).astype(np.float32), np.concatenate(strides).astype(np.float32)


# YOLOv5: (x, y, w, h, objectness, class scores, mixture)


def _is_yolov5(outputs: Outputs) -> bool:
    boxes, channels = outputs.table.shape
    has_scores = channels > 5 + len(outputs.prototypes)
    return has_scores and boxes in [3 * _count_cells(outputs.input_size, s) for s in STRIDES]


def _decode_yolov5(outputs: Outputs) -> Candidates:
    rows = outputs.table
    masks_at = rows.shape[1] - len(outputs.prototypes)
    return _best_class(
        _corners(rows[:, :4]), rows[:, 4:5] * rows[:, 5:masks_at], rows[:, masks_at:]
    )


# End to end: (xmin, ymin, xmax, ymax, score, class, mixture)


def _is_end_to_end(outputs: Outputs) -> bool:
    return outputs.table.shape[1] == 6 + len(outputs.prototypes) and not _is_rt_detr(outputs)


def _decode_end_to_end(outputs: Outputs) -> Candidates:
    rows = outputs.table
    return Candidates(rows[:, :4], rows[:, 4], np.rint(rows[:, 5]).astype(int), rows[:, 6:], None)


# RT-DETR: (x, y, w, h, class scores), the input being 1 wide and 1 high


def _is_rt_detr(outputs: Outputs) -> bool:
    table = outputs.table
    has_scores = table.shape[1] > 4 and not len(outputs.prototypes)
    # Exports that do suppression themselves answer all zeros where they find nothing.
    return bool(has_scores and table.any() and (table >= 0).all() and (table <= 1).all())


def _decode_rt_detr(outputs: Outputs) -> Candidates:
    rows = outputs.table
    xyxy = _corners(rows[:, :4]) * np.array(outputs.input_size * 2, np.float32)
    return _best_class(xyxy, rows[:, 4:], rows[:, :0])


def _corners(xywh: FloatArray) -> FloatArray:
    """Return (xmin, ymin, xmax, ymax) of boxes given by centre and size, shape (N, 4)."""
    centres, halves = xywh[:, :2], xywh[:, 2:] / 2
    return np.hstack([centres - halves, centres + halves])


def _best_class(xyxy: FloatArray, class_scores: FloatArray, mixture: FloatArray) -> Candidates:
    class_ids = class_scores.argmax(axis=1)
    scores = class_scores[np.arange(len(class_ids)), class_ids]
    return Candidates(xyxy, scores, class_ids, mixture, class_scores.shape[1])


LAYOUTS = (
    Layout("YOLOv8, YOLO11", "(1, 4 + classes, cells)", _is_yolov8, _decode_yolov8),
    Layout(
        "YOLOX, not decoded",
        "(1, cells, 5 + classes)",
        _is_yolox,
        _decode_yolox,
        place=top_left,
        is_bgr=True,
        white=255.0,
    ),
    Layout("YOLOv5, YOLOv7", "(1, 3 cells, 5 + classes)", _is_yolov5, _decode_yolov5),
    Layout(
        "YOLOv10, YOLO26",
        "(1, boxes, 6)",
        _is_end_to_end,
        _decode_end_to_end,
        is_final=True,
    ),
    Layout(
        "RT-DETR",
        "(1, boxes, 4 + classes)",
        _is_rt_detr,
        _decode_rt_detr,
        place=stretched,
        is_final=True,
    ),
)
