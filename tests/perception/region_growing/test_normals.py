from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.projection import rows_of
from hypermap.perception.region_growing.normals import (
    TOO_FEW,
    TOO_MANY,
    UNREACHED2,
    fit_planes,
    planes_through,
)
from hypermap.perception.region_growing.padded import MARGIN, planes_of
from hypermap.perception.region_growing.smooth_windows import fit_smooth
from hypermap.perception.region_growing.unorganised import normals_of

CAMERA = Camera.from_intrinsics(60, 60, 19.5, 14.5, 40, 30)
WIDE = Camera.from_intrinsics(60, 60, 49.5, 14.5, 100, 30)
FOCAL = 60.0, 60.0
K = 50


def cloud_of(depth: NDArray[np.floating], camera: Camera = CAMERA) -> NDArray[np.float32]:
    return RgbdFrame(0.0, depth.astype(np.float32), camera, np.eye(4)).points()


def tilted_plane(
    normal: tuple[float, float, float], camera: Camera = CAMERA
) -> NDArray[np.float32]:
    """Return the cloud of a plane two meters in front of the camera."""
    rays = cloud_of(np.ones((camera.height, camera.width)), camera).astype(float)
    return cloud_of(2.0 * normal[2] / (rays @ np.array(normal)), camera)


def rough_cloud(seed: int, holes: float = 0.0) -> NDArray[np.float32]:
    """Return a bumpy surface with a step, noise and pixels without a point."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:30, :40]
    depth = 1.5 + 0.1 * np.sin(u / 5) + 0.05 * np.cos(v / 4) + 0.8 * (u > 22)
    depth += rng.normal(0, 0.003, depth.shape)
    depth[rng.random(depth.shape) < holes] = np.nan
    return cloud_of(depth)


def padded(
    points: NDArray[np.float32], valid: NDArray[np.bool_], camera: Camera = CAMERA
) -> NDArray[np.float32]:
    frame = RgbdFrame(0.0, points[..., 2], camera, np.eye(4), cloud=points)
    return planes_of(rows_of(frame.depth, frame.camera.K, frame.cloud), valid, 0, 0, *valid.shape)


def fit_all(
    points: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return normals (N, 3), curvatures and squared radii of all valid pixels, row-major."""
    valid = np.isfinite(points[..., 2])
    planes = padded(points, valid)
    wanted = np.pad(valid, MARGIN)
    normals, curvatures, radii2 = fit_planes(planes, wanted, K, FOCAL)
    return normals[:, wanted].T, curvatures[wanted], radii2[wanted]


@settings(deadline=None, max_examples=30)  # the first example compiles
@given(st.tuples(st.floats(-1, 1), st.floats(-1, 1)))
def test_the_normals_of_a_plane_are_its_normal_everywhere(slope: tuple[float, float]) -> None:
    normal = np.array([*slope, 1.0]) / np.linalg.norm([*slope, 1.0])
    points = tilted_plane(tuple(normal))
    for normals, curvatures in (
        fit_all(points)[:2],
        normals_of(points.reshape(-1, 3), points.reshape(-1, 3), K),
    ):
        np.testing.assert_allclose(np.abs(normals @ normal), 1, atol=1e-5)
        np.testing.assert_allclose(curvatures, 0, atol=1e-3)  # depth is not quite affine


@pytest.mark.parametrize("k", [5, 841])  # about the smallest and largest windows
def test_the_windows_of_a_plane_are_as_large_as_k(k: int) -> None:
    normal = np.array([0.3, 0.2, 1.0]) / np.linalg.norm([0.3, 0.2, 1.0])
    points = tilted_plane(tuple(normal), WIDE)  # more than pixels are processed at a time
    valid = np.isfinite(points[..., 2])
    planes, wanted = padded(points, valid, WIDE), np.pad(valid, MARGIN)
    half = round((np.sqrt(k) - 1) / 2)
    fx, fy = np.float32(FOCAL)
    normals, _, _, rough = fit_smooth(planes, wanted, np.float32(k), (0,) * half, fx, fy)
    is_smooth = wanted.copy()
    is_smooth.ravel()[rough] = False
    # All but those whose windows reach past the image.
    np.testing.assert_array_equal(is_smooth, np.pad(valid[half:-half, half:-half], MARGIN + half))
    np.testing.assert_allclose(np.abs(normals[:, is_smooth].T @ normal), 1, atol=1e-5)


