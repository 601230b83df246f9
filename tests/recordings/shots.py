"""A made-up recording of a box on a floor, and its image folders."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from hypermap.core.errors import HypermapError
from hypermap.perception.frame import RgbdFrame
from hypermap.recordings import open_recording

WIDTH, HEIGHT = 32, 24
INTRINSICS = (26.0, 27.0, 15.5, 11.25)  # fx, fy, cx, cy
START = 1_600_000_000_250_000_000  # ns


@dataclass(frozen=True, eq=False)
class Shot:
    stamp: int  # ns
    color_stamp: int  # ns
    depth_mm: NDArray[np.uint16]
    color: NDArray[np.uint8]
    position: NDArray[np.float64]
    quat_xyzw: NDArray[np.float64]

    @property
    def map_T_camera(self) -> NDArray[np.float64]:  # noqa: N802
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat(self.quat_xyzw).as_matrix()
        pose[:3, 3] = self.position
        return pose


def make_shots(count: int = 4) -> list[Shot]:
    """A camera 1.5 m above the floor looks down on it and on a box, and moves along x."""
    random = np.random.default_rng(7)
    shots = []
    for i in range(count):
        depth = np.full((HEIGHT, WIDTH), 1500, np.uint16)
        depth[8:16, 10 + i : 20 + i] = 1100
        depth[0, :3] = 0
        color = random.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        turn = Rotation.from_euler("xyz", [180, 0, 10.0 * i], degrees=True)
        shots.append(
            Shot(
                stamp=START + i * 100_000_000,
                color_stamp=START + i * 100_000_000 + 4_000_000,
                depth_mm=depth,
                color=color,
                position=np.array([0.1 * i, -0.2, 1.5]),
                quat_xyzw=turn.as_quat(),
            )
        )
    return shots


SHOTS = make_shots()


def seconds(stamp: int) -> str:
    return f"{stamp // 10**9}.{stamp % 10**9:09d}"


def write_tum(folder: Path, shots: list[Shot]) -> Path:
    """Write a TUM folder; its depth has 1000 units to the meter."""
    lists: dict[str, list[str]] = {"depth.txt": [], "rgb.txt": [], "groundtruth.txt": ["# stamps"]}
    for name in ("depth", "rgb"):
        (folder / name).mkdir(parents=True)
    for shot in shots:
        stamp, color_stamp = seconds(shot.stamp), seconds(shot.color_stamp)
        Image.fromarray(shot.depth_mm).save(folder / f"depth/{stamp}.png")
        Image.fromarray(shot.color).save(folder / f"rgb/{color_stamp}.png")
        lists["depth.txt"].append(f"{stamp} depth/{stamp}.png")
        lists["rgb.txt"].append(f"{color_stamp} rgb/{color_stamp}.png")
        pose = " ".join(repr(float(x)) for x in (*shot.position, *shot.quat_xyzw))
        lists["groundtruth.txt"].append(f"{stamp} {pose}")
    for name, lines in lists.items():
        (folder / name).write_text("\n".join(lines) + "\n")
    return folder


def write_seven_scenes(folder: Path, shots: list[Shot]) -> Path:
    folder.mkdir(parents=True)
    fx, fy, cx, cy = INTRINSICS
    (folder / "camera-intrinsics.txt").write_text(f"{fx} 0 {cx}\n0 {fy} {cy}\n0 0 1\n")
    for i, shot in enumerate(shots):
        Image.fromarray(shot.depth_mm).save(folder / f"frame-{i:06d}.depth.png")
        Image.fromarray(shot.color).save(folder / f"frame-{i:06d}.color.png")
        np.savetxt(folder / f"frame-{i:06d}.pose.txt", shot.map_T_camera, fmt="%.10e")
    return folder


def assert_broken(folder: Path, kind: type[HypermapError], message: str) -> None:
    """Assert that a folder gives no frame, for one reason, which `info` tells, too."""
    assert open_recording(folder).info().missing == (message,)
    with pytest.raises(kind) as caught:
        next(open_recording(folder).frames())
    assert str(caught.value) == message


def assert_shows(frame: RgbdFrame, shot: Shot) -> None:
    """Assert that a frame is a shot: depth and color exactly, the pose to a micrometre."""
    expected = np.where(shot.depth_mm == 0, np.nan, shot.depth_mm / 1000)
    assert frame.depth.dtype == np.float32
    np.testing.assert_array_equal(frame.depth, expected.astype(np.float32))
    np.testing.assert_allclose(frame.map_T_camera, shot.map_T_camera, atol=1e-6)
    np.testing.assert_array_equal(frame.color, shot.color)


def write_scannet(folder: Path, shots: list[Shot]) -> Path:
    """Write a folder as ScanNet's SensReader exports it; color is twice as large as depth."""
    for name in ("color", "depth", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    fx, fy, cx, cy = INTRINSICS
    K = np.array([[fx, 0, cx, 0], [0, fy, cy, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.savetxt(folder / "intrinsic/intrinsic_depth.txt", K, fmt="%f")
    K[:2] *= 2
    K[:2, 2] += 0.5  # from the centers of the large pixels to those of the small ones
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", K, fmt="%f")
    for i, shot in enumerate(shots):
        Image.fromarray(shot.depth_mm).save(folder / f"depth/{i}.png")
        Image.fromarray(shot.color.repeat(2, 0).repeat(2, 1)).save(folder / f"color/{i}.png")
        np.savetxt(folder / f"pose/{i}.txt", shot.map_T_camera, fmt="%.10f")
    return folder


def write_replica(folder: Path, shots: list[Shot]) -> Path:
    """Write a folder of Replica as NICE-SLAM renders it."""
    (folder / "results").mkdir(parents=True)
    fx, fy, cx, cy = INTRINSICS
    camera = {"w": WIDTH, "h": HEIGHT, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "scale": 5000.0}
    (folder / "cam_params.json").write_text(json.dumps({"camera": camera}))
    for i, shot in enumerate(shots):
        Image.fromarray(shot.depth_mm * np.uint16(5)).save(folder / f"results/depth{i:06d}.png")
        Image.fromarray(shot.color).save(folder / f"results/frame{i:06d}.png")
    np.savetxt(folder / "traj.txt", [shot.map_T_camera.ravel() for shot in shots])
    return folder


def write_redwood(folder: Path, shots: list[Shot]) -> Path:
    """Write a folder as Open3D's reconstruction system has it; its images count from 1."""
    for name in ("color", "depth", "scene"):
        (folder / name).mkdir(parents=True)
    fx, fy, cx, cy = INTRINSICS
    K = [fx, 0, 0, 0, fy, 0, cx, cy, 1]
    (folder / "camera_intrinsic.json").write_text(json.dumps({"intrinsic_matrix": K}))
    lines = []
    for i, shot in enumerate(shots):
        Image.fromarray(shot.depth_mm).save(folder / f"depth/{i + 1:05d}.png")
        Image.fromarray(shot.color).save(folder / f"color/{i + 1:05d}.png")
        rows = (" ".join(f"{number:.9f}" for number in row) for row in shot.map_T_camera)
        lines += [f"{i} {i} {i + 1}", *rows]
    (folder / "scene/trajectory.log").write_text("\n".join(lines) + "\n")
    return folder
