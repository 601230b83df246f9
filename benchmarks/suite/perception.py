"""One frame's perception without the network, against PCL in C++ and against Open3D.

The frames are real ones of a Kinect, with the boxes of a real detector. PCL does the steps of the
profile `thesis`: normals from the 50 nearest points of the whole cloud, region growing in each box,
a grid of 1 cm, convex hulls, and the hull of the whole cloud.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image

from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.normals import fit_planes
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe
from hypermap.perception.padded import MARGIN, planes_of
from hypermap.perception.projection import rows_of
from hypermap.perception.segmentation import segment, valid_pixels
from suite.programs import build, run
from suite.race import (
    Disagreement,
    Race,
    Row,
    Settings,
    each_of,
    library,
    race,
    seconds_of,
)

PCL = tuple(
    f"pcl_{module}" for module in ("features", "segmentation", "filters", "surface", "search")
)
ORGANISED = PerceptionConfig(method="organised", visible_step=1, max_depth=np.inf)
SIZES = {240: ("320 x 240", 60.0), 480: ("640 x 480", 100.0)}  # and the ratio asked
SAME = 0.999  # the IoU from which on two answers are the same
ROUNDS = 3  # through the frames of a size, which are timed together
MEAN, MEDIAN = 0.95, 0.998  # least IoU of footprints of the fast method: PCL's with k = 45 or 55


@dataclass(frozen=True, eq=False)
class Scene:
    """A real frame with its boxes, and PCL's recorded answers.

    Attributes:
        key: its name in the recorded answers.
        depth: metres, shape (H, W).
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
        """Return the frame anew, so that nothing of it is kept from run to run."""
        return RgbdFrame(0.0, self.depth, self.camera, self.map_T_camera)

    def detections(self) -> Detections:
        """Return its boxes as detections."""
        return Detections.of(self.boxes, self.names)


@dataclass(frozen=True, eq=False)
class PclAnswer:
    """What our program with PCL says of a scene: seconds, and the shapes."""

    seconds: float
    clusters: list[NDArray[np.int64]]
    footprints: list[shapely.Polygon]
    visible_area: shapely.Polygon


def rows(settings: Settings) -> Iterator[Row]:
    """Yield a frame's perception by each method, and what Open3D can do of it."""
    yield from each_of(settings, {"perception, PCL": _against_pcl, "perception, Open3D": _open3d})


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
    reference = agreement(scenes, answers, PerceptionConfig.thesis(), least_cluster=SAME)
    if min(reference) < SAME:
        raise Disagreement(f"unorganised: a footprint is not PCL's: {said_of(reference)}")
    other = agreement(scenes, answers, PerceptionConfig(), has_visible_area=False)

    methods = (
        ("method organised", ORGANISED, ROUNDS, fast),
        ("profile default", PerceptionConfig(), ROUNDS, other),
        ("profile thesis", PerceptionConfig.thesis(), 1, reference),
    )
    for height, (size, asked) in SIZES.items():
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
            wanted = asked if config is ORGANISED else None
            yield Race(work, peer, tuple(ours[name]), tuple(theirs), said_of(ious), wanted)


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


def iou(a: Any, b: Any) -> float:
    """Return the intersection over union of two shapes."""
    return float(a.intersection(b).area / a.union(b).area)


def pixel_iou(a: NDArray[np.int64], b: NDArray[np.int64]) -> float:
    """Return the intersection over union of two sets of pixels, each without repetitions."""
    both = len(np.intersect1d(a, b))
    return both / (len(a) + len(b) - both)


# Open3D


def _open3d(settings: Settings) -> Iterator[Row]:
    """Yield the normals of a whole cloud.

    Open3D has no region growing; its clusters look at distances only, so a table and what stands on
    it are one, and there is no answer to compare. Neither are its normals on a real frame the right
    ones: a camera's noise turns them by degrees, and other ones with other neighbours. So a made-up
    frame with such noise says whose are nearer to the true ones.
    """
    o3d = library("open3d")
    knn = o3d.geometry.KDTreeSearchParamKNN(50)

    def cloud_of(points: NDArray[np.float32]) -> Any:
        return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(float)))

    def theirs(cloud: Any) -> NDArray[np.float64]:
        cloud.estimate_normals(knn, fast_normal_computation=True)
        return np.asarray(cloud.normals)

    scenes = load_scenes(settings.folder("pcl_golden"), settings.folder("desk"))
    for height, (size, _) in SIZES.items():
        scene = next(scene for scene in scenes if scene.depth.shape[0] == height)
        made_up, true_normals = noisy_desk(scene.camera)
        valid = np.isfinite(made_up.depth)
        off = [
            angles(normals, true_normals[valid])
            for normals in (
                all_normals(made_up, valid),
                theirs(cloud_of(made_up.points()[valid])),
            )
        ]
        frame = scene.frame()
        points, valid = frame.points(), np.isfinite(frame.depth)
        yield race(
            f"normals of all points of a frame of {size}",
            f"Open3D {o3d.__version__} (C++)",
            partial(all_normals, frame, valid),
            partial(theirs, cloud_of(points[valid])),
            partial(as_near, *off),
            settings,
        )