@pytest.mark.parametrize("holes", [0.0, 0.4, 0.9])
def test_about_k_points_lie_within_the_radius_of_each(holes: float) -> None:
    points = rough_cloud(seed=1, holes=holes)
    cloud = points[np.isfinite(points[..., 2])].astype(float)
    distances2 = ((cloud[:, np.newaxis] - cloud) ** 2).sum(axis=2)
    counts = (distances2 <= fit_all(points)[2][:, np.newaxis]).sum(axis=1)
    assert TOO_FEW * K <= np.median(counts) <= TOO_MANY * K
    # Half of the pixels have the radius of the one to their left.
    assert np.mean((counts >= 0.8 * K) & (counts <= 1.25 * K)) > 0.9
    assert counts.min() >= 0.5 * K
    assert counts.max() <= 2 * K


@pytest.mark.parametrize("holes", [0.0, 0.4])
def test_the_fast_normals_are_about_those_of_the_reference(holes: float) -> None:
    points = rough_cloud(seed=2, holes=holes)
    cloud = points[np.isfinite(points[..., 2])]
    normals, curvatures, _ = fit_all(points)
    expected_normals, expected_curvatures = normals_of(cloud, cloud, K)
    angles = np.degrees(
        np.arccos(np.clip(np.abs(np.sum(normals * expected_normals, axis=1)), 0, 1))
    )
    assert np.median(angles) < 1  # as the reference's own with 45 neighbors
    assert np.percentile(angles, 95) < 10  # half of what two points that join may differ by
    assert np.median(np.abs(curvatures - expected_curvatures)) < 0.001


@settings(deadline=None, max_examples=200)
@given(st.lists(st.floats(-1, 1, width=32), min_size=9, max_size=9))
def test_the_plane_of_a_covariance_is_its_smallest_eigenvector(numbers: list[float]) -> None:
    root = np.array(numbers).reshape(3, 3)
    m = root @ root.T
    variances, axes = np.linalg.eigh(m)
    (normal,), (curvature,) = plane_of(m)
    if variances[2] < 1e-6:
        return
    assert curvature == pytest.approx(variances[0] / variances.sum(), abs=0.01)
    if variances[1] - variances[0] > 0.1 * variances[2]:
        assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-3)
        assert abs(normal @ axes[:, 0]) == pytest.approx(1, abs=1e-3)


def plane_of(m: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    entries = [m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]]
    normals, curvatures = planes_through(np.array(entries, np.float32)[:, np.newaxis])
    return normals.T, curvatures


@pytest.mark.parametrize(
    ("variances", "normal", "curvature"),
    [
        ((0.0, 0.0, 0.0), (0, 0, 0), 0),  # one point
        ((1.0, 0.0, 0.0), (0, 0, 0), 0),  # a line
        ((1.0, 2.0, 0.0), (0, 0, 1), 0),  # the x-y plane
        ((0.0, 1.0, 1.0), (1, 0, 0), 0),  # the y-z plane
        ((4.0, 4.0, 1.0), (0, 0, 1), 1 / 9),
    ],
)
def test_points_that_are_no_plane_have_no_normal(
    variances: tuple[float, ...], normal: tuple[float, ...], curvature: float
) -> None:
    (found,), (found_curvature,) = plane_of(np.diag(variances))
    assert np.abs(found) == pytest.approx(normal, abs=1e-4)
    assert found_curvature == pytest.approx(curvature, abs=1e-4)


def test_fewer_points_than_neighbours_are_all_neighbours() -> None:
    depth = np.full((30, 40), np.nan)
    depth[3, [4, 5, 6]] = 1.0
    depth[5, 5] = 1.0
    normals, curvatures, _ = fit_all(cloud_of(depth))
    np.testing.assert_allclose(np.abs(normals), [[0, 0, 1]] * 4, atol=1e-4)
    np.testing.assert_allclose(curvatures, 0, atol=1e-6)
    cloud = cloud_of(depth)[np.isfinite(depth)]
    np.testing.assert_allclose(np.abs(normals_of(cloud, cloud, K)[0]), [[0, 0, 1]] * 4, atol=1e-6)


def test_points_far_apart_have_the_plane_of_those_around() -> None:
    depth = np.full((30, 40), np.nan)
    depth[::6, ::6] = 2.0
    normals, curvatures, radii2 = fit_all(cloud_of(depth))
    np.testing.assert_allclose(np.abs(normals), [[0, 0, 1]] * len(normals), atol=1e-3)
    np.testing.assert_allclose(curvatures, 0, atol=1e-6)
    assert radii2.max() <= UNREACHED2  # no place without a point is among the neighbors
