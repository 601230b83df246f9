"""The conversion that docs/recordings.md shows gives the recording that was converted."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hypermap.recordings import RecordingOptions, open_recording

ROOT = Path(__file__).resolve().parents[2]
WIDTH, HEIGHT, FRAMES = 8, 6, 3
CAMERA = {"w": 2 * WIDTH, "h": 2 * HEIGHT, "fl_x": 20.0, "fl_y": 22.0, "cx": 8.0, "cy": 6.5}
UP_BACKWARD = np.diag([1.0, -1, -1, 1])  # axes of an OpenGL camera in those of an optical frame


@pytest.fixture
def convert() -> Callable[[Path, Path], None]:
    text = (ROOT / "docs/recordings.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    namespace: dict[str, Any] = {}
    exec(next(block for block in blocks if "def convert(" in block), namespace)
    found: Callable[[Path, Path], None] = namespace["convert"]
    return found


@pytest.mark.parametrize("per_frame", [False, True])
def test_transforms_json_becomes_a_recording_of_numbered_images(
    convert: Callable[[Path, Path], None], tmp_path: Path, per_frame: bool
) -> None:
    frames, poses = [], []
    for i in range(FRAMES):
        pose = np.eye(4)
        pose[:3, 3] = i, 2, 3
        poses.append(pose)
        Image.fromarray(np.full((HEIGHT, WIDTH), 1000 + i, np.uint16)).save(tmp_path / f"d{i}.png")
        color = np.full((2 * HEIGHT, 2 * WIDTH, 3), 50 * i, np.uint8)
        Image.fromarray(color).save(tmp_path / f"c{i}.jpg")
        frame = {
            "file_path": f"c{i}.jpg",
            "depth_file_path": f"d{i}.png",
            "transform_matrix": (pose @ UP_BACKWARD).tolist(),
        }
        frames.append(frame | (CAMERA if per_frame else {}))
    capture = {"frames": frames} | ({} if per_frame else CAMERA)
    (tmp_path / "transforms.json").write_text(json.dumps(capture))

    convert(tmp_path, tmp_path / "converted")

    options = RecordingOptions(pose_convention="opengl")
    read = list(open_recording(tmp_path / "converted", options).frames())
    assert len(read) == FRAMES
    for i, (frame, pose) in enumerate(zip(read, poses, strict=True)):
        np.testing.assert_allclose(frame.map_T_camera, pose)
        np.testing.assert_allclose(frame.depth, 1 + i / 1000, rtol=1e-6)
        assert frame.color is not None
        np.testing.assert_allclose(frame.color, 50 * i, atol=2)
        # A point in the middle of the color image is in the middle of the depth image.
        K = frame.camera.K
        assert (K[0, 0], K[1, 1]) == (10.0, 11.0)
        assert (K[0, 2], K[1, 2]) == ((WIDTH - 1) / 2, 2.75)
