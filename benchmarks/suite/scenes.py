"""Real frames of a Kinect with the boxes of a real detector, and what PCL found in these."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image

from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame

SIZES = {240: "320 x 240", 480: "640 x 480"}
ORGANISED = PerceptionConfig.thesis()
UNORGANISED = replace(ORGANISED, method="unorganised")  # PCL's method to the letter


@dataclass(frozen=True, eq=False)
class Scene:
    """A real frame with its boxes, and PCL's recorded answers.

    Attributes:
        key: its name in the recorded answers.
        depth: meters, shape (H, W).
        camera: intrinsics.
        map_T_camera: pose, shape (4, 4).
        boxes: xmin, ymin, xmax, ymax, int32, shape (N, 4).
        names: of the boxes, N of them.
        clusters: row-major indices of the largest cluster's pixels in each box.
        footprints: of each box.
        visible_area: hull of the whole cloud.
    """

    key: str
    depth: NDArray[np.float32]
    camera: Camera
    map_T_camera: NDArray[np.float64]
    boxes: NDArray[np.int32]
    names: list[str]
    clusters: list[NDArray[np.int64]]
    footprints: list[shapely.Polygon]
    visible_area: shapely.Polygon

    def frame(self) -> RgbdFrame:
        """Return the frame again, so that nothing of it is kept from run to run."""
        return RgbdFrame(0.0, self.depth, self.camera, self.map_T_camera)

    def detections(self) -> Detections:
        """Return its boxes as detections."""
        return Detections.of(self.boxes, self.names)


def load_scenes(golden: Path, desk: Path) -> list[Scene]:
    """Return the frames for which PCL's answers are recorded."""
    scenes = []
    with np.load(golden / "desk.npz") as recorded:
        for key in recorded["keys"].tolist():
            get: dict[str, Any] = {
                name.removeprefix(f"{key}/"): recorded[name]
                for name in recorded.files
                if name.startswith(f"{key}/")
            }
            step = int(get["stride"])
            raw = np.asarray(Image.open(desk / str(get["depth_file"])))[::step, ::step]
            depth = np.where(raw > 0, raw / np.float32(5000), np.float32(np.nan))
            fx, fy, cx, cy = get["K"].tolist()
            boxes = range(len(get["boxes"]))
            scenes.append(
                Scene(
                    key,
                    depth.astype(np.float32),
                    Camera.from_intrinsics(fx, fy, cx, cy, depth.shape[1], depth.shape[0]),
                    get["map_T_camera"],
                    get["boxes"].astype(np.int32),
                    get["names"].tolist(),
                    [get[f"{j}/largest_cluster"].astype(np.int64) for j in boxes],
                    [shapely.Polygon(get[f"{j}/footprint"]) for j in boxes],
                    shapely.Polygon(get["visible_area"]),
                )
            )
    return scenes


def iou(a: Any, b: Any) -> float:
    """Return the intersection over union of two shapes."""
    return float(a.intersection(b).area / a.union(b).area)


def pixel_iou(a: NDArray[np.int64], b: NDArray[np.int64]) -> float:
    """Return the intersection over union of two sets of pixels, each without repetitions."""
    both = len(np.intersect1d(a, b))
    return both / (len(a) + len(b) - both)
