from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import TensorProto, helper
from PIL import Image
from shapely import box

from hypermap.core.errors import FormatError
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.onnx_detector import OnnxDetector

from .conftest import SaveModel

pytestmark = pytest.mark.xdist_group("onnx")  # they share what takes long to make

Networks = dict[str, dict[str, np.ndarray]]

SQUARE = np.zeros((64, 64, 3), np.uint8)


# Against another implementation


@pytest.fixture(scope="module")
def yolox(shared_data: Path) -> OnnxDetector:
    return OnnxDetector.load(shared_data / "models" / "yolox_nano.onnx")


def is_found(wanted: dict[str, Any], found: list[dict[str, Any]]) -> bool:
    """Whether there is an object of that name with an IoU of at least 0.9."""
    shape = box(*wanted["box"])
    return any(
        other["name"] == wanted["name"]
        and shape.intersection(box(*other["box"])).area
        >= 0.9 * shape.union(box(*other["box"])).area
        for other in found
    )


def test_yolox_finds_on_a_real_desk_what_another_implementation_found(
    yolox: OnnxDetector, shared_data: Path
) -> None:
    """Measured on all images: 295 of the 295 boxes with score >= 0.4, 388 of all 392."""
    desk = shared_data / "desk"
    frames = json.loads((desk / "detections.json").read_text())["frames"]
    certain = everything = certain_found = everything_found = count = 0
    for stamp, wanted in list(frames.items())[::2]:
        image = np.asarray(Image.open(desk / "rgb" / f"{stamp}.png").convert("RGB"))
        detections = yolox.detect(image)
        count += len(detections)
        found = [
            {"name": name, "box": xyxy}
            for name, xyxy in zip(detections.names, detections.xyxy, strict=True)
        ]
        for each in wanted:
            everything += 1
            everything_found += is_found(each, found)
            if each["score"] >= 0.4:
                certain += 1
                certain_found += is_found(each, found)
    assert certain > 100
    assert certain_found >= 0.99 * certain
    assert everything_found >= 0.97 * everything
    assert abs(count - everything) <= 0.03 * everything


def test_yolox_without_names_takes_those_of_coco(yolox: OnnxDetector) -> None:
    assert yolox.layout.name == "YOLOX"
    assert yolox.model.input_size == (416, 416)
    assert (yolox.names[0], yolox.names[62], yolox.names[79]) == ("person", "tv", "toothbrush")


# What is kept of the candidates


def table_of(*columns: tuple[float, ...]) -> dict[str, np.ndarray]:
    """A YOLOv8 table; each column is center x, y, width, height, and three class scores."""
    table = np.zeros((1, 7, 84))
    for i, column in enumerate(columns):
        table[0, :, i] = column
    return {"output0": table}


OVERLAPPING = table_of(
    (20, 20, 10, 10, 0.5, 0, 0),
    (20, 21, 10, 10, 0.7, 0, 0),  # IoU with the first: 90 / 110
    (20, 20, 10, 10, 0, 0.6, 0),
    (20, 26, 10, 10, 0.4, 0, 0),  # IoU with the second: 50 / 150
    (50, 50, 10, 10, 0.2, 0, 0),
)


@pytest.mark.parametrize(
    ("score_threshold", "iou_threshold", "expected"),
    [
        (0.3, 0.45, [0.7, 0.6, 0.4]),
        (0.3, 0.9, [0.7, 0.6, 0.5, 0.4]),
        (0.3, 0.3, [0.7, 0.6]),
        (0.1, 0.3, [0.7, 0.6, 0.2]),
        (0.65, 0.45, [0.7]),
        (1.0, 0.45, []),
    ],
)
def test_of_boxes_around_one_object_the_best_is_kept(
    score_threshold: float, iou_threshold: float, expected: list[float], save_model: SaveModel
) -> None:
    path = save_model(OVERLAPPING)
    detector = OnnxDetector.load(path, None, score_threshold, iou_threshold)
    assert detector.detect(SQUARE).scores == pytest.approx(expected)


def test_an_end_to_end_network_is_taken_at_its_word(save_model: SaveModel) -> None:
    table = np.zeros((1, 300, 6))
    table[0, :2] = (20, 20, 30, 30, 0.8, 0), (20, 20, 30, 30, 0.9, 0)
    found = OnnxDetector.load(save_model({"output0": table})).detect(SQUARE)
    assert found.scores == pytest.approx([0.9, 0.8])


