from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import FormatError, HypermapError
from hypermap.perception.detections import Detections
from hypermap.perception.detectors import load_detector
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.perception.detectors.sources import (
    detections_from_detector,
    detections_from_file,
    detections_from_recording,
)
from hypermap.perception.frame import Camera, RgbdFrame

COLOR = np.zeros((64, 64, 3), np.uint8)


def frame(
    color: np.ndarray | None = None,
    color_stamp: float | None = None,
    detections: Detections | None = None,
) -> RgbdFrame:
    camera = Camera.from_intrinsics(60, 60, 31.5, 31.5, 64, 64)
    depth = np.ones((64, 64), np.float32)
    return RgbdFrame(10.0, depth, camera, np.eye(4), color, color_stamp, detections)


def test_a_detector_looks_at_the_color_image(
    save_model: Callable[..., Path], networks: dict[str, dict[str, np.ndarray]]
) -> None:
    source = detections_from_detector(load_detector(save_model(networks["RT-DETR, D-FINE"])))
    assert list(source(frame(COLOR)).names) == ["cup", "chair"]


def test_without_a_color_image_a_detector_has_nothing_to_look_at(
    save_model: Callable[..., Path], networks: dict[str, dict[str, np.ndarray]]
) -> None:
    source = detections_from_detector(load_detector(save_model(networks["RT-DETR, D-FINE"])))
    with pytest.raises(HypermapError) as error:
        source(frame())
    assert str(error.value) == (
        "the frame at 10.000000 has no color image, which a detector needs; "
        "give detections from a file instead, with --detections FILE"
    )


def write(path: Path, image_size: tuple[int, int] | None) -> Path:
    cup = {"box": [1, 2, 3, 4], "name": "cup", "score": 0.5}
    content = {"frames": {"10.0": [cup], "10.02": [cup, cup]}}
    path.write_text(json.dumps(content | ({"image_size": image_size} if image_size else {})))
    return path


@pytest.mark.parametrize("image_size", [None, (64, 64)])
def test_a_file_is_asked_for_the_stamp_of_the_color_image(
    image_size: tuple[int, int] | None, tmp_path: Path
) -> None:
    source = detections_from_file(write(tmp_path / "detections.json", image_size))
    assert len(source(frame(COLOR, color_stamp=10.02))) == 2
    assert len(source(frame())) == 1


def test_boxes_beside_the_image_are_warned_of_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "detections.json"
    cup = {"box": [1, 70, 3, 90], "name": "cup", "score": 0.5}
    path.write_text(json.dumps({"frames": {"10.0": [cup]}}))
    source = detections_from_file(path)
    with caplog.at_level(logging.WARNING):
        assert [len(source(frame())) for _ in range(2)] == [1, 1]
        detections_from_file(write(tmp_path / "inside.json", None))(frame())
    assert [record.getMessage() for record in caplog.records] == [
        f"{path}: boxes lie beside the image of 64 x 64 pixels; are they of images of another size?"
    ]


def test_detections_of_images_of_another_size_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "detections.json", (640, 480))
    source = detections_from_file(path)
    with pytest.raises(FormatError) as error:
        source(frame(COLOR))
    assert str(error.value) == (
        f"{path}: image_size: the detections are of images of 640 x 480 pixels, "
        "but the recording has 64 x 64"
    )


def test_masks_of_another_size_are_refused(tmp_path: Path) -> None:
    recorded = RecordedDetections()
    masks = np.ones((1, 48, 32), dtype=bool)
    recorded.add(10.0, Detections.of([[0, 0, 9, 9]], ["cup"], masks=masks))
    recorded.save(path := tmp_path / "detections.json")
    with pytest.raises(FormatError) as error:
        detections_from_file(path)(frame(COLOR))
    assert (
        str(error.value) == f"{path}: the masks have 32 x 48 pixels, but the recording has 64 x 64"
    )


def test_recorded_detections_are_passed_on_and_missing_ones_are_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    source, found = detections_from_recording(), Detections.of([[0, 0, 1, 1]], ["cup"])
    with caplog.at_level(logging.WARNING):
        assert source(frame(detections=found)) is found
        assert [len(source(frame())) for _ in range(3)] == [0, 0, 0]
    assert [record.getMessage() for record in caplog.records] == [
        "the recording has no detections for the frame at 10.000000; it counts as one without "
        "objects, and so do others like it"
    ]


class Moody:
    """A detector of another package."""

    def __init__(self, answer: object) -> None:
        self.answer = answer

    def detect(self, _color: np.ndarray) -> object:
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (ZeroDivisionError("division by zero"), "failed: ZeroDivisionError: division by zero"),
        (KeyError(), "failed: KeyError"),
        (SystemExit("no license"), "failed: SystemExit: no license"),
        ([1, 2], "returned list, not Detections"),
    ],
)
def test_what_a_detector_does_wrong_is_reported_as_the_detectors(
    answer: object, message: str
) -> None:
    source = detections_from_detector(Moody(answer))  # type: ignore[arg-type]
    with pytest.raises(HypermapError) as error:
        source(frame(COLOR))
    assert str(error.value) == f"detector {__name__}.Moody {message}"


def test_that_the_memory_is_full_is_not_the_detectors_fault() -> None:
    source = detections_from_detector(Moody(MemoryError()))  # type: ignore[arg-type]
    with pytest.raises(HypermapError, match="there was not enough memory"):
        source(frame(COLOR))
