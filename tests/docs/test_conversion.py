"""The conversions that docs/recordings.md shows give the recordings that were converted."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from hypermap.recordings import RecordingOptions, open_recording

ROOT = Path(__file__).resolve().parents[2]
WIDTH, HEIGHT, FRAMES = 8, 6, 3
CAMERA = {"w": 2 * WIDTH, "h": 2 * HEIGHT, "fl_x": 20.0, "fl_y": 22.0, "cx": 8.0, "cy": 6.5}
UP_BACKWARD = np.diag([1.0, -1, -1, 1])  # axes of an OpenGL camera in those of an optical frame


def documented(name: str) -> Callable[..., None]:
    text = (ROOT / "docs/recordings.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    namespace: dict[str, Any] = {}
    exec(next(block for block in blocks if f"def {name}(" in block), namespace)
    found: Callable[..., None] = namespace[name]
    return found


def written_poses() -> NDArray[np.float64]:
    """Poses that turn and move about all axes, shape (FRAMES, 4, 4)."""
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    turns = [[0.1, 0.2, 0.3], [0.2, -0.4, 0.3], [-0.5, 0.4, 0.6]]
    poses[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    poses[:, :3, 3] = [[1, 2, 3], [1.5, 2, 3], [1.5, 2.5, 3.5]]
    return poses


def assert_reads(folder: Path, poses: NDArray[np.float64], options: RecordingOptions) -> None:
    """Assert that a folder has these poses, in images of gray 50 i, at 1 + i / 1000 m."""
    frames = list(open_recording(folder, options).frames())
    assert len(frames) == len(poses)
    for i, (frame, pose) in enumerate(zip(frames, poses, strict=True)):
        np.testing.assert_allclose(frame.map_T_camera, pose, atol=1e-9)
        np.testing.assert_allclose(frame.depth, 1 + i / 1000, rtol=1e-6)
        np.testing.assert_allclose(frame.color, 50 * i, atol=2)
        K = frame.camera.K
        assert (K[0, 0], K[1, 1], K[0, 2], K[1, 2]) == pytest.approx((10, 11, 3.5, 2.75))


def write_images(depth: Callable[[int], Path], color: Callable[[int], Path]) -> None:
    for i in range(FRAMES):
        for path in (depth(i), color(i)):
            path.parent.mkdir(exist_ok=True)
        Image.fromarray(np.full((HEIGHT, WIDTH), 1000 + i, np.uint16)).save(depth(i))
        Image.fromarray(np.full((HEIGHT, WIDTH, 3), 50 * i, np.uint8)).save(color(i))


def test_a_scan_of_arkitscenes_becomes_a_tum_folder(tmp_path: Path) -> None:
    names = [f"40753679_{6790.5 + i / 10:.3f}.png" for i in range(FRAMES)]
    write_images(
        lambda i: tmp_path / "lowres_depth" / names[i],
        lambda i: tmp_path / "lowres_wide" / names[i],
    )
    rows = [
        (6790.5 + i / 10, *Rotation.from_matrix(pose[:3, :3]).as_rotvec(), *pose[:3, 3])
        for i, pose in enumerate(np.linalg.inv(written_poses()))
    ]
    np.savetxt(tmp_path / "lowres_wide.traj", rows)
    documented("add_to_arkitscenes")(tmp_path)
    options = RecordingOptions(depth_scale=1000, intrinsics=(10, 11, 3.5, 2.75))
    assert_reads(tmp_path, written_poses(), options)


def test_a_scan_of_stray_scanner_becomes_a_recording_of_numbered_images(tmp_path: Path) -> None:
    write_images(
        lambda i: tmp_path / f"depth/{i:06d}.png",
        lambda i: tmp_path / f"color/{i:06d}.png",  # as ffmpeg writes it, but without losses
    )
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for i, pose in enumerate(written_poses()):
        numbers = (*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat())
        lines.append(f"{100 + i / 60}, {i:06d}, " + ", ".join(map(repr, map(float, numbers))))
    (tmp_path / "odometry.csv").write_text("\n".join(lines))
    K = "20.0, 0.0, 7.0\n0.0, 22.0, 5.5\n0.0, 0.0, 1.0\n"
    (tmp_path / "camera_matrix.csv").write_text(K)
    documented("add_to_stray")(tmp_path, (2 * WIDTH, 2 * HEIGHT), (WIDTH, HEIGHT))
    assert_reads(tmp_path, written_poses(), RecordingOptions())


def test_a_package_of_openloris_becomes_a_tum_folder(tmp_path: Path) -> None:
    stamps = [f"{1559.5 + i / 10:.6f}" for i in range(FRAMES)]
    write_images(
        lambda i: tmp_path / f"aligned_depth/{stamps[i]}.png",
        lambda i: tmp_path / f"color/{stamps[i]}.png",
    )
    for name in ("color", "aligned_depth", "depth"):
        lines = [f"{stamp} {name}/{stamp}.png" for stamp in stamps]
        (tmp_path / f"{name}.txt").write_text("#Time filename\n" + "\n".join(lines))
    mast_T_camera, base_T_mast = np.eye(4), np.eye(4)
    mast_T_camera[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    base_T_mast[:3, 3] = [0.2, 0.01, 1.0]
    text = "%YAML:1.0\n---\ntrans_matrix:\n"
    for parent, child, matrix in (
        ("d400_color", "d400_color_optical_frame", mast_T_camera),
        ("base_link", "d400_color", base_T_mast),
    ):
        numbers = ", ".join(map(str, matrix.ravel()))
        text += f"-\n  parent_frame: {parent}\n  child_frame: {child}\n  matrix: !!opencv-matrix\n"
        text += f"     rows: 4\n     cols: 4\n     dt: d\n     data: [ {numbers} ]\n"
    (tmp_path / "trans_matrix.yaml").write_text(text)
    robot = written_poses() @ np.linalg.inv(base_T_mast @ mast_T_camera)
    quaternions = Rotation.from_matrix(robot[:, :3, :3]).as_quat()
    rows = np.column_stack([np.array(stamps, float), robot[:, :3, 3], quaternions])
    np.savetxt(tmp_path / "groundtruth.txt", rows, header="Time px py pz qx qy qz qw")
    for _ in range(2):  # a second time changes nothing
        documented("add_to_openloris")(tmp_path)
    options = RecordingOptions(depth_scale=1000, intrinsics=(10, 11, 3.5, 2.75))
    assert_reads(tmp_path, written_poses(), options)


def test_a_camera_of_matterport_becomes_a_recording_of_numbered_images(tmp_path: Path) -> None:
    scan, lines = tmp_path / "scan", ["dataset matterport", f"n_images {2 * FRAMES}", ""]
    names = {kind: [f"ab_{kind}1_{i}" for i in range(FRAMES)] for kind in "di"}
    scan.mkdir()
    write_images(
        lambda i: scan / f"undistorted_depth_images/{names['d'][i]}.png",
        lambda i: scan / f"undistorted_color_images/{names['i'][i]}.jpg",
    )
    lines.append("intrinsics_matrix 9 0 3.5 0 9 2.5 0 0 1")
    lines += [f"scan ab_d0_{i}.png ab_i0_{i}.jpg " + "1 " * 16 for i in range(FRAMES)]
    lines.append(f"intrinsics_matrix 10 0 3.5  0 11 {HEIGHT - 1 - 2.75} 0 0 1")
    for i, pose in enumerate(written_poses() @ UP_BACKWARD):
        numbers = " ".join(map(str, pose.ravel()))
        lines.append(f"scan {names['d'][i]}.png {names['i'][i]}.jpg {numbers}")
    (scan / "undistorted_camera_parameters").mkdir()
    (scan / "undistorted_camera_parameters/scan.conf").write_text("\n".join(lines) + "\n")
    documented("copy_from_matterport")(scan, 1, tmp_path / "ahead")
    options = RecordingOptions(pose_convention="opengl", depth_scale=1000)
    assert_reads(tmp_path / "ahead", written_poses(), options)


@pytest.mark.parametrize("per_frame", [False, True])
def test_transforms_json_becomes_a_recording_of_numbered_images(
    tmp_path: Path, per_frame: bool
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

    documented("convert")(tmp_path, tmp_path / "converted")

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
