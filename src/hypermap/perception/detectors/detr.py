"""The outputs of the DETR families: how to recognize them, and what they mean.

The whole image is stretched over their input. Each of some hundred queries proposes one box, and no
two propose the same.
"""

from __future__ import annotations

import numpy as np

from hypermap.core.arrays import FloatArray
from hypermap.perception.detectors.layout import Candidates, Layout, Outputs, corners
from hypermap.perception.detectors.placement import stretched

# COCO's images have 80 categories, but its numbers go from 1 to 90.
_UNUSED = (0, 12, 26, 29, 30, 45, 66, 68, 69, 71, 83)
COCO_COLUMNS = [number for number in range(91) if number not in _UNUSED]

IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


# RT-DETR, D-FINE and DEIM, by their own scripts: corners in pixels, since they are given the size


def _is_rt_detr(outputs: Outputs) -> bool:
    shapes = outputs.shapes("labels", "boxes", "scores")
    return shapes is not None and shapes == [
        (1, boxes := outputs.arrays["scores"].size),
        (1, boxes, 4),
        (1, boxes),
    ]


def _decode_rt_detr(outputs: Outputs) -> Candidates:
    labels, xyxy, scores = (outputs.arrays[name][0] for name in ("labels", "boxes", "scores"))
    return Candidates(xyxy, scores, labels.astype(int), xyxy[:, :0], None)


# RT-DETR by ultralytics: (x, y, w, h, score, class), once (x, y, w, h, class scores), the input
# being 1 wide and 1 high


def _is_ultralytics(outputs: Outputs) -> bool:
    rows = outputs.table
    return _is_table(outputs) and rows.shape[1] == 6 and bool((rows[:, 5] % 1 == 0).all())


def _decode_ultralytics(outputs: Outputs) -> Candidates:
    rows = outputs.table
    xyxy = _in_pixels(rows[:, :4], outputs)
    return Candidates(xyxy, rows[:, 4], rows[:, 5].astype(int), rows[:, :0], None)


def _is_old_ultralytics(outputs: Outputs) -> bool:
    scores = outputs.table[:, 4:]
    return _is_table(outputs) and bool((scores >= 0).all() and (scores <= 1).all())


def _decode_old_ultralytics(outputs: Outputs) -> Candidates:
    return Candidates.best(_in_pixels(outputs.table[:, :4], outputs), outputs.table[:, 4:])


def _is_table(outputs: Outputs) -> bool:
    return outputs.table.shape[1] > 4 and not len(outputs.prototypes) and outputs.is_relative


# RT-DETR and D-FINE by transformers, and RF-DETR: boxes as above, and class logits. RF-DETR has a
# column for what is nothing, and masks of its own for each query.


def _is_transformers(outputs: Outputs) -> bool:
    return _has_logits(outputs, "pred_boxes", "logits")


def _decode_transformers(outputs: Outputs) -> Candidates:
    xywh, logits = outputs.arrays["pred_boxes"][0], outputs.arrays["logits"][0]
    return Candidates.best(_in_pixels(xywh, outputs), _sigmoid(logits))


def _is_rf_detr(outputs: Outputs) -> bool:
    return _has_logits(outputs, "dets", "labels") and outputs.arrays["labels"].shape[2] > 1


def _decode_rf_detr(outputs: Outputs) -> Candidates:
    xywh, logits = outputs.arrays["dets"][0], outputs.arrays["labels"][0]
    is_coco = logits.shape[1] == COCO_COLUMNS[-1] + 1
    scores = _sigmoid(logits[:, COCO_COLUMNS] if is_coco else logits[:, :-1])
    own_mask = np.eye(len(scores), len(outputs.prototypes), dtype=np.float32)
    return Candidates.best(_in_pixels(xywh, outputs), scores, own_mask)


def _has_logits(outputs: Outputs, boxes: str, logits: str) -> bool:
    shapes = outputs.shapes(boxes, logits)
    if shapes is None or [len(shape) for shape in shapes] != [3, 3]:
        return False
    (one, queries, four), (*same, _) = shapes
    return (one, four) == (1, 4) and same == [1, queries]


def _in_pixels(xywh: FloatArray, outputs: Outputs) -> FloatArray:
    return corners(xywh) * np.array(outputs.input_size * 2, np.float32)


def _sigmoid(logits: FloatArray) -> FloatArray:
    return 0.5 * (1 + np.tanh(logits / 2))


LAYOUTS = (
    Layout(
        "RT-DETR by ultralytics",
        "(1, boxes, 6)",
        _is_ultralytics,
        _decode_ultralytics,
        place=stretched,
        is_final=True,
    ),
    Layout(
        "RT-DETR by older ultralytics",
        "(1, boxes, 4 + classes)",
        _is_old_ultralytics,
        _decode_old_ultralytics,
        place=stretched,
        is_final=True,
    ),
    Layout(
        "RT-DETR, D-FINE",
        "labels (1, boxes), boxes (1, boxes, 4), scores (1, boxes)",
        _is_rt_detr,
        _decode_rt_detr,
        place=stretched,
        is_final=True,
    ),
    Layout(
        "RT-DETR, D-FINE by transformers",
        "logits (1, boxes, classes), pred_boxes (1, boxes, 4)",
        _is_transformers,
        _decode_transformers,
        place=stretched,
        is_final=True,
    ),
    Layout(
        "RF-DETR",
        "dets (1, boxes, 4), labels (1, boxes, classes + 1)",
        _is_rf_detr,
        _decode_rf_detr,
        place=stretched,
        mean=IMAGENET_MEAN,
        std=IMAGENET_STD,
        is_final=True,
    ),
)
