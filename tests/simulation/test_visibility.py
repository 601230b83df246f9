"""What is nearest and what is in the shadow, against every ray with every triangle."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.trajectory import invert
from hypermap.simulation.meshes import box
from hypermap.simulation.visibility import Shadows, nearest_triangles

K = np.array([[30.0, 0.0, 19.6], [0.0, 31.0, 14.3], [0.0, 0.0, 1.0]])
HEIGHT, WIDTH = 30, 40
SEEDS = st.integers(0, 2**32 - 1)


def hits(triangles: np.ndarray, start: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return at what multiple of each direction each triangle is met, infinite for never, (N, T).

    Each is the solution of start + t d = (1 - a - b) p0 + a p1 + b p2.
    """
    p0, p1, p2 = np.moveaxis(triangles.astype(np.float64), 1, 0)
    matrix = np.empty((len(directions), len(triangles), 3, 3))
    matrix[..., 0] = -directions[:, np.newaxis]
    matrix[..., 1], matrix[..., 2] = p1 - p0, p2 - p0
    right = np.broadcast_to((start - p0)[..., np.newaxis], (*matrix.shape[:2], 3, 1))
    t, a, b = np.moveaxis(np.linalg.solve(matrix, right)[..., 0], -1, 0)
    return np.where((a >= 0) & (b >= 0) & (a + b <= 1) & (t > 0), t, np.inf)


def turned(rng: np.random.Generator) -> np.ndarray:
    """Return a camera's pose near the origin, turned at random."""
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.linalg.det(rotation)
    pose[:3, 3] = rng.normal(size=3)
    return pose


@given(seed=SEEDS, size=st.sampled_from([0.2, 1.0, 5.0]))
def test_the_nearest_triangle_is_found_on_every_ray_also_where_some_reach_behind_the_camera(
    seed: int, size: float
) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(12, 1, 3), scale=3) + rng.normal(size=(12, 3, 3), scale=size)
    triangles, pose = corners.astype(np.float32), turned(rng)
    depths, found = nearest_triangles(triangles, K @ invert(pose)[:3], HEIGHT, WIDTH)
    v, u = np.divmod(np.arange(HEIGHT * WIDTH), WIDTH)
    rays = np.linalg.solve(K, np.stack([u, v, np.ones_like(u)])).T @ pose[:3, :3].T
    every = hits(triangles, pose[:3, 3], rays)
    expected = every.min(axis=1)
    agrees = np.isclose(depths.ravel(), expected, rtol=1e-6)
    agrees &= found.ravel() == np.where(np.isinf(expected), -1, every.argmin(axis=1))
    assert (~agrees).sum() <= 1  # a ray may pass within a rounding error of an edge


def test_triangles_that_share_an_edge_leave_no_gap() -> None:
    rng = np.random.default_rng(5)
    vertices, faces = box((2.0, 3.0, 2.5))
    triangles = vertices[faces].astype(np.float32)
    for _ in range(40):
        pose = turned(rng)
        pose[:3, 3] *= 0.2  # inside
        depths, found = nearest_triangles(triangles, K @ invert(pose)[:3], HEIGHT, WIDTH)
        assert np.isfinite(depths).all()
        assert (found >= 0).all()


def test_what_lies_behind_the_camera_or_is_seen_from_its_edge_is_not_there() -> None:
    behind = [[-1, -1, -2], [3, -1, -2], [-1, 3, -2]]
    edge_on = [[0, 0, 1], [0, 0, 2], [0, 0, 3]]
    triangles = np.array([behind, edge_on], dtype=np.float32)
    projection = K @ np.eye(4)[:3]
    depths, found = nearest_triangles(triangles, projection, HEIGHT, WIDTH)
    assert np.isinf(depths).all()
    assert (found == -1).all()


@given(seed=SEEDS, reach=st.sampled_from([1.0, 4.0, 8.0]))
def test_shadows_fall_where_something_stands_before_the_lamp(seed: int, reach: float) -> None:
    rng = np.random.default_rng(seed)
    centers = rng.uniform((-5, -5, 0), (5, 5, reach), size=(15, 1, 3))  # the lamp hangs at 6 m
    triangles = (centers + rng.normal(size=(15, 3, 3))).astype(np.float32)
    lamp = np.array([0.3, -0.2, 6.0], dtype=np.float32)
    points = rng.uniform((-8, -8, -1), (8, 8, reach), size=(300, 3)).astype(np.float32)
    directions = points.astype(np.float64) - lamp
    expected = (hits(triangles, lamp.astype(np.float64), directions) < 1).any(axis=1)
    assert (Shadows.of(triangles, lamp).cover(points) != expected).sum() <= 1


@pytest.mark.parametrize("triangles", [np.empty((0, 3, 3)), np.zeros((2, 3, 3))])
def test_nothing_and_triangles_without_an_area_cast_no_shadow(triangles: np.ndarray) -> None:
    shadows = Shadows.of(triangles.astype(np.float32), np.array([0, 0, 6], dtype=np.float32))
    points = np.array(list(itertools.product((-1, 0, 1), repeat=3)), dtype=np.float32)
    assert not shadows.cover(points).any()
