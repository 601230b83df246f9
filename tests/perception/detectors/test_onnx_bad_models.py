"""Files that are no model, and models that cannot be used."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import TensorProto, helper
from PIL import Image

from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.detectors.onnx_detector import OnnxDetector

from .conftest import SaveModel

KNOWN = (
    "known are: YOLOv8, YOLO11: (1, 4 + classes, cells); "
    "YOLOv5, YOLOv7: (1, 3 cells, 5 + classes); YOLOv6: (1, cells, 5 + classes); "
    "YOLOX: (1, cells, 5 + classes); YOLOX, decoded: (1, cells, 5 + classes); "
    "YOLOv10, YOLO26: (1, boxes, 6); YOLOv7 with suppression: (boxes, 7); "
    "RT-DETR by ultralytics: (1, boxes, 6); "
    "RT-DETR by older ultralytics: (1, boxes, 4 + classes); "
    "RT-DETR, D-FINE: labels (1, boxes), boxes (1, boxes, 4), scores (1, boxes); "
    "RT-DETR, D-FINE by transformers: "
    "logits (1, boxes, classes), pred_boxes (1, boxes, 4); "
    "RF-DETR: dets (1, boxes, 4), labels (1, boxes, classes + 1); "
    "YOLO also with masks: (1, 32, h, w)"
)
FAILING = [
    helper.make_node("Constant", [], ["size"], value_ints=[7, 7]),
    helper.make_node("Reshape", ["images", "size"], ["output0"]),
]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (
            {"constants": {"logits": np.zeros((1, 1000))}},
            f"the outputs of the model have no known layout: logits (1, 1000); {KNOWN}",
        ),
        (
            {"constants": {"boxes": np.zeros((1, 9, 4)), "logits": np.zeros((1, 9, 80))}},
            "the outputs of the model have no known layout: "
            f"boxes (1, 9, 4), logits (1, 9, 80); {KNOWN}",
        ),
        (
            {"constants": {"labels": np.zeros((1, 9)), "boxes": np.zeros((1, 8, 4))}}
            | {"outputs": ["labels", "boxes"]},
            "the outputs of the model have no known layout: labels (1, 9), boxes (1, 8, 4); "
            f"{KNOWN}",
        ),
        (
            {"constants": {f"scale{n}": np.zeros((1, 3, n, n, 8)) for n in (8, 4, 2)}},
            "the outputs of the model have no known layout: scale8 (1, 3, 8, 8, 8), "
            f"scale4 (1, 3, 4, 4, 8), scale2 (1, 3, 2, 2, 8); {KNOWN}",
        ),
        (
            {"constants": {"table": np.ones((1, 100, 17)) * 9}},
            f"the outputs of the model have no known layout: table (1, 100, 17); {KNOWN}",
        ),
        (
            {"constants": {"table": np.zeros((1, 0, 0))}},
            f"the outputs of the model have no known layout: table (1, 0, 0); {KNOWN}",
        ),
        (
            {"constants": {"output0": np.ones((1, 7, 84)) * 9}},
            "the outputs of the model look like those of YOLOv8, YOLO11, but it gives scores "
            "from 9 to 9; expected 0 to 1",
        ),
        (
            {"constants": {"output0": np.full((1, 7, 84), np.nan)}},
            "the model returned NaN or infinity",
        ),
        (
            {"constants": {"output0": np.zeros((1, 56, 84))}, "metadata": {"task": "pose"}},
            "the model is made to pose; expected one of: detect, segment",
        ),
        (
            {"constants": {"a": [0]}, "input_shape": (4, 3, 64, 64)},
            "the model takes images tensor(float) [4, 3, 64, 64]; expected one image, float, "
            "(1, 3, rows, columns)",
        ),
        (
            {"constants": {"a": [0]}, "input_shape": (1, 64, 64, 3)},
            "the model takes images tensor(float) [1, 64, 64, 3]; expected one image, float, "
            "(1, 3, rows, columns)",
        ),
        (
            {"constants": {"a": [0]}, "input_type": TensorProto.UINT8},
            "the model takes images tensor(uint8) [1, 3, 64, 64]; expected one image, float, "
            "(1, 3, rows, columns)",
        ),
        (
            {"constants": {"a": [0]}, "inputs": ()},
            "the model takes nothing; expected one image, float, (1, 3, rows, columns)",
        ),
        (
            {"constants": {"a": [0]}, "inputs": ("images", "size")},
            "the model takes images tensor(float) [1, 3, 64, 64], size tensor(float) "
            "[1, 3, 64, 64]; expected one image, float, (1, 3, rows, columns)",
        ),
        (
            {"constants": {"a": [0]}, "size_input": "scale_factor"},
            "the model takes images tensor(float) [1, 3, 64, 64], scale_factor tensor(int64) "
            "['N', 2]; expected one image, float, (1, 3, rows, columns)",
        ),
        (
            {"constants": {"a": [0]}, "input_shape": (1, 3, 64, 100_000)},
            "the model takes images of 100000 x 64 pixels; expected 1 to 8192 a side",
        ),
        (
            {
                "constants": {"a": [0]},
                "input_shape": (1, 3, "h", "w"),
                "metadata": {"imgsz": "[640, 'wide']"},
            },
            "metadata imgsz: expected [rows, columns], got \"[640, 'wide']\"",
        ),
        (
            {
                "constants": {"a": [0]},
                "input_shape": (1, 3, "h", "w"),
                "metadata": {"imgsz": "[1e400, 640]"},
            },
            "metadata imgsz: expected [rows, columns], got '[1e400, 640]'",
        ),
        (
            {"constants": {}, "nodes": FAILING, "outputs": ["output0"], "metadata": {}}
            | {"input_shape": (1, 3, "h", "w")},
            "the model fails on an image of 640 x 640 pixels: ",
        ),
    ],
)
def test_a_model_that_cannot_be_used_says_why(
    arguments: dict[str, Any], expected: str, save_model: SaveModel
) -> None:
    path = save_model(**arguments)
    with pytest.raises(FormatError) as error:
        OnnxDetector.load(path)
    assert str(error.value).startswith(f"{path}: {expected}")
    assert "\n" not in str(error.value)


def test_a_file_of_another_kind_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "picture.onnx"
    Image.new("RGB", (8, 8)).save(path, "png")
    with pytest.raises(FormatError, match="not a complete ONNX model"):
        OnnxDetector.load(path)


def test_of_a_checkpoint_it_is_said_how_to_export_it(tmp_path: Path) -> None:
    path = tmp_path / "best.pt"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(FormatError, match=r"\.pt file, not ONNX; .*model=best\.pt format=onnx"):
        OnnxDetector.load(path)


def test_a_missing_file_and_a_folder_are_distinguished(tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match=r"no\.onnx: there is no such model$"):
        OnnxDetector.load(tmp_path / "no.onnx")
    with pytest.raises(FormatError, match=r"a folder; expected an ONNX file$"):
        OnnxDetector.load(tmp_path)


@pytest.mark.parametrize("size", [0, 100, 1_000_000])
def test_a_truncated_model_is_one_clear_error(size: int, shared_data: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.onnx"
    path.write_bytes((shared_data / "models" / "yolox_nano.onnx").read_bytes()[:size])
    expected = f"^{re.escape(str(path))}: not a complete ONNX model that can be run here: "
    with pytest.raises(FormatError, match=expected):
        OnnxDetector.load(path)
