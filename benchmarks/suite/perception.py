"""One frame's perception without the network, against PCL in C++ and against Open3D.

The frames are real ones of a Kinect, with the boxes of a real detector. PCL does the steps of the
profile `thesis`: normals from the 50 nearest points of the whole cloud, region growing in each box,
a grid of 1 cm, convex hulls, and the hull of the whole cloud.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.perception.config import PerceptionConfig
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe
from hypermap.perception.segmentation import segment, valid_pixels
from suite import against_open3d
from suite.programs import build, run
from suite.race import Disagreement, Race, Row, Settings, each_of, seconds_of
from suite.scenes import ORGANISED, SIZES, UNORGANISED, Scene, iou, load_scenes, pixel_iou

PCL = tuple(
    f"pcl_{module}" for module in ("features", "segmentation", "filters", "surface", "search")
)
ASKED = {240: 60.0, 480: 100.0}  # ratios, by the height of the frames
SAME = 0.999  # the IoU from which on two answers are the same
ROUNDS = 3  # through the frames of a size, which are timed together
MEAN, MEDIAN = 0.95, 0.998  # least IoU of footprints of the fast method: PCL's with k = 45 or 55


@dataclass(frozen=True, eq=False)
class PclAnswer:
    """What our program with PCL says of a scene: seconds, and the shapes."""

    seconds: float
    clusters: list[NDArray[np.int64]]
    footprints: list[shapely.Polygon]
    visible_area: shapely.Polygon


def rows(settings: Settings) -> Iterator[Row]:
    """Yield a frame's perception by each method, and what Open3D can do of it."""
    yield from each_of(
        settings, {"perception, PCL": _against_pcl, "perception, Open3D": against_open3d.races}
    )


def _against_pcl(settings: Settings) -> Iterator[Row]:
    program = build("pcl/region_growing.cpp", PCL, settings, for_this_machine=False)
    scenes = load_scenes(settings.folder("pcl_golden"), settings.folder("desk"))
    answers, peer = {}, ""
    for scene in scenes:
        answers[scene.key], version = ask_pcl(program, scene, settings)
        peer = f"PCL {version} (C++)"
        check_pcl(scene, answers[scene.key])

    fast = agreement(scenes, answers, ORGANISED)
    if np.mean(fast) < MEAN or np.median(fast) < MEDIAN:
        raise Disagreement(f"organised: footprints agree too little with PCL's: {said_of(fast)}")
    reference = agreement(scenes, answers, UNORGANISED, least_cluster=SAME)
    if min(reference) < SAME:
        raise Disagreement(f"unorganised: a footprint is not PCL's: {said_of(reference)}")
    other = agreement(scenes, answers, PerceptionConfig(), has_visible_area=False)

    methods = (
        ("profile thesis", ORGANISED, ROUNDS, fast),
        ("profile default", PerceptionConfig(), ROUNDS, other),
        ("method unorganised", UNORGANISED, 1, reference),
    )
    for height, size in SIZES.items():
        some = [scene for scene in scenes if scene.depth.shape[0] == height]
        theirs: list[float] = []
        ours: dict[str, list[float]] = {name: [] for name, *_ in methods}
        for _ in range(settings.repeat):  # in turns: the machine is not always equally fast
            seconds = [ask_pcl(program, scene, settings)[0].seconds for scene in some]
            theirs.append(float(np.mean(seconds)))
            for name, config, rounds, _ in methods:
                ours[name].append(seconds_of_frame(some * rounds, config))
        for name, config, _, ious in methods:
            work = f"a frame of {size}, {name}"
            wanted = ASKED[height] if config is ORGANISED else None
            yield Race(work, peer, tuple(ours[name]), tuple(theirs), said_of(ious), wanted)


# In C++


def ask_pcl(program: Path, scene: Scene, settings: Settings) -> tuple[PclAnswer, str]:
    """Return the program's answer to a scene, and the version of PCL."""
    path = settings.build / "frames" / f"{scene.key}.bin"
    path.parent.mkdir(parents=True, exist_ok=True)
    shape = np.array([*scene.depth.shape, len(scene.boxes)], "<i4")
    parts = (
        shape,
        scene.frame().points().astype("<f4"),
        scene.map_T_camera.astype("<f8"),
        scene.boxes.astype("<i4"),
    )
    path.write_bytes(b"".join(part.tobytes() for part in parts))
    printed = run(program, path, 2)  # the first time it is cold
    answer = PclAnswer(
        printed["seconds"][-1],
        [np.sort(np.array(found["pixels"], np.int64)) for found in printed["objects"]],
        [shapely.Polygon(found["footprint"]) for found in printed["objects"]],
        shapely.Polygon(printed["visible_area"]),
    )
    return answer, printed["version"]


def check_pcl(scene: Scene, answer: PclAnswer) -> None:
    """Compare the program's answer with the recorded ones.

    Raises:
        Disagreement: If the program does not do what was done for these.
    """
    ious = [iou(answer.visible_area, scene.visible_area)]
    ious += map(pixel_iou, answer.clusters, scene.clusters)
    ious += map(iou, answer.footprints, scene.footprints)
    if min(ious) < SAME:
        raise Disagreement(f"{scene.key}: PCL itself differs from its recorded answers: {ious}")


# Ours


def seconds_of_frame(scenes: Sequence[Scene], config: PerceptionConfig) -> float:
    """Return the mean seconds that a frame takes, when they come one after the other."""
    frames = [(scene.frame(), scene.detections()) for scene in scenes]

    def look() -> list[Observation]:
        return [observe(frame, detections, config) for frame, detections in frames]

    return seconds_of(look)[0] / len(frames)


def agreement(
    scenes: Sequence[Scene],
    answers: dict[str, PclAnswer],
    config: PerceptionConfig,
    least_cluster: float = 0.0,
    has_visible_area: bool = True,
) -> list[float]:
    """Return the IoU of the footprint in each box with PCL's; 0 where we find no object.

    Raises:
        Disagreement: If the visible area is another one, or the pixels of a cluster.
    """
    ious = []
    for scene in scenes:
        frame, detections, pcl = scene.frame(), scene.detections(), answers[scene.key]
        area = observe(frame, detections[[]], config).visible_area
        if has_visible_area and iou(area, pcl.visible_area) < SAME:
            raise Disagreement(f"{scene.key}: the visible area is not PCL's")
        valid = valid_pixels(frame, config)
        found = segment(frame, valid, detections, config)
        pixels = {part.detection: part.pixels for part in found}
        for box, (cluster, footprint) in enumerate(zip(pcl.clusters, pcl.footprints, strict=True)):
            if pixel_iou(pixels.get(box, np.empty(0, np.int64)), cluster) < least_cluster:
                raise Disagreement(f"{scene.key}, box {box}: the pixels are not PCL's")
            seen = observe(frame, detections[[box]], config).objects
            ious.append(iou(seen[0].footprint, footprint) if seen else 0.0)
    return ious


def said_of(ious: Sequence[float]) -> str:
    """Return the IoUs in words."""
    mean, median = np.mean(ious), np.median(ious)
    return f"footprints of {len(ious)} boxes: mean IoU {mean:.4f}, median {median:.4f}"
