"""Both methods against PCL 1.13 itself, on real Kinect frames."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from PIL import Image

from hypermap.core.trajectory import transform_points
from hypermap.perception.config import Method, PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.footprints import footprint
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.observe import observe
from hypermap.perception.segmentation import segment, valid_pixels

pytestmark = pytest.mark.xdist_group("golden")  # they share what takes long to make

FRAMES = [
    "240_1305031229.729077",
    "480_1305031233.932003",
    "240_1305031236.733922",
    "480_1305031239.543802",
    "240_1305031241.878799",
    "480_1305031244.945868",
    "240_1305031248.485297",
    "480_1305031250.685297",
]


@dataclass(frozen=True)
class Golden:
    """PCL's answers to one frame."""

    frame: RgbdFrame
    detections: Detections
    clusters: list[NDArray[np.int32]]
    footprints: list[shapely.Polygon]
    visible_area: shapely.Polygon


@pytest.fixture(scope="module", params=FRAMES)
def golden(request: pytest.FixtureRequest, shared_data: Path) -> Golden:
    return read_golden(shared_data, request.param)


@pytest.fixture(scope="module")
def all_golden(shared_data: Path) -> list[Golden]:
    return [read_golden(shared_data, key) for key in FRAMES]


def read_golden(shared_data: Path, key: str) -> Golden:
    with np.load(shared_data / "pcl_golden" / "desk.npz") as answers:
        get: dict[str, Any] = {
            name.removeprefix(f"{key}/"): answers[name]
            for name in answers.files
            if name.startswith(key)
        }
    step = int(get["stride"])
    raw = np.asarray(Image.open(shared_data / "desk" / str(get["depth_file"])))[::step, ::step]
    depth = np.where(raw > 0, raw / np.float32(5000), np.float32(np.nan)).astype(np.float32)
    camera = Camera.from_intrinsics(*get["K"], width=depth.shape[1], height=depth.shape[0])
    boxes = range(len(get["boxes"]))
    return Golden(
        RgbdFrame(0.0, depth, camera, get["map_T_camera"]),
        Detections.of(get["boxes"], list(get["names"])),
        [get[f"{j}/largest_cluster"] for j in boxes],
        [shapely.Polygon(get[f"{j}/footprint"]) for j in boxes],
        shapely.Polygon(get["visible_area"]),
    )


def test_every_frame_of_the_golden_file_is_tested(shared_data: Path) -> None:
    with np.load(shared_data / "pcl_golden" / "desk.npz") as answers:
        assert answers["keys"].tolist() == FRAMES


def test_the_reference_gives_what_pcl_gives(golden: Golden) -> None:
    # Points at equal distances, which are common where the depth is quantized coarsely, may be
    # ranked differently; so may the points of a region's edge join the next region.
    for box, (cluster, shape) in enumerate(agreement(golden, "unorganised")):
        assert cluster >= 0.999, box
        assert shape >= 0.999, box


def test_the_fast_method_gives_about_what_pcl_gives(all_golden: list[Golden]) -> None:
    shapes = [shape for golden in all_golden for _, shape in agreement(golden, "organised")]
    assert len(shapes) == 32
    assert np.mean(shapes) >= 0.95
    assert np.median(shapes) >= 0.998


def agreement(golden: Golden, method: Method) -> list[tuple[float, float]]:
    """Return the IoU of each box's cluster, and of its footprint, with PCL's."""
    config = PerceptionConfig(method=method, max_depth=np.inf)
    frame = golden.frame
    valid = valid_pixels(frame, config)
    found = segment(frame, valid, golden.detections, config)
    assert [s.detection for s in found] == list(range(len(golden.detections)))
    ious = []
    for ours, pixels, shape in zip(found, golden.clusters, golden.footprints, strict=True):
        cluster = len(np.intersect1d(ours.pixels, pixels)) / len(np.union1d(ours.pixels, pixels))
        points_map = transform_points(frame.map_T_camera, ours.points_xyz)
        ious.append((cluster, iou(footprint(points_map, config.voxel_size), shape)))
    return ious


def test_the_visible_area_is_what_pcl_gives(golden: Golden) -> None:
    observation = observe(golden.frame, Detections.of([], []), PerceptionConfig.thesis())
    assert iou(observation.visible_area, golden.visible_area) >= 0.999


def iou(a: shapely.Geometry, b: shapely.Geometry) -> float:
    return float(a.intersection(b).area / a.union(b).area)
