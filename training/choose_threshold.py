"""Prints precision and recall at every score, on images of random worlds that are kept for this.

The last line is the average precision at an IoU of 0.5, over all classes together.

python training/render_images.py kept --first 5000000 --worlds 60
python training/choose_threshold.py kept src/hypermap/simulation/detector.onnx
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from hypermap.perception.detectors import load_detector
from hypermap.simulation.network import CLASSES

IOU = 0.5


def matches(found_boxes: np.ndarray, true_boxes: np.ndarray) -> np.ndarray:
    """Return whether each box, best first, is the first to fit an object, shape (N,)."""
    is_free = np.ones(len(true_boxes), bool)
    hits = np.zeros(len(found_boxes), bool)
    for i, box in enumerate(found_boxes):
        low, high = np.maximum(box[:2], true_boxes[:, :2]), np.minimum(box[2:], true_boxes[:, 2:])
        shared = np.clip(high - low, 0, None).prod(axis=1)
        areas = (true_boxes[:, 2:] - true_boxes[:, :2]).prod(axis=1) + (box[2:] - box[:2]).prod()
        iou = np.where(is_free, shared / (areas - shared), 0)
        if len(iou) and iou.max() >= IOU:
            is_free[iou.argmax()] = False
            hits[i] = True
    return hits


def average_precision(scores: np.ndarray, hits: np.ndarray, true: int) -> float:
    """Return the area below the curve of the best precision at each recall."""
    found = np.cumsum(hits[np.argsort(-scores, kind="stable")])
    precision = found / np.arange(1, len(found) + 1)
    best = np.maximum.accumulate(precision[::-1])[::-1]
    return float((best * np.diff(found, prepend=0)).sum() / true)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("images", type=Path, help="what render_images.py saved")
    parser.add_argument("model", type=Path)
    arguments = parser.parse_args()
    detector = load_detector(arguments.model, score_threshold=0.02)
    scores, hits, true = [], [], 0
    for file in sorted(arguments.images.glob("*.npz")):
        with np.load(file) as data:
            images, boxes, image_ids = data["images"], data["boxes"], data["image_ids"]
            names = np.array(CLASSES)[data["classes"]]
        true += len(boxes)
        for i, image in enumerate(images):
            found = detector.detect(image)
            for name in set(found.names):
                mine, theirs = found.names == name, (image_ids == i) & (names == name)
                hits.append(matches(found.xyxy[mine], boxes[theirs]))
                scores.append(found.scores[mine])
    all_scores, all_hits = np.concatenate(scores), np.concatenate(hits)
    print(f"{true} objects\nscore  precision  recall    F1")
    for threshold in np.arange(0.05, 0.65, 0.05):
        chosen = all_hits[all_scores >= threshold]
        precision, recall = chosen.mean() if len(chosen) else 1.0, chosen.sum() / true
        f1 = 2 * chosen.sum() / (len(chosen) + true)
        print(f"{threshold:5.2f}{precision:11.2f}{recall:8.2f}{f1:6.2f}")
    print(f"AP {average_precision(all_scores, all_hits, true):.3f}")


if __name__ == "__main__":
    main()
