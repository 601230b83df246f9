"""How well and how fast both segmentation methods reproduce PCL 1.13 on real frames.

Prints, for each box of the golden file, the IoU of the largest cluster's pixels and of its
footprint with PCL's; then the mean and median, and the time that each method takes for a frame.

    python benchmarks/pcl_agreement.py ../shared/data [--repeat 5]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from PIL import Image

from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.observe import observe
from hypermap.perception.segmentation import segment, valid_pixels

CONFIGS = {
    "reference": PerceptionConfig.thesis(),
    "fast": PerceptionConfig(method="organised", max_depth=np.inf),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder that holds desk/ and pcl_golden/")
    parser.add_argument("--repeat", type=int, default=3, help="runs per frame; the best counts")
    args = parser.parse_args()

    scores: dict[str, list[tuple[float, float]]] = {name: [] for name in CONFIGS}
    times: dict[str, dict[str, list[float]]] = {name: {} for name in CONFIGS}
    with np.load(args.data / "pcl_golden" / "desk.npz") as golden:
        print(f"{'frame':22}{'box':>4}  {'name':10}" + "".join(f"{n:>24}" for n in CONFIGS))
        print(f"{'':38}" + f"{'cluster':>14}{'shape':>10}" * len(CONFIGS))
        for key in golden["keys"].tolist():
            frame, detections = load(args.data, golden, key)
            rows = {}
            for name, config in CONFIGS.items():
                rows[name] = agreement(golden, key, frame, detections, config)
                scores[name] += rows[name]
                size = f"{frame.camera.width} x {frame.camera.height}"
                seconds = best_time(frame, detections, config, args.repeat)
                times[name].setdefault(size, []).append(seconds)
            for box, label in enumerate(detections.names):
                numbers = "".join(f"{rows[n][box][0]:14.5f}{rows[n][box][1]:10.5f}" for n in rows)
                print(f"{key:22}{box:4}  {label:10}{numbers}")
    for word, statistic in (("mean", np.mean), ("median", np.median), ("least", np.min)):
        numbers = "".join("{:14.5f}{:10.5f}".format(*statistic(scores[n], axis=0)) for n in scores)
        print(f"{word:38}{numbers}")
    for name, by_size in times.items():
        for size, seconds in by_size.items():
            listed = ", ".join(f"{1000 * s:.0f}" for s in seconds)
            print(f"{name}: ms per frame at {size}, boxes and visible area included: {listed}")


def load(data: Path, golden: Mapping[str, Any], key: str) -> tuple[RgbdFrame, Detections]:
    """Return a frame of the golden file with its boxes."""
    step = int(golden[f"{key}/stride"])
    raw = np.asarray(Image.open(data / "desk" / str(golden[f"{key}/depth_file"])))[::step, ::step]
    depth = np.where(raw > 0, raw / np.float32(5000), np.float32(np.nan)).astype(np.float32)
    height, width = depth.shape
    camera = Camera.from_intrinsics(*golden[f"{key}/K"], width=width, height=height)
    frame = RgbdFrame(0.0, depth, camera, golden[f"{key}/map_T_camera"])
    return frame, Detections.of(golden[f"{key}/boxes"], golden[f"{key}/names"].tolist())


def agreement(
    golden: Mapping[str, Any],
    key: str,
    frame: RgbdFrame,
    detections: Detections,
    config: PerceptionConfig,
) -> list[tuple[float, float]]:
    """Return the IoU of the cluster and of the footprint for each box; 0 where none was found."""
    valid = valid_pixels(frame, config)
    segments = segment(frame.points(), valid, frame.camera, detections, config)
    pixels = {s.detection: s.pixels for s in segments}
    ious = []
    for box in range(len(detections)):
        theirs = golden[f"{key}/{box}/largest_cluster"]
        ours = pixels.get(box, np.empty(0, int))
        cluster = len(np.intersect1d(ours, theirs)) / len(np.union1d(ours, theirs))
        seen = observe(frame, detections[[box]], config).objects
        shape = seen[0].footprint if seen else shapely.Polygon()
        pcl = shapely.Polygon(golden[f"{key}/{box}/footprint"])
        ious.append((cluster, shape.intersection(pcl).area / shape.union(pcl).area))
    return ious


def best_time(
    frame: RgbdFrame, detections: Detections, config: PerceptionConfig, repeat: int
) -> float:
    """Return the shortest time that a frame took [s]."""
    seconds = []
    for _ in range(repeat):
        start = time.perf_counter()
        observe(frame, detections, config)
        seconds.append(time.perf_counter() - start)
    return min(seconds)


if __name__ == "__main__":
    main()
