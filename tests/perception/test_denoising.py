"""Smoothing takes noise from points and keeps edges and rays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.perception import denoising
from hypermap.perception.config import PerceptionConfig

HEIGHT, WIDTH = 40, 60
NOISE = PerceptionConfig().depth_noise
ALL = np.arange(HEIGHT * WIDTH)


def cloud(z: NDArray[np.float64]) -> NDArray[np.float32]:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    rays = np.stack([(u - 30) / 262.5, (v - 20) / 262.5, np.ones(u.shape)], axis=-1)
    return (rays * z[..., np.newaxis]).astype(np.float32)


def smoothed(
    points: NDArray[np.float32], pixels: IntArray, config: PerceptionConfig
) -> NDArray[np.float32]:
    return denoising.smoothed(points.reshape(-1, 3)[pixels], pixels, WIDTH, config)


def noisy(z: NDArray[np.float64]) -> NDArray[np.float64]:
    return z + np.random.default_rng(3).normal(0, NOISE / 2, z.shape) * z**2


@pytest.mark.parametrize("depth", [1.0, 4.0])
def test_a_far_wall_becomes_as_thin_as_a_near_one(depth: float) -> None:
    z = np.full((HEIGHT, WIDTH), depth)
    points = cloud(noisy(z))
    after = smoothed(points, ALL, PerceptionConfig())
    assert np.std(after[:, 2]) < 0.3 * np.std(points[..., 2])
    assert after[:, 2].mean() == pytest.approx(depth, abs=0.1 * NOISE * depth**2)


def test_a_slanted_surface_keeps_its_place_and_its_ends() -> None:
    disparity = np.broadcast_to(np.linspace(0.5, 0.6, WIDTH), (HEIGHT, WIDTH))
    points = cloud(1 / disparity)
    after = smoothed(points, ALL, PerceptionConfig())
    before = points.reshape(-1, 3)
    pixel = 0.1 / WIDTH * (1 / 0.5) ** 2  # in depth, from one column to the next
    assert np.abs(after[:, 2] - before[:, 2]).max() < 1.1 * pixel


def test_a_jump_in_depth_stays_where_it_is() -> None:
    z = np.full((HEIGHT, WIDTH), 1.0)
    z[:, 30:] = 1.2
    after = smoothed(cloud(noisy(z)), ALL, PerceptionConfig()).reshape(HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(after[..., 2], z, atol=NOISE * 1.2**2)


def test_points_move_along_their_rays() -> None:
    points = cloud(noisy(np.full((HEIGHT, WIDTH), 3.0)))
    after = smoothed(points, ALL, PerceptionConfig())
    before = points.reshape(-1, 3)
    np.testing.assert_allclose(
        after[:, :2] / after[:, 2:], before[:, :2] / before[:, 2:], atol=1e-6
    )


def test_what_is_not_of_the_object_takes_no_part() -> None:
    z = np.full((HEIGHT, WIDTH), 2.0)
    z[:, ::2] = 2.01  # every other column is something else, by less than the noise
    odd = ALL[ALL % WIDTH % 2 == 1]
    np.testing.assert_allclose(smoothed(cloud(z), odd, PerceptionConfig())[:, 2], 2.0, atol=1e-6)


def test_no_smoothing_leaves_the_points_as_they_are() -> None:
    points = cloud(noisy(np.full((HEIGHT, WIDTH), 3.0)))
    after = smoothed(points, ALL, PerceptionConfig(smoothing=0))
    np.testing.assert_array_equal(after, points.reshape(-1, 3))
