"""Each layout, from a network with known outputs (see conftest.py) to boxes in the image."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from onnx import helper

from hypermap.perception.detectors.layouts import LAYOUTS, Outputs, recognise
from hypermap.perception.detectors.onnx_detector import OnnxDetector

SaveModel = Callable[..., Path]
Networks = dict[str, dict[str, np.ndarray]]

SQUARE = np.zeros((64, 64, 3), np.uint8)
WIDE = np.zeros((96, 128, 3), np.uint8)

IN_THE_MIDDLE = [(32, 24, 64, 64), (64, 0, 128, 32)]  # half the size, below 8 rows of grey
IN_THE_CORNER = [(32, 40, 64, 80), (64, 16, 128, 48)]
STRETCHED = [(32, 30, 64, 60), (64, 12, 128, 36)]


def test_a_network_is_recognised_and_finds_what_it_should(network: tuple[str, Path]) -> None:
    name, path = network
    detector = OnnxDetector.load(path)
    assert detector.layout.name == name.removesuffix(" with masks")
    found = detector.detect(SQUARE)
    assert list(found.names) == ["cup", "chair"]
    np.testing.assert_allclose(found.xyxy, [(16, 20, 32, 40), (32, 8, 64, 24)], atol=1e-4)
    np.testing.assert_allclose(found.scores, [0.9, 0.6], atol=1e-6)
    assert (found.masks is not None) == name.endswith("with masks")


def test_boxes_come_back_to_the_pixels_of_a_wide_image(network: tuple[str, Path]) -> None:
    name, path = network
    expected = {"YOLOX, not decoded": IN_THE_CORNER, "RT-DETR": STRETCHED}.get(name, IN_THE_MIDDLE)
    found = OnnxDetector.load(path).detect(WIDE)
    np.testing.assert_allclose(found.xyxy, expected, atol=1e-4)


@pytest.mark.parametrize("name", ["YOLOv8, YOLO11 with masks", "YOLOv10, YOLO26 with masks"])
def test_masks_are_cut_out_of_the_image(
    name: str, save_model: SaveModel, networks: Networks
) -> None:
    found = OnnxDetector.load(save_model(networks[name])).detect(WIDE)
    # The prototypes change sign at x = 24 of the input, which is 48 in the image.
    cup, chair = np.zeros((2, 96, 128), bool)
    cup[24:64, 32:48] = True
    chair[0:32, 64:128] = True
    assert found.masks is not None
    np.testing.assert_array_equal(found.masks, [cup, chair])


def test_yolov5_has_masks_too(save_model: SaveModel, networks: Networks) -> None:
    table = np.zeros((1, 252, 8 + 32))
    table[..., :8] = networks["YOLOv5, YOLOv7"]["output0"]
    table[..., 8] = 1
    prototypes = networks["YOLOv8, YOLO11 with masks"]["output1"]
    detector = OnnxDetector.load(save_model({"output0": table, "output1": prototypes}))
    found = detector.detect(SQUARE)
    assert detector.layout.name == "YOLOv5, YOLOv7"
    assert found.masks is not None
    assert found.masks.sum(axis=(1, 2)).tolist() == [8 * 20, 0]


@pytest.mark.parametrize(
    ("layout", "image", "name"),
    [
        ("YOLOv8, YOLO11", (255, 0, 0), "cup"),
        ("YOLOv8, YOLO11", (0, 255, 0), "bowl"),
        ("YOLOv8, YOLO11", (0, 0, 255), "chair"),
        ("YOLOX, not decoded", (255, 0, 0), "chair"),
        ("YOLOX, not decoded", (0, 255, 0), "bowl"),
        ("YOLOX, not decoded", (0, 0, 255), "cup"),
    ],
)
def test_colors_reach_the_network_as_it_was_trained(
    layout: str, image: tuple[int, int, int], name: str, save_model: SaveModel
) -> None:
    """Here the score of cup, bowl, chair is the mean of the first, second, third channel."""
    is_yolox = layout.startswith("YOLOX")
    box = (0.5, 0.5, 0, 0, 1) if is_yolox else (32, 32, 16, 16)
    constants = {
        "boxes": np.tile(box, (1, 84, 1)),
        "scores": np.zeros((1, 83, 3)),
        "white": 255 if is_yolox else 1,
    }
    make = helper.make_node
    nodes = [
        make("ReduceMean", ["images"], ["means"], axes=[2, 3], keepdims=0),
        make("Div", ["means", "white.value"], ["score"]),
        make("Constant", [], ["a_row"], value_ints=[1, 1, 3]),
        make("Reshape", ["score", "a_row"], ["first_scores"]),
        make("Concat", ["first_scores", "scores.value"], ["all_scores"], axis=1),
        make("Concat", ["boxes.value", "all_scores"], ["rows"], axis=2),
        make("Transpose", ["rows"], ["table"], perm=[0, 1, 2] if is_yolox else [0, 2, 1]),
    ]
    detector = OnnxDetector.load(save_model(constants, nodes=nodes, outputs=["table"]))
    assert detector.layout.name == layout
    found = detector.detect(np.full((64, 64, 3), image, np.uint8))
    assert list(found.names) == [name]
    assert found.scores == pytest.approx([1.0])


@pytest.mark.parametrize(
    ("shape", "size", "layout"),
    [
        ((84, 8400), (640, 640), "YOLOv8, YOLO11"),
        ((5, 8400), (640, 640), "YOLOv8, YOLO11"),
        ((84, 6300), (640, 480), "YOLOv8, YOLO11"),
        ((84, 34000), (640, 640), "YOLOv8, YOLO11"),  # p2: strides 4 to 32
        ((84, 34000), (1280, 1280), "YOLOv8, YOLO11"),  # p6: strides 8 to 64
        ((8400, 85), (640, 640), "YOLOX, not decoded"),
        ((3549, 85), (416, 416), "YOLOX, not decoded"),
        ((25200, 85), (640, 640), "YOLOv5, YOLOv7"),
        ((25200, 6), (640, 640), "YOLOv5, YOLOv7"),
        ((102000, 85), (1280, 1280), "YOLOv5, YOLOv7"),  # p6
        ((300, 6), (640, 640), "YOLOv10, YOLO26"),
        ((100, 6), (640, 640), "YOLOv10, YOLO26"),
        ((300, 84), (640, 640), "RT-DETR"),
    ],
)
def test_the_shapes_of_the_exports_are_told_apart(
    shape: tuple[int, int], size: tuple[int, int], layout: str
) -> None:
    table = np.zeros(shape, np.float32)
    if layout == "RT-DETR":
        table += 0.5
    assert recognise(Outputs.of([table[np.newaxis]], size)).name == layout


def test_rt_detr_with_two_classes_is_told_from_boxes_in_pixels() -> None:
    table = np.full((1, 300, 6), 0.25, np.float32)
    assert recognise(Outputs.of([table], (640, 640))).name == "RT-DETR"
    table[0, 0, :4] = (10, 20, 30, 40)
    assert recognise(Outputs.of([table], (640, 640))).name == "YOLOv10, YOLO26"


def test_yolox_that_was_exported_with_its_decoding_is_not_taken_for_one_without() -> None:
    table = np.full((1, 84, 8), 0.5, np.float32)
    assert recognise(Outputs.of([table], (64, 64))).name == "YOLOX, not decoded"
    table[0, :, :4] = 32
    with pytest.raises(ValueError, match="no known layout fits"):
        recognise(Outputs.of([table], (64, 64)))


def test_arrays_of_inner_layers_are_left_aside() -> None:
    table, inner = np.zeros((1, 252, 8), np.float32), np.zeros((1, 3, 8, 8, 8), np.float32)
    assert Outputs.of([table, inner], (64, 64)).table.shape == (252, 8)


def test_every_layout_has_a_name_of_its_own() -> None:
    assert len({layout.name for layout in LAYOUTS}) == len(LAYOUTS)
