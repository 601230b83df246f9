"""The errors of the camera and of localization, against the published models."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hypermap.simulation.noise import (
    EXACT_DEPTH,
    DepthNoise,
    PoseNoise,
    axial_sigma,
    quantized,
)
from hypermap.simulation.render import Rendering

SHAPE = (120, 160)


def plane(depth: float, incidence_deg: float = 0.0) -> Rendering:
    """A wall that fills the image."""
    return Rendering(
        depth=np.full(SHAPE, depth, dtype=np.float32),
        color=np.zeros((*SHAPE, 3), dtype=np.uint8),
        instances=np.full(SHAPE, -1, dtype=np.int32),
        incidence=np.full(SHAPE, math.radians(incidence_deg), dtype=np.float32),
    )


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize(
    ("z", "theta_deg", "sigma"),
    [
        # Nguyen et al. 2012, eq. 2: 0.0012 + 0.0019 (z - 0.4)^2.
        (0.4, 0, 0.0012),
        (1.0, 30, 0.001884),
        (3.0, 0, 0.014044),
        # eq. 3 adds 0.0001 / sqrt(z) * theta^2 / (pi/2 - theta)^2; at 72 degrees the fraction is
        # (72 / 18)^2 = 16.
        (1.0, 72, 0.001884 + 0.0016),
        (4.0, 72, 0.025824 + 0.0008),
    ],
)
def test_axial_noise_follows_the_published_model(z: float, theta_deg: float, sigma: float) -> None:
    theta = np.array([math.radians(theta_deg)])
    assert axial_sigma(np.array([z]), theta)[0] == pytest.approx(sigma, abs=1e-9)


def test_measured_depth_scatters_as_the_model_says() -> None:
    measured = DepthNoise(disparity_step=0).measure(plane(3.0), rng())
    assert measured.mean() == pytest.approx(3.0, abs=1e-3)
    assert measured.std() == pytest.approx(0.014044, rel=0.03)


@pytest.mark.parametrize(("z", "step"), [(1.0, 0.0029), (2.0, 0.0115), (5.0, 0.072)])
def test_steps_of_depth_grow_with_its_square(z: float, step: float) -> None:
    # Khoshelham and Elberink 2012: about 2.85e-3 z^2 [m]: 7 cm at 5 m.
    depths = np.unique(quantized(np.linspace(z, z * 1.2, 20_000, dtype=np.float32), 1 / 8))
    assert np.diff(depths)[0] == pytest.approx(step, rel=0.12)


def test_quantising_twice_changes_nothing_more() -> None:
    once = quantized(np.linspace(0.5, 8, 1000, dtype=np.float32), 1 / 8)
    assert quantized(once, 1 / 8) == pytest.approx(once, rel=1e-6)


def test_an_exact_camera_measures_the_truth_within_its_range() -> None:
    view = plane(2.0)
    view.depth[0, :4] = [np.nan, 0.3, 8.5, 7.9]
    measured = EXACT_DEPTH.measure(view, rng())
    assert np.isnan(measured[0, :3]).all()
    assert measured[0, 3] == np.float32(7.9)
    assert (measured[1:] == 2.0).all()


def test_returns_are_missing_on_both_sides_of_an_edge_and_nowhere_else() -> None:
    view = plane(3.0)
    view.depth[:, 80:] = 1.0
    lost = np.isnan(DepthNoise(axial=0, disparity_step=0, edge_loss=1).measure(view, rng()))
    assert np.nonzero(lost.any(axis=0))[0].tolist() == [79, 80]
    assert lost[:, 79:81].all()
    half = np.isnan(DepthNoise(axial=0, disparity_step=0, edge_loss=0.5).measure(view, rng()))
    assert half.sum() == pytest.approx(SHAPE[0], rel=0.25)


def test_a_slanted_surface_is_no_edge() -> None:
    view = plane(1.0)
    view.depth[:] = np.linspace(1.0, 3.0, SHAPE[1], dtype=np.float32)
    assert not np.isnan(DepthNoise(edge_loss=1).measure(view, rng())).any()


@pytest.mark.parametrize(("incidence_deg", "is_seen"), [(80, True), (84, False)])
def test_surfaces_seen_at_a_grazing_angle_give_no_return(
    incidence_deg: float, is_seen: bool
) -> None:
    measured = DepthNoise().measure(plane(2.0, incidence_deg), rng())
    assert (~np.isnan(measured)).all() if is_seen else np.isnan(measured).all()


def test_the_truth_is_left_as_it_was_and_a_seed_repeats_the_measurement() -> None:
    view = plane(2.0)
    first, second = (DepthNoise().measure(view, rng(1)) for _ in range(2))
    assert (view.depth == 2.0).all()
    assert np.array_equal(first, second, equal_nan=True)
    assert not np.array_equal(first, DepthNoise().measure(view, rng(2)), equal_nan=True)


def test_poses_are_exact_unless_asked_otherwise() -> None:
    poses = np.arange(12.0).reshape(4, 3)
    assert (PoseNoise().estimate(np.arange(4.0), poses, rng()) == poses).all()


def test_pose_noise_has_the_deviations_asked_for() -> None:
    errors = pose_errors(PoseNoise(position=0.05, yaw_deg=2), 20_000)
    assert errors.std(axis=0) == pytest.approx([0.05, 0.05, math.radians(2)], rel=0.03)


def pose_errors(noise: PoseNoise, count: int, interval: float = 0.1) -> np.ndarray:
    return noise.estimate(np.arange(count) * interval, np.zeros((count, 3)), rng())


def test_drift_has_its_deviation_and_changes_slowly() -> None:
    errors = pose_errors(PoseNoise(drift=0.1, drift_yaw_deg=3, drift_time=5), 400_000)
    assert errors.std(axis=0) == pytest.approx([0.1, 0.1, math.radians(3)], rel=0.05)
    later = [np.corrcoef(errors[:-lag, 0], errors[lag:, 0])[0, 1] for lag in (1, 50, 200)]
    assert later == pytest.approx([math.exp(-lag / 50) for lag in (1, 50, 200)], abs=0.05)


def test_jumps_come_as_often_as_asked_and_nothing_else_jumps() -> None:
    noise = PoseNoise(drift=0.1, drift_time=1000, jump_interval=10)
    steps = np.abs(np.diff(pose_errors(noise, 100_000)[:, 0]))
    assert np.mean(steps > 0.01) == pytest.approx(0.01, rel=0.1)  # 0.1 s of every 10 s
    assert (
        np.abs(np.diff(pose_errors(PoseNoise(drift=0.1, drift_time=1000), 100_000)[:, 0])) < 0.01
    ).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: DepthNoise(axial=-1), "axial must be a number of at least 0, got -1"),
        (lambda: DepthNoise(edge_loss=math.nan), "edge_loss must be a number of at least 0"),
        (lambda: DepthNoise(min_range=9), "min_range must be below max_range"),
        (lambda: PoseNoise(yaw_deg=-1), "yaw_deg must be a number of at least 0, got -1"),
    ],
)
def test_noise_out_of_range_is_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
