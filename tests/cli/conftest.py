"""The command line, run in this process as the user's shell would run it in another."""

from __future__ import annotations

import contextlib
import io
import json
import logging
import math
import os
import pty
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image

from hypermap.cli.main import main
from hypermap.cli.terminal import set_verbosity
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map

from ..prepared import Command


@dataclass(frozen=True)
class Result:
    """What a command left behind."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def hypermap(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., Result]]:
    """Run `hypermap ARGUMENTS` and return its exit code and what it printed.

    That loops are compiled is left out: when it is said depends on which test comes first.
    """
    monkeypatch.setattr(logging.getLogger("hypermap._loops"), "disabled", True)

    def run(*arguments: object, stdin: str = "") -> Result:
        monkeypatch.setattr("sys.stdin", io.StringIO(stdin))
        capsys.readouterr()
        with pytest.raises(SystemExit) as exit_:
            main([str(argument) for argument in arguments])
        code = exit_.value.code
        assert isinstance(code, int | None)
        captured = capsys.readouterr()
        return Result(code or 0, captured.out, captured.err)

    yield run
    set_verbosity(0)


def answered(words: Sequence[object], answer: str) -> tuple[int | None, bytes]:
    """Run a command at a terminal, type an answer, and return the exit code and what was shown."""
    ours, theirs = pty.openpty()
    with Command(*words, stdin=theirs, stderr=theirs) as process:
        os.close(theirs)
        os.write(ours, answer.encode())
        said = b""
        with contextlib.suppress(OSError):  # the terminal is gone with its last program
            while part := os.read(ours, 1 << 16):
                said += part
        os.close(ours)
    return process.returncode, said


def assert_one_error(result: Result, *words: str) -> None:
    """Assert that a command ended as bad input should: exit code 2 and one line that says why."""
    assert result.code == 2
    assert result.out == ""
    (line,) = result.err.splitlines()
    assert line.startswith("hypermap: error: ")
    for word in words:
        assert word in line


INTRINSICS = "131.25,131.25,79.5,59.5"


def write_drive(folder: Path, frames: int, has_detections: bool = True) -> Path:
    """Write a TUM RGB-D folder in which a camera swaying at 1 m height looks at a chair.

    The chair is a slope from 1.3 to 1.7 m away, so at (1.5, 0) in the map, before a wall.
    """
    folder.mkdir()
    depth = np.full((120, 160), 2.5)
    depth[40:80, 60:100] = np.linspace(1.7, 1.3, 40)[:, np.newaxis]
    Image.fromarray((depth * 5000).astype(np.uint16)).save(folder / "depth.png")
    Image.new("RGB", (160, 120), "gray").save(folder / "color.png")
    stamps = [f"{100 + 0.1 * i:.4f}" for i in range(frames)]
    for name in ("depth", "rgb"):
        image = "depth.png" if name == "depth" else "color.png"
        (folder / f"{name}.txt").write_text("".join(f"{stamp} {image}\n" for stamp in stamps))
    poses = (f"{stamp} 0 {0.03 * (-1) ** i} 1 -0.5 0.5 -0.5 0.5" for i, stamp in enumerate(stamps))
    (folder / "groundtruth.txt").write_text("\n".join(poses) + "\n")
    if has_detections:
        chair = {"box": [58, 38, 102, 82], "name": "chair", "score": 0.9}
        found = {"image_size": [160, 120], "frames": {stamp: [chair] for stamp in stamps}}
        (folder / "detections.json").write_text(json.dumps(found))
    return folder


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of six frames with its detections."""
    return write_drive(tmp_path_factory.mktemp("recordings") / "drive", frames=6)


@pytest.fixture(scope="session")
def unsure_network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A network that finds the chair of `write_drive` in every image, with a score of 0.2."""
    import onnx
    from onnx import helper, numpy_helper

    chair = np.array([[[23.2, 23.2, 40.8, 40.8, 0.2, 0]]], np.float32)  # in 64 x 64 pixels
    graph = helper.make_graph(
        [helper.make_node("Identity", ["found"], ["output0"])],
        "network",
        [helper.make_tensor_value_info("images", onnx.TensorProto.FLOAT, (1, 3, 64, 64))],
        [helper.make_tensor_value_info("output0", onnx.TensorProto.FLOAT, None)],
        [numpy_helper.from_array(chair, "found")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, {"names": "{0: 'chair'}", "task": "detect"})
    path = tmp_path_factory.mktemp("models") / "unsure.onnx"
    path.write_bytes(model.SerializeToString())
    return path


@pytest.fixture(scope="session")
def room_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map with a turned layer: two chairs and a potted plant in a frame that lies at (10, 0)."""
    things = [
        SemanticObject("chair", shapely.box(0, 0, 1, 1)),
        SemanticObject("chair", shapely.box(4, 0, 5, 1), existence=3.5, attributes={"z_max": 0.9}),
        SemanticObject("potted plant", shapely.box(2, 2, 3, 3)),
    ]
    cells = np.full((20, 30), -1, dtype=np.int8)
    cells[5:15, 5:25] = 0
    cells[5, 5:25] = 100
    occupancy = OccupancyLayer("occupancy", "map", GridGeometry(30, 20, 0.5), cells)
    frames = FrameTree([Transform("map", "room", Pose2D(x=10.0, yaw=math.pi / 2))])
    hypermap = Hypermap([occupancy, SemanticLayer("semantic", "room", things)], frames)
    path = tmp_path_factory.mktemp("maps") / "room.hmap"
    save_map(hypermap, path)
    return path


def objects_in(path: Path) -> list[tuple[str, float, float]]:
    """Return the name and centroid of each object in a map file."""
    layer = open_map(path)["semantic"]
    assert isinstance(layer, SemanticLayer)
    centers = ((thing.name, thing.footprint.centroid) for thing in layer.objects())
    return [(name, center.x, center.y) for name, center in centers]
