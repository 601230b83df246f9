from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.perception.config import Method, PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.region_growing import organised, unorganised
from hypermap.perception.segmentation import segment, valid_pixels
from hypermap.perception.segments import Segment

HEIGHT, WIDTH = 60, 80
CAMERA = Camera.from_intrinsics(120, 120, 39.5, 29.5, WIDTH, HEIGHT)
METHODS: list[Method] = ["enclosed", "organised", "unorganised"]


def rough_depth(seed: int) -> NDArray[np.float32]:
    """Return a scene of ridges, a step and holes, without points at equal distances."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    depth = 1.5 + 0.06 * np.abs(u % 26 - 13) / 13 + 0.04 * np.sin(v / 6) + 0.5 * (u > 55)
    depth += rng.normal(0, 0.002, depth.shape)
    depth[rng.random(depth.shape) < 0.05] = np.nan
    depth[20:23] = np.nan
    return depth.astype(np.float32)


def frame_of(depth: NDArray[np.floating]) -> RgbdFrame:
    return RgbdFrame(0.0, depth.astype(np.float32), CAMERA, np.eye(4))


def segment_frame(
    frame: RgbdFrame, detections: Detections, config: PerceptionConfig
) -> list[Segment]:
    valid = valid_pixels(frame, config)
    return segment(frame, valid, detections, config)


def one_box(*xyxy: float) -> Detections:
    return Detections.of([xyxy], ["thing"])


@pytest.mark.parametrize("seed", range(3))
def test_both_methods_grow_about_the_same_regions(seed: int) -> None:
    frame = frame_of(rough_depth(seed))
    config = PerceptionConfig()
    valid = valid_pixels(frame, config)
    mask = np.zeros_like(valid)
    mask[5:50, 10:70] = True
    objects = [np.flatnonzero(mask & valid), np.flatnonzero(valid)]
    fast = organised.grow_regions(frame, valid, objects, config)
    reference = unorganised.grow_regions(frame.points(), valid, objects, config)
    for ours, theirs in zip(fast, reference, strict=True):
        for region, size in zip(*np.unique(theirs, return_counts=True), strict=True):
            if size < config.min_cluster:
                continue
            expected = theirs == region
            found = ours == np.bincount(ours[expected]).argmax()
            assert np.sum(found & expected) >= 0.95 * np.sum(found | expected)


@pytest.mark.parametrize("method", ["organised", "unorganised"])
@pytest.mark.parametrize(("curvature_threshold", "regions"), [(1.0, 1), (0.01, 2)])
def test_a_region_does_not_grow_on_from_bent_points(
    method: Method, curvature_threshold: float, regions: int
) -> None:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    frame = frame_of(1.5 + 0.006 * np.abs(u - 40) + 0.0005 * v)  # a roof, not very steep
    config = PerceptionConfig(method=method, curvature_threshold=curvature_threshold)
    valid = valid_pixels(frame, config)
    arguments = valid, [np.flatnonzero(valid)], config
    if method == "organised":
        (found,) = organised.grow_regions(frame, *arguments)
    else:
        (found,) = unorganised.grow_regions(frame.points(), *arguments)
    sizes = np.sort(np.unique(found, return_counts=True)[1])[::-1]
    assert np.count_nonzero(sizes > 0.3 * len(found)) == regions
    assert sizes[:regions].sum() > 0.9 * len(found)


def test_the_reference_grows_regions_as_pcl_does() -> None:
    frame = frame_of(rough_depth(7))
    config = PerceptionConfig(
        normal_neighbors=12, region_neighbors=8, smoothness_deg=12, curvature_threshold=0.02
    )
    valid = valid_pixels(frame, config)
    pixels = np.flatnonzero(valid)[500:1500]
    (region_of,) = unorganised.grow_regions(frame.points(), valid, [pixels], config)
    assert len(np.unique(region_of)) > 10  # else the test says nothing

    # Written down from the description of PCL's RegionGrowing, point by point.
    cloud = frame.points().reshape(-1, 3)
    normals, curvatures = unorganised.normals_of(cloud[valid.ravel()], cloud[pixels], 12)
    own = cloud[pixels].astype(float)
    expected = np.full(len(pixels), -1)
    for seed in np.argsort(curvatures, kind="stable"):
        if expected[seed] >= 0:
            continue
        expected[seed] = region = expected.max() + 1
        queue = deque([seed])
        while queue:
            point = queue.popleft()
            distances = np.linalg.norm(own - own[point], axis=1)
            for other in np.argsort(distances, kind="stable")[:8]:
                smooth = abs(normals[point] @ normals[other]) >= np.cos(np.radians(12))
                if expected[other] < 0 and smooth:
                    expected[other] = region
                    if curvatures[other] <= 0.02:
                        queue.append(other)
    np.testing.assert_array_equal(region_of, expected)


@pytest.mark.parametrize("method", METHODS)
def test_the_largest_smooth_region_of_a_box_is_its_object(method: Method) -> None:
    depth = np.full((HEIGHT, WIDTH), 2.0)
    depth[20:40, 30:60] = 1.5  # in front of a wall
    box = one_box(28, 18, 62, 42)
    (found,) = segment_frame(frame_of(depth), box, PerceptionConfig(method=method))
    rows, columns = np.divmod(found.pixels, WIDTH)
    # The normals at the very edge mix both depths.
    assert (rows.min(), rows.max()) == pytest.approx((20, 39), abs=2)
    assert (columns.min(), columns.max()) == pytest.approx((30, 59), abs=2)
    np.testing.assert_array_equal(found.points_xyz[:, 2], np.float32(1.5))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "box",
    [
        (-50, -20, -10, 500),
        (0, 0, 0, 60),
        (80, 0, 200, 60),
        (60, 50, 20, 10),
        (10, 10, 16, 16),
        (np.nan, 0, 80, 60),
        (0, 0, np.nan, np.nan),
        (np.inf, np.inf, np.inf, np.inf),
        (np.inf, np.inf, -np.inf, -np.inf),
    ],
    ids=str,
)
def test_a_box_without_enough_pixels_gives_nothing(
    method: Method, box: tuple[float, float, float, float]
) -> None:
    frame = frame_of(np.full((HEIGHT, WIDTH), 2.0))
    assert segment_frame(frame, one_box(*box), PerceptionConfig(method=method)) == []


@pytest.mark.parametrize(
    ("box", "pixels"),
    [
        ((10, 20, 30, 40), 20 * 20),
        ((9.2, 19.5, 29.1, 39.5), 20 * 20),  # holds the whole columns 10 .. 29
        ((-100, -100, 20, 20), 20 * 20),
        ((70, 50, 1e6, 1e6), 10 * 10),
        ((-np.inf, -np.inf, np.inf, np.inf), HEIGHT * WIDTH),
    ],
)
def test_a_box_holds_the_pixels_up_to_its_end_within_the_image(
    box: tuple[float, float, float, float], pixels: int
) -> None:
    frame = frame_of(np.full((HEIGHT, WIDTH), 2.0))
    (found,) = segment_frame(frame, one_box(*box), PerceptionConfig())
    assert len(found.pixels) == pixels


def test_a_mask_takes_the_place_of_its_box() -> None:
    frame = frame_of(np.full((HEIGHT, WIDTH), 2.0))
    mask = np.zeros((1, HEIGHT, WIDTH), dtype=bool)
    mask[0, 10:30, 5:25] = True
    detections = Detections.of([[0, 0, 80, 60]], ["thing"], masks=mask)
    (found,) = segment_frame(frame, detections, PerceptionConfig())
    np.testing.assert_array_equal(found.pixels, np.flatnonzero(mask))


def test_a_mask_of_another_size_is_refused() -> None:
    frame = frame_of(np.full((HEIGHT, WIDTH), 2.0))
    detections = Detections.of([[0, 0, 9, 9]], ["thing"], masks=np.ones((1, 30, 40), dtype=bool))
    with pytest.raises(ValueError) as error:
        segment_frame(frame, detections, PerceptionConfig())
    assert str(error.value) == "masks must have the image's shape (60, 80), got (30, 40)"


def test_segments_say_whose_they_are() -> None:
    frame = frame_of(np.full((HEIGHT, WIDTH), 2.0))
    boxes = [[0, 0, 3, 3], [0, 0, 20, 20], [90, 0, 99, 9], [40, 20, 70, 40]]
    detections = Detections.of(boxes, ["a", "b", "c", "d"])
    found = segment_frame(frame, detections, PerceptionConfig())
    assert [s.detection for s in found] == [1, 3]


def test_regions_that_are_too_large_or_too_small_are_no_objects() -> None:
    depth = np.full((HEIGHT, WIDTH), 2.0)
    depth[:, 60:] = 1.0
    whole = one_box(0, 0, WIDTH, HEIGHT)
    organised = PerceptionConfig(method="organised")
    largest = segment_frame(frame_of(depth), whole, organised)[0]
    second = segment_frame(frame_of(depth), whole, replace(organised, max_cluster=2000))[0]
    assert largest.points_xyz[0, 2] == 2.0
    assert second.points_xyz[0, 2] == 1.0
    for method in METHODS:
        none = PerceptionConfig(method=method, min_cluster=5000)
        assert segment_frame(frame_of(depth), whole, none) == []


def test_only_points_at_the_depths_of_the_configuration_take_part() -> None:
    depth = np.full((HEIGHT, WIDTH), np.nan)
    depth[0, :9] = [0.0, -1.0, np.inf, -np.inf, 1e5, 0.2, 0.3, 4.0, 4.1]
    frame = frame_of(depth)
    valid = valid_pixels(frame, PerceptionConfig(min_depth=0.25, max_depth=4.0))
    np.testing.assert_array_equal(np.flatnonzero(valid), [6, 7])
    everything = valid_pixels(frame, PerceptionConfig.thesis())
    np.testing.assert_array_equal(np.flatnonzero(everything), [5, 6, 7, 8])


def test_points_of_a_recorded_cloud_must_be_finite() -> None:
    points = frame_of(np.full((HEIGHT, WIDTH), 2.0)).points().copy()
    points[0, 0, 0] = np.nan
    points[0, 1, 1] = np.inf
    points[0, 2, 2] = np.nan
    frame = RgbdFrame(0.0, np.full((HEIGHT, WIDTH), 2, np.float32), CAMERA, np.eye(4), cloud=points)
    invalid = np.flatnonzero(~valid_pixels(frame, PerceptionConfig()))
    np.testing.assert_array_equal(invalid, [0, 1, 2])