def test_boxes_end_at_the_edge_of_the_image_and_those_beside_it_are_dropped(
    save_model: SaveModel,
) -> None:
    path = save_model(table_of((60, 32, 20, 20, 0.9, 0, 0), (32, 4, 20, 8, 0.8, 0, 0)))
    found = OnnxDetector.load(path).detect(np.zeros((32, 64, 3), np.uint8))  # at rows 16 to 48
    assert found.xyxy.tolist() == [[50, 6, 64, 26]]


# The input


@pytest.mark.parametrize(
    ("imgsz", "shape", "expected"),
    [
        ("[64, 96]", ("batch", 3, "height", "width"), (96, 64)),
        ("64", ("batch", 3, "height", "width"), (64, 64)),
        (None, ("batch", 3, "height", "width"), (640, 640)),
        (None, (1, 3, 64, 96), (96, 64)),
        ("[640, 640]", (None, 3, 64, "width"), (640, 64)),
    ],
)
def test_an_open_input_size_comes_from_the_metadata(
    imgsz: str | None, shape: tuple[Any, ...], expected: tuple[int, int], save_model: SaveModel
) -> None:
    width, height = expected
    cells = sum((width // s) * (height // s) for s in (8, 16, 32))
    metadata = {"names": "['cup', 'bowl', 'chair']"} | ({"imgsz": imgsz} if imgsz else {})
    path = save_model({"output0": np.zeros((1, 7, cells))}, metadata, shape)
    detector = OnnxDetector.load(path)
    assert detector.model.input_size == expected
    assert len(detector.detect(SQUARE)) == 0


def test_a_network_of_half_precision_runs(save_model: SaveModel, networks: Networks) -> None:
    path = save_model(networks["YOLOv8, YOLO11"], input_type=TensorProto.FLOAT16)
    assert list(OnnxDetector.load(path).detect(SQUARE).names) == ["cup", "chair"]


def test_a_network_that_asks_for_a_size_gets_that_of_its_input(save_model: SaveModel) -> None:
    """Its only box fills the size that it is given."""
    make = helper.make_node
    nodes = [
        make("Cast", ["orig_target_sizes"], ["size"], to=TensorProto.FLOAT),
        make("Constant", [], ["zeros"], value_floats=[0.0, 0.0]),
        make("Constant", [], ["first"], value_ints=[0]),
        make("Constant", [], ["one_row"], value_ints=[1, 2]),
        make("Reshape", ["zeros", "one_row"], ["corner"]),
        make("Concat", ["corner", "size"], ["box"], axis=1),
        make("Unsqueeze", ["box", "first"], ["boxes"]),
        make("Identity", ["labels.value"], ["labels"]),
        make("Identity", ["scores.value"], ["scores"]),
    ]
    path = save_model(
        {"labels": [[1]], "scores": [[0.5]]},
        input_shape=("N", 3, 32, 64),
        size_input="orig_target_sizes",
        nodes=nodes,
        outputs=["labels", "boxes", "scores"],
    )
    found = OnnxDetector.load(path).detect(np.zeros((48, 30, 3), np.uint8))
    assert list(found.names) == ["bowl"]
    assert found.xyxy.tolist() == [[0, 0, 30, 48]]


def test_outputs_that_are_not_numbers_are_left_aside(
    save_model: SaveModel, networks: Networks
) -> None:
    table = networks["YOLOv8, YOLO11"]["output0"]
    nodes = [
        helper.make_node("Identity", ["output0.value"], ["output0"]),
        helper.make_node("Constant", [], ["title"], value_strings=[b"a network"]),
    ]
    path = save_model({"output0": table}, nodes=nodes, outputs=["output0"], words=["title"])
    assert list(OnnxDetector.load(path).detect(SQUARE).names) == ["cup", "chair"]


def test_the_number_of_threads_can_be_given(save_model: SaveModel, networks: Networks) -> None:
    detector = OnnxDetector.load(save_model(networks["RT-DETR, D-FINE"]), threads=1)
    assert len(detector.detect(SQUARE)) == 2


# Names


def test_labels_in_a_file_go_before_those_in_the_model(
    save_model: SaveModel, networks: Networks, tmp_path: Path
) -> None:
    labels = tmp_path / "labels.txt"
    labels.write_text("Tasse\nSchale\nStuhl\n")
    found = OnnxDetector.load(save_model(networks["YOLOv5, YOLOv7"]), labels).detect(SQUARE)
    assert list(found.names) == ["Tasse", "Stuhl"]


def test_coco_can_be_asked_for_where_a_network_names_nothing(
    save_model: SaveModel, networks: Networks
) -> None:
    path = save_model(networks["RT-DETR, D-FINE"], metadata={})
    assert list(OnnxDetector.load(path, "coco").detect(SQUARE).names) == ["person", "car"]


@pytest.mark.parametrize(
    ("layout", "metadata", "labels", "expected"),
    [
        (
            "YOLOv8, YOLO11",
            {},
            None,
            "{model}: the model does not name its 3 classes; give their names with --labels FILE, "
            "or --labels coco",
        ),
        (
            "YOLOv10, YOLO26",
            {},
            None,
            "{model}: the model does not name its classes; give their names with --labels FILE, "
            "or --labels coco",
        ),
        (
            "YOLOv8, YOLO11",
            {"names": "{0: 'cup', 1: 'bowl'}"},
            None,
            "{model}: 2 names, but the model has 3 classes",
        ),
        ("RF-DETR", {}, "cup\n", "{labels}: 1 name, but the model has 3 classes"),
        (
            "YOLOv8, YOLO11",
            {"names": "__import__('os').system('true')"},
            None,
            "{model}: metadata names: "
            "expected a Python literal, got \"__import__('os').system('true')\"",
        ),
        (
            "YOLOv8, YOLO11",
            {"names": "{0: 'cup', 2: 'bowl'}"},
            None,
            "{model}: metadata names: classes must be numbered from 0 to 1",
        ),
    ],
)
def test_names_that_do_not_fit_are_an_error(
    layout: str,
    metadata: dict[str, str],
    labels: str | None,
    expected: str,
    save_model: SaveModel,
    networks: Networks,
    tmp_path: Path,
) -> None:
    model, labels_file = save_model(networks[layout], metadata), tmp_path / "labels.txt"
    labels_file.write_text(labels or "")
    with pytest.raises(FormatError) as error:
        OnnxDetector.load(model, labels_file if labels else None)
    assert str(error.value) == expected.format(model=model, labels=labels_file)


def test_a_class_without_a_name_is_an_error_when_it_is_found(
    save_model: SaveModel, networks: Networks
) -> None:
    path = save_model(networks["YOLOv10, YOLO26"], {"names": "['cup', 'bowl']"})
    detector = OnnxDetector.load(path)
    with pytest.raises(FormatError, match="an object of class 2, but there are names for 2 cl"):
        detector.detect(SQUARE)


# Misuse


@pytest.mark.parametrize("image", [np.zeros((64, 64), np.uint8), np.zeros((64, 64, 3)), SQUARE[:0]])
def test_something_else_than_an_image_is_refused(
    image: Any, save_model: SaveModel, networks: Networks
) -> None:
    detector = OnnxDetector.load(save_model(networks["RT-DETR, D-FINE"]))
    with pytest.raises(ValueError, match=r"expected uint8 \(H, W, 3\)"):
        detector.detect(image)


@pytest.mark.parametrize("name", ["score_threshold", "iou_threshold"])
def test_thresholds_lie_between_0_and_1(
    name: str, save_model: SaveModel, networks: Networks
) -> None:
    path = save_model(networks["RT-DETR, D-FINE"])
    with pytest.raises(ValueError, match=rf"^{name} must be in 0\.\.1, got 1\.5$"):
        OnnxDetector.load(path, **{name: 1.5})


# The contract of every detector, whatever its network


@pytest.mark.parametrize("shape", [(1, 1), (3, 500), (480, 640), (700, 333)])
def test_every_detector_keeps_the_contract(
    network: tuple[str, Path], shape: tuple[int, int]
) -> None:
    detector = OnnxDetector.load(network[1], score_threshold=0.005)
    check_contract(detector.detect, np.zeros((*shape, 3), np.uint8))


def test_the_real_network_keeps_the_contract(yolox: OnnxDetector) -> None:
    image = np.random.default_rng(0).integers(0, 256, (123, 457, 3)).astype(np.uint8)
    check_contract(yolox.detect, image)


def check_contract(detect: Callable[[np.ndarray], Detections], image: np.ndarray) -> None:
    before = image.copy()
    found = detect(image)
    height, width = image.shape[:2]
    assert np.array_equal(image, before)
    assert (found.xyxy.dtype, found.scores.dtype) == (np.float32, np.float32)
    assert (found.xyxy >= 0).all()
    assert (found.xyxy <= (width, height, width, height)).all()
    assert (found.xyxy[:, 2:] > found.xyxy[:, :2]).all()
    assert (np.diff(found.scores) <= 0).all()
    assert all(isinstance(name, str) for name in found.names)
    if found.masks is not None:
        assert found.masks.shape == (len(found), height, width)
    again = detect(image)
    assert np.array_equal(again.xyxy, found.xyxy)
    assert np.array_equal(again.names, found.names)
