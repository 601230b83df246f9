from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.perception.detectors import load_detector

from ...installed import install_package
from .conftest import SaveModel, yolov8_table

PLUGIN = '''
import numpy as np
from hypermap.perception.detections import Detections


class WholeImage:
    """Takes every image as one object."""

    def __init__(self, name):
        if name == "nothing":
            raise FileNotFoundError("there is no nothing")
        if name == "end":
            raise SystemExit
        self.name = name

    def detect(self, color):
        height, width = color.shape[:2]
        return Detections.of([[0, 0, width, height]], [self.name], [1.0])
'''


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with a detector, as pip would install it."""
    (tmp_path / "whole_image.py").write_text(PLUGIN)
    points = {"whole": "whole_image:WholeImage"}
    install_package(tmp_path, "whole-image", "hypermap.detectors", points)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("installed")
def test_of_two_packages_with_a_detector_of_one_name_none_is_taken(tmp_path: Path) -> None:
    install_package(tmp_path, "other", "hypermap.detectors", {"whole": "other:WholeImage"})
    with pytest.raises(HypermapError, match=r"have the same name 'whole' in hypermap.detectors"):
        load_detector("whole:a")


@pytest.mark.usefixtures("installed")
def test_a_detector_of_another_package_gets_what_stands_after_its_name() -> None:
    found = load_detector("whole:a:room").detect(np.zeros((3, 4, 3), np.uint8))
    assert list(found.names) == ["a:room"]
    assert found.xyxy.tolist() == [[0, 0, 4, 3]]


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            "whole:nothing",
            "detector plug-in 'whole' (whole_image:WholeImage) cannot be created from 'nothing': "
            "FileNotFoundError: there is no nothing",
        ),
        (
            "whole:end",
            "detector plug-in 'whole' (whole_image:WholeImage) cannot be created from 'end': "
            "SystemExit",
        ),
        ("whole", "whole: the installed detector of this name needs an argument: whole:ARGUMENT"),
    ],
)
def test_a_plugin_that_cannot_make_its_detector_is_named(given: str, message: str) -> None:
    with pytest.raises(HypermapError) as error:
        load_detector(given)
    assert str(error.value) == message


@pytest.mark.usefixtures("installed")
def test_an_unknown_detector_is_an_error_that_names_the_known() -> None:
    with pytest.raises(HypermapError) as error:
        load_detector("hole:room")
    assert str(error.value) == ("hole:room: no detector 'hole' is installed; did you mean 'whole'?")


def test_with_none_installed_the_error_says_so() -> None:
    with pytest.raises(HypermapError) as error:
        load_detector("whole:room")
    assert str(error.value) == "whole:room: no detector 'whole' is installed; known: none"


def test_an_onnx_file_is_opened_under_any_name(
    save_model: Callable[..., Path], networks: dict[str, dict[str, np.ndarray]], tmp_path: Path
) -> None:
    model = save_model(networks["RT-DETR, D-FINE"])
    renamed = model.rename(tmp_path / "a:model")
    found = load_detector(str(renamed), score_threshold=0.7).detect(np.zeros((64, 64, 3), np.uint8))
    assert list(found.names) == ["cup"]


@pytest.mark.parametrize("name", ["missing.onnx", "C:/missing.onnx", "missing"])
def test_a_missing_model_is_an_error(name: str) -> None:
    with pytest.raises(FileMissing, match="there is no such model"):
        load_detector(name)


def test_a_model_of_pytorch_is_no_onnx_model(tmp_path: Path) -> None:
    path = tmp_path / "yolo11n.pt"
    path.write_bytes(b"PK\x03\x04" + bytes(100))
    with pytest.raises(FormatError, match="not ONNX; export the network first"):
        load_detector(path)


def test_onnx_runtime_is_imported_only_when_a_model_is_loaded() -> None:
    code = (
        "import sys, hypermap.perception.detectors, hypermap.perception.detectors.sources; "
        "sys.exit('onnxruntime' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_onnx_runtime_reports_to_nobody(save_model: SaveModel, tmp_path: Path) -> None:
    # Where it reports, it begins with a file of its session in the temporary directory.
    quiet = ("CI", "ORT_RUNNING_UNIT_TESTS", "ORT_DISABLE_TELEMETRY")
    environment = {key: value for key, value in os.environ.items() if key not in quiet}
    code = (
        "import sys; from hypermap.perception.detectors import load_detector; "
        "load_detector(sys.argv[1])"
    )
    subprocess.run(
        [sys.executable, "-c", code, save_model({"output0": yolov8_table()})],
        env={**environment, "TMPDIR": str(tmp_path)},
        check=True,
    )
    assert list(tmp_path.iterdir()) == []