def noisy_desk(camera: Camera) -> tuple[RgbdFrame, NDArray[np.float64]]:
    """Return a frame of a desk, a wall, a slanted board and three balls, and its true normals.

    The noise is a Kinect's, in disparity and quantised there, and one pixel of a hundred is lost.
    """
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[: camera.height, : camera.width]
    K = camera.K
    rays = np.stack(
        [(columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1], np.ones(rows.shape)], axis=-1
    )
    depth, normals = np.full(rows.shape, np.inf), np.zeros(rays.shape)

    def put(distance: NDArray[np.float64], of: NDArray[np.float64]) -> None:
        nearest = (distance > 0) & (distance < depth)
        depth[nearest] = distance[nearest]
        normals[nearest] = np.broadcast_to(of, normals.shape)[nearest]

    for normal, offset in (((0, 0.8, 0.6), 0.55), ((0.2, 0.3, -1), -2.2), ((1, -0.2, 0.35), 1.6)):
        direction = np.array(normal) / np.linalg.norm(normal)
        put(offset / (rays @ direction), direction)
    for center, radius in (
        ((0.1, 0.05, 0.8), 0.1),
        ((-0.25, 0.1, 1.0), 0.15),
        ((0.4, -0.1, 1.4), 0.25),
    ):
        squares, along = np.sum(rays**2, axis=-1), rays @ center
        root = along**2 - squares * (np.dot(center, center) - radius**2)
        distance = np.where(root > 0, (along - np.sqrt(np.maximum(root, 0))) / squares, np.inf)
        hit = rays * np.where(root > 0, distance, 0)[..., np.newaxis]
        put(distance, (hit - center) / radius)
    disparity = np.round((1 / depth + rng.normal(0, 0.0008, depth.shape)) / 0.0029) * 0.0029
    disparity[rng.random(depth.shape) < 0.01] = np.nan
    return RgbdFrame(0.0, (1 / disparity).astype(np.float32), camera, np.eye(4)), normals


def all_normals(frame: RgbdFrame, valid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the normals of all points of a frame, shape (N, 3)."""
    planes = planes_of(rows_of(frame), valid, 0, 0, *valid.shape)
    K = frame.camera.K
    normals, *_ = fit_planes(planes, np.pad(valid, MARGIN), 50, (K[0, 0], K[1, 1]))
    inner = normals[:, MARGIN:-MARGIN, MARGIN:-MARGIN]
    return inner[:, valid].T.astype(float)


def angles(normals: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angle between each two unit normals, whatever their sign [degrees]."""
    cosines = np.abs(np.sum(normals * others, axis=1))
    found: NDArray[np.float64] = np.degrees(np.arccos(np.clip(cosines, 0, 1)))
    return found


def as_near(
    ours_off: NDArray[np.float64],
    theirs_off: NDArray[np.float64],
    ours: NDArray[np.float64],
    theirs: NDArray[np.float64],
) -> str:
    """Return how far both are from the true normals, and ours from theirs on the real frame.

    Raises:
        Disagreement: If ours are farther from the true ones than theirs by more than a tenth.
    """
    percents = [50, 90, 95]
    own, peer = np.percentile(ours_off, percents), np.percentile(theirs_off, percents)
    middle, most = np.percentile(angles(ours, theirs), [50, 90])
    said = (
        f"off the true normals of a made-up frame, half, 90 % and 95 % of them by at most "
        f"{own[0]:.2f}, {own[1]:.2f}, {own[2]:.2f} degrees, Open3D's by "
        f"{peer[0]:.2f}, {peer[1]:.2f}, {peer[2]:.2f}; "
        f"on the real frame half differ by at most {middle:.1f}, 90 % by {most:.1f}"
    )
    if (own > 1.1 * peer).any():
        raise Disagreement(said)
    return said
