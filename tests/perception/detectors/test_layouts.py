"""Each layout, from a network with known outputs (see conftest.py) to boxes in the image."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from onnx import helper

from hypermap.perception.detectors.layout import Outputs
from hypermap.perception.detectors.layouts import LAYOUTS, recognize
from hypermap.perception.detectors.onnx_detector import OnnxDetector

SaveModel = Callable[..., Path]
Networks = dict[str, dict[str, np.ndarray]]

SQUARE = np.zeros((64, 64, 3), np.uint8)
WIDE = np.zeros((96, 128, 3), np.uint8)

IN_THE_MIDDLE = [(32, 24, 64, 64), (64, 0, 128, 32)]  # half the size, below 8 rows of gray
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
    expected = IN_THE_MIDDLE
    if name.startswith("YOLOX"):
        expected = IN_THE_CORNER
    elif "DETR" in name:
        expected = STRETCHED
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


def test_rf_detr_makes_a_mask_for_each_box(save_model: SaveModel, networks: Networks) -> None:
    found = OnnxDetector.load(save_model(networks["RF-DETR with masks"])).detect(WIDE)
    # The mask of the cup ends at x = 24 of the input, which is 48 in the image.
    cup, chair = np.zeros((2, 96, 128), bool)
    cup[30:60, 32:48] = True
    chair[12:36, 64:128] = True
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
        ("YOLOX", (255, 0, 0), "chair"),
        ("YOLOX", (0, 255, 0), "bowl"),
        ("YOLOX", (0, 0, 255), "cup"),
    ],
)
def test_colors_reach_the_network_as_it_was_trained(
    layout: str, image: tuple[int, int, int], name: str, save_model: SaveModel
) -> None:
    """Here the score of cup, bowl, chair is the mean of the first, second, third channel."""
    is_yolox = layout.startswith("YOLOX")
    box = (0.5, 0.5, 0, 0, 1) if is_yolox else (32, 32, 16, 16)
    boxes = np.tile(box, (1, 84, 1))
    boxes[0, -1] = 0
    constants = {
        "boxes": boxes,
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
        ((84, 2000), (640, 640), "YOLOv8, YOLO11"),  # tiny: strides 16 and 32
        ((84, 8400), (640, 640), "YOLOv8, YOLO11"),
        ((5, 8400), (640, 640), "YOLOv8, YOLO11"),
        ((84, 6300), (640, 480), "YOLOv8, YOLO11"),
        ((84, 34000), (640, 640), "YOLOv8, YOLO11"),  # p2: strides 4 to 32
        ((84, 34000), (1280, 1280), "YOLOv8, YOLO11"),  # p6: strides 8 to 64
        ((8400, 85), (640, 640), "YOLOX"),
        ((3549, 85), (416, 416), "YOLOX"),
        ((25200, 85), (640, 640), "YOLOv5, YOLOv7"),
        ((25200, 6), (640, 640), "YOLOv5, YOLOv7"),
        ((102000, 85), (1280, 1280), "YOLOv5, YOLOv7"),  # p6
        ((300, 6), (640, 640), "YOLOv10, YOLO26"),
        ((100, 6), (640, 640), "YOLOv10, YOLO26"),
        ((300, 84), (640, 640), "RT-DETR by older ultralytics"),
    ],
)
def test_the_shapes_of_the_exports_are_distinguished(
    shape: tuple[int, int], size: tuple[int, int], layout: str
) -> None:
    table = np.zeros(shape, np.float32)
    if "RT-DETR" in layout:
        table += 0.5
    assert recognize(Outputs.of({"output": table[np.newaxis]}, size)).name == layout


def name_of(table: np.ndarray) -> str:
    return recognize(Outputs.of({"output0": table}, (64, 64))).name


def test_six_columns_are_distinguished_by_their_values() -> None:
    table = np.full((1, 300, 6), 0.25, np.float32)
    assert name_of(table) == "RT-DETR by older ultralytics"  # two classes
    table[0, :, 5] = 79
    assert name_of(table) == "RT-DETR by ultralytics"
    table[0, 0, :4] = (10, 20, 30, 40)
    assert name_of(table) == "YOLOv10, YOLO26"
    assert name_of(np.zeros_like(table)) == "YOLOv10, YOLO26"  # nothing found


def test_what_shares_its_shape_with_yolox_is_distinguished_by_its_values(
    networks: Networks,
) -> None:
    yolox, decoded = (networks[name]["output"] for name in ("YOLOX", "YOLOX, decoded"))
    assert (name_of(yolox), name_of(decoded)) == ("YOLOX", "YOLOX, decoded")
    rng = np.random.default_rng(0)
    for _ in range(20):
        offsets = np.zeros_like(yolox)
        offsets[..., :2] = rng.normal(0.5, 2, (1, 84, 2))
        assert name_of(yolox + offsets) == "YOLOX"
        assert name_of(decoded + 8 * offsets) == "YOLOX, decoded"
    decoded = decoded.copy()
    decoded[..., 4] = 1
    assert name_of(decoded) == "YOLOv6"


def test_rf_detr_numbers_its_classes_as_coco_does(save_model: SaveModel) -> None:
    logits = np.full((1, 4, 91), -9.0)
    columns = {1: "person", 44: "bottle", 62: "chair", 90: "toothbrush"}
    for query, column in enumerate(columns):
        logits[0, query, column] = 4 - query
    logits[..., 12] = 9  # a number that COCO never used
    boxes = np.tile([0.5, 0.5, 0.25, 0.25], (1, 4, 1))
    found = OnnxDetector.load(save_model({"dets": boxes, "labels": logits}, {})).detect(SQUARE)
    assert list(found.names) == list(columns.values())
    assert found.scores == pytest.approx([1 / (1 + np.exp(-z)) for z in (4, 3, 2, 1)])


def test_networks_get_the_values_that_they_were_trained_with() -> None:
    black_and_white = np.array([[[0] * 3, [255] * 3]], np.float32)
    expected = {"YOLOX": [[0] * 3, [255] * 3], "YOLOX, decoded": [[0] * 3, [255] * 3]}
    expected["RF-DETR"] = [[-2.1179, -2.0357, -1.8044], [2.2489, 2.4286, 2.64]]
    for layout in LAYOUTS:
        scaled = layout.scale(black_and_white)
        wanted = expected.get(layout.name, [[0] * 3, [1] * 3])
        assert scaled.dtype == np.float32
        np.testing.assert_allclose(scaled[0], wanted, atol=1e-4)


def test_arrays_of_inner_layers_are_left_aside() -> None:
    table, inner = np.zeros((1, 252, 8), np.float32), np.zeros((1, 3, 8, 8, 8), np.float32)
    assert Outputs.of({"table": table, "inner": inner}, (64, 64)).table.shape == (252, 8)


def test_every_layout_has_a_name_of_its_own() -> None:
    assert len({layout.name for layout in LAYOUTS}) == len(LAYOUTS)
