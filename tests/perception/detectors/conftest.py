"""Small networks in the exact layouts of the exports, run by the real ONNX Runtime.

Each answers the same to every image. Its input has 64 x 64 pixels, so that there are
64 + 16 + 4 = 84 cells; its three classes are cup, bowl and chair. In an image of 64 x 64 pixels
all find a cup with score 0.9 at (16, 20)..(32, 40) and a chair with score 0.6 at (32, 8)..(64, 24).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from numpy.typing import ArrayLike
from onnx import TensorProto, helper, numpy_helper

CELLS = 84
NAMES = ("cup", "bowl", "chair")
METADATA = {"names": str(dict(enumerate(NAMES))), "task": "detect", "stride": "32"}

CUP, CHAIR = (24, 30, 16, 20), (48, 16, 32, 16)  # center and size

SaveModel = Callable[..., Path]


@pytest.fixture(scope="session")
def save_model(tmp_path_factory: pytest.TempPathFactory) -> SaveModel:
    """A function that writes a network; without nodes, its outputs are the constants."""

    def save(
        constants: Mapping[str, ArrayLike],
        metadata: Mapping[str, str] = METADATA,
        input_shape: tuple[Any, ...] = (1, 3, 64, 64),
        input_type: int = TensorProto.FLOAT,
        inputs: tuple[str, ...] = ("images",),
        size_input: str | None = None,
        nodes: Sequence[onnx.NodeProto] = (),
        outputs: Sequence[str] = (),
        words: Sequence[str] = (),
    ) -> Path:
        values = {name: np.asarray(value, np.float32) for name, value in constants.items()}
        if not nodes:
            nodes = [helper.make_node("Identity", [f"{name}.value"], [name]) for name in values]
        graph = helper.make_graph(
            nodes,
            "network",
            [helper.make_tensor_value_info(name, input_type, input_shape) for name in inputs]
            + [
                helper.make_tensor_value_info(name, TensorProto.INT64, ("N", 2))
                for name in [size_input]
                if name
            ],
            [
                helper.make_tensor_value_info(name, TensorProto.FLOAT, None)
                for name in outputs or values
            ]
            + [helper.make_tensor_value_info(name, TensorProto.STRING, None) for name in words],
            [numpy_helper.from_array(value, f"{name}.value") for name, value in values.items()],
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        helper.set_model_props(model, dict(metadata))
        path = tmp_path_factory.mktemp("model") / "network.onnx"
        onnx.save(model, path)
        return path

    return save


def yolov8_table() -> np.ndarray:
    table = np.zeros((1, 7, CELLS))
    table[0, :4, 10], table[0, 4, 10] = CUP, 0.9
    table[0, :4, 40], table[0, 6, 40] = CHAIR, 0.6
    return table


def yolov8_seg_tables() -> dict[str, np.ndarray]:
    """The cup's mask is the left part of the input, x < 24; the chair's is the other part."""
    table = np.zeros((1, 7 + 32, CELLS))
    table[:, :7] = yolov8_table()
    table[0, 7, 10], table[0, 7, 40] = 1, -1
    return {"output0": table, "output1": _halves()}


def yolox_table() -> np.ndarray:
    table = np.full((1, CELLS, 8), 0.01)
    # Stride 8: row 3, column 2. Stride 32, after 64 + 16 cells: row 0, column 1.
    table[0, 3 * 8 + 2] = (1, 0.75, np.log(2), np.log(2.5), 1, 0.9, 0, 0)
    table[0, 80 + 1] = (0.5, 0.5, 0, np.log(0.5), 0.8, 0, 0, 0.75)
    return table


def yolov5_table() -> np.ndarray:
    table = np.zeros((1, 3 * CELLS, 8))
    table[0, 100] = (*CUP, 1, 0.9, 0, 0)
    table[0, 200] = (*CHAIR, 0.8, 0, 0, 0.75)
    return table


def end_to_end_table() -> np.ndarray:
    table = np.zeros((1, 300, 6))
    table[0, 0] = (16, 20, 32, 40, 0.9, 0)
    table[0, 1] = (32, 8, 64, 24, 0.6, 2)
    table[0, 2] = (0, 0, 64, 64, 0.01, 1)
    return table


def end_to_end_seg_tables() -> dict[str, np.ndarray]:
    table = np.zeros((1, 300, 6 + 32))
    table[:, :, :6] = end_to_end_table()
    table[0, 0, 6], table[0, 1, 6] = 1, -1
    return {"output0": table, "output1": _halves()}


def decoded_yolox_table() -> np.ndarray:
    table = np.full((1, CELLS, 8), 0.01)
    rows, columns = (
        np.concatenate([np.indices((n, n))[i].ravel() for n in (8, 4, 2)]) for i in (0, 1)
    )
    strides = np.repeat([8, 16, 32], [64, 16, 4])
    table[0, :, 0], table[0, :, 1] = (columns + 0.5) * strides, (rows + 0.5) * strides
    table[0, 3 * 8 + 2] = (*CUP, 1, 0.9, 0, 0)
    table[0, 80 + 1] = (*CHAIR, 0.8, 0, 0, 0.75)
    return table


def yolov6_table() -> np.ndarray:
    table = decoded_yolox_table()
    table[0, :, 4] = 1
    table[0, 80 + 1, 5:] = 0, 0, 0.6
    return table


def old_rt_detr_table() -> np.ndarray:
    table = np.full((1, 300, 7), 0.01)
    table[0, 0, :5] = (*np.divide(CUP, 64), 0.9)
    table[0, 1, :4], table[0, 1, 6] = np.divide(CHAIR, 64), 0.6
    return table


def rt_detr_table() -> np.ndarray:
    table = np.full((1, 300, 6), 0.01)
    table[0, :, 5] = 1
    table[0, 0] = (*np.divide(CUP, 64), 0.9, 0)
    table[0, 1] = (*np.divide(CHAIR, 64), 0.6, 2)
    return table


def rt_detr_arrays() -> dict[str, np.ndarray]:
    rows = end_to_end_table()[..., [5, 0, 1, 2, 3, 4]]
    return {"labels": rows[..., 0], "boxes": rows[..., 1:5], "scores": rows[..., 5]}


def transformers_arrays() -> dict[str, np.ndarray]:
    rows = old_rt_detr_table()
    return {"logits": np.log(rows[..., 4:] / (1 - rows[..., 4:])), "pred_boxes": rows[..., :4]}


def rf_detr_arrays(nothing: float = 9) -> dict[str, np.ndarray]:
    """The last column says how sure the network is that there is nothing."""
    arrays = transformers_arrays()
    last = np.full((1, 300, 1), nothing)
    return {"dets": arrays["pred_boxes"], "labels": np.concatenate([arrays["logits"], last], 2)}


def rf_detr_seg_arrays() -> dict[str, np.ndarray]:
    masks = np.full((1, 300, 16, 16), -1.0)
    masks[0, :2] = np.where(np.arange(16) < 6, 1, -1) * np.array([1, -1]).reshape(2, 1, 1)
    return rf_detr_arrays() | {"masks": masks}


def final_yolov7_rows() -> np.ndarray:
    return np.array([[0, 16, 20, 32, 40, 0, 0.9], [0, 32, 8, 64, 24, 2, 0.6]])


def _halves() -> np.ndarray:
    prototypes = np.zeros((1, 32, 16, 16))
    prototypes[0, 0] = np.where(np.arange(16) < 6, 1, -1)
    return prototypes


NETWORKS = {
    "YOLOv8, YOLO11": {"output0": yolov8_table()},
    "YOLOv8, YOLO11 with masks": yolov8_seg_tables(),
    "YOLOv5, YOLOv7": {"output0": yolov5_table()},
    "YOLOv6": {"outputs": yolov6_table()},
    "YOLOX": {"output": yolox_table()},
    "YOLOX, decoded": {"output": decoded_yolox_table()},
    "YOLOv10, YOLO26": {"output0": end_to_end_table()},
    "YOLOv10, YOLO26 with masks": end_to_end_seg_tables(),
    "YOLOv7 with suppression": {"output": final_yolov7_rows()},
    "RT-DETR by ultralytics": {"output0": rt_detr_table()},
    "RT-DETR by older ultralytics": {"output0": old_rt_detr_table()},
    "RT-DETR, D-FINE": rt_detr_arrays(),
    "RT-DETR, D-FINE by transformers": transformers_arrays(),
    "RF-DETR": rf_detr_arrays(),
    "RF-DETR with masks": rf_detr_seg_arrays(),
}


@pytest.fixture(params=NETWORKS)
def network(request: pytest.FixtureRequest, save_model: SaveModel) -> tuple[str, Path]:
    """The name of a layout, and a network that has it."""
    return request.param, save_model(NETWORKS[request.param])


@pytest.fixture(scope="session")
def networks() -> dict[str, dict[str, np.ndarray]]:
    """The outputs of each network."""
    return NETWORKS
