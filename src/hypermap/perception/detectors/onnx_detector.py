"""A detector: a network in an ONNX file."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.instance_masks import mix_masks
from hypermap.perception.detectors.labels import COCO, parse_names, read_labels
from hypermap.perception.detectors.layout import Candidates, Layout, Outputs
from hypermap.perception.detectors.layouts import LAYOUTS, recognize
from hypermap.perception.detectors.nms import suppress
from hypermap.perception.detectors.onnx_model import OnnxModel
from hypermap.perception.detectors.placement import BORDER
from hypermap.text import counted

logger = logging.getLogger(__name__)

TASKS = ("detect", "segment")  # the terms of ultralytics


@dataclass(frozen=True)
class OnnxDetector:
    """Finds objects with a network whose outputs have a known layout.

    Attributes:
        model: the network.
        layout: what its outputs mean.
        names: of its classes.
        score_threshold: detections with a lower score are dropped.
        iou_threshold: of two boxes of a class that overlap more, the better one is kept.
    """

    model: OnnxModel
    layout: Layout
    names: tuple[str, ...]
    score_threshold: float = 0.3
    iou_threshold: float = 0.45

    def __post_init__(self) -> None:
        for name in ("score_threshold", "iou_threshold"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} must be in 0..1, got {getattr(self, name)}")

    @classmethod
    def load(
        cls,
        path: str | Path,
        labels: str | Path | None = None,
        score_threshold: float = 0.3,
        iou_threshold: float = 0.45,
        threads: int | None = None,
    ) -> OnnxDetector:
        """Return the detector in a file; see `load_detector`.

        It runs the network once, on a gray image, to recognize the layout, since the shapes in
        the file may be open.
        """
        model = OnnxModel.load(path, threads)
        task = model.metadata.get("task", "detect")
        if task not in TASKS:
            raise FormatError(
                f"the model is made to {task}; expected one of: {', '.join(TASKS)}", path=path
            )
        layout, candidates = _recognise(model)
        names = _class_names(model, labels, candidates.class_count)
        logger.info("%s: %s with %d classes", model.path, layout.name, len(names))
        return cls(model, layout, names, score_threshold, iou_threshold)

    def detect(self, color: NDArray[np.uint8]) -> Detections:
        """Return the objects in an RGB image, uint8, shape (H, W, 3), by descending score.

        Boxes end at the edges of the image; there are masks if the network makes them.

        Raises:
            FormatError: If the outputs of the network make no sense.
        """
        if color.ndim != 3 or color.shape[2] != 3 or color.dtype != np.uint8 or not color.size:
            raise ValueError(f"expected uint8 (H, W, 3), got {color.dtype} {color.shape}")
        placement = self.layout.place((color.shape[1], color.shape[0]), self.model.input_size)
        image = placement.fill(color[..., ::-1] if self.layout.is_bgr else color)
        arrays = self.model.run(self.layout.scale(image))
        outputs = Outputs.of(arrays, self.model.input_size)
        found = self._select(_decode(self.model, self.layout, outputs))

        boxes = placement.to_image(found.xyxy)
        in_image = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
        found, boxes = found[in_image], boxes[in_image]
        masks = None
        if found.mixture.shape[1]:
            masks = mix_masks(found.mixture, outputs.prototypes, boxes, placement)
        return Detections.of(boxes, [self._name(i) for i in found.class_ids], found.scores, masks)

    def _select(self, candidates: Candidates) -> Candidates:
        """Return those with enough score, one for each object, by descending score."""
        certain = candidates[candidates.scores >= self.score_threshold]
        if self.layout.is_final:
            return certain[np.argsort(-certain.scores, kind="stable")]
        return certain[
            suppress(certain.xyxy, certain.scores, certain.class_ids, self.iou_threshold)
        ]

    def _name(self, class_id: int) -> str:
        if not 0 <= class_id < len(self.names):
            raise FormatError(
                f"the model found an object of class {class_id}, but there are names for "
                f"{counted(len(self.names), 'class', 'classes')}; give all of them with "
                "--labels FILE",
                path=self.model.path,
            )
        return self.names[class_id]


def _recognise(model: OnnxModel) -> tuple[Layout, Candidates]:
    """Return the network's layout, and its outputs for a gray image."""
    width, height = model.input_size
    arrays = model.run(np.full((height, width, 3), BORDER / 255, np.float32))
    outputs = Outputs.of(arrays, model.input_size)
    try:
        layout = recognize(outputs)
    except ValueError as error:
        found = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        known = "; ".join(f"{layout.name}: {layout.shape}" for layout in LAYOUTS)
        raise FormatError(
            f"the outputs of the model have no known layout: {found}; known are: {known}; "
            "YOLO also with masks: (1, 32, h, w)",
            path=model.path,
        ) from error
    return layout, _decode(model, layout, outputs)


def _decode(model: OnnxModel, layout: Layout, outputs: Outputs) -> Candidates:
    candidates = layout.decode(outputs)
    if ((candidates.scores < 0) | (candidates.scores > 1)).any():
        raise FormatError(
            f"the outputs of the model look like those of {layout.name}, but it gives scores from "
            f"{candidates.scores.min():.3g} to {candidates.scores.max():.3g}; expected 0 to 1",
            path=model.path,
        )
    return candidates


def _class_names(
    model: OnnxModel, labels: str | Path | None, class_count: int | None
) -> tuple[str, ...]:
    """Return the names in the label file, else in the model, else COCO's if they fit."""
    source: str | Path = model.path
    if labels is not None:
        names, source = read_labels(labels), labels
    elif "names" in model.metadata:
        try:
            names = parse_names(model.metadata["names"])
        except ValueError as error:
            raise FormatError(str(error), path=model.path, key="metadata names") from error
    elif class_count == len(COCO):
        names = COCO
    else:
        classes = "classes" if class_count is None else counted(class_count, "class", "classes")
        raise FormatError(
            f"the model does not name its {classes}; give their names with --labels FILE, "
            "or --labels coco",
            path=model.path,
        )
    if class_count not in (None, len(names)):
        raise FormatError(
            f"{counted(len(names), 'name')}, but the model has "
            f"{counted(class_count, 'class', 'classes')}",
            path=source,
        )
    return names
