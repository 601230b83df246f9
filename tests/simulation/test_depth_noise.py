"""The errors of depth cameras, against the published models."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.simulation.depth_noise import (
    EXACT_DEPTH,
    DepthNoise,
    axial_sigma,
    quantized,
    stereo_sigma,
    tof_sigma,
)
from hypermap.simulation.render import Rendering
from hypermap.simulation.sensors import SENSORS, sensor_of

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


@pytest.mark.parametrize(
    ("z", "theta_deg", "sigma"),
    [
        # Fankhauser et al. 2015, in millimeters: 1.5 - 0.5 z + 0.3 z^2 + 0.1 z^(3/2) times
        # theta^2 / (pi/2 - theta)^2, which is 16 at 72 degrees.
        (1.0, 0, 0.0013),
        (4.0, 0, 0.0043),
        (4.0, 72, 0.0043 + 0.0128),
    ],
)
def test_time_of_flight_follows_the_published_model(
    z: float, theta_deg: float, sigma: float
) -> None:
    theta = np.array([math.radians(theta_deg)])
    assert tof_sigma(np.array([z]), theta)[0] == pytest.approx(sigma, abs=1e-9)


def test_stereo_follows_the_published_model() -> None:
    # 3 m, 0.08 pixels, 424 pixels, 50 mm: 9 * 0.08 / 21.2.
    assert stereo_sigma(np.array([3.0]), 424 * 0.05)[0] == pytest.approx(0.03396, abs=1e-5)
    measured = replace(SENSORS["realsense_d435"], disparity_step=0).measure(plane(3.0), rng())
    assert measured.std() == pytest.approx(0.03396, rel=0.03)


def test_correlated_noise_is_as_strong_and_alike_among_neighbors() -> None:
    noise = DepthNoise(disparity_step=0, correlated=0.6)
    errors = (noise.measure(plane(3.0), rng()) - 3.0) / 0.014044
    assert errors.std() == pytest.approx(1, rel=0.1)
    assert np.mean(errors[:, 1:] * errors[:, :-1]) == pytest.approx(
        0.6 * math.exp(-1 / 16), abs=0.1
    )
    assert abs(np.mean(errors[:, 20:] * errors[:, :-20])) < 0.1


def test_flying_pixels_lie_between_two_surfaces_and_nowhere_else() -> None:
    view = plane(3.0)
    view.depth[:, 80:] = 1.0
    noise = DepthNoise(axial=0, disparity_step=0, edge_loss=0, flying=0.5)
    measured = noise.measure(view, rng())
    flies = (measured > 1.001) & (measured < 2.999)
    assert np.nonzero(flies.any(axis=0))[0].tolist() == [79, 80]
    assert flies[:, 79:81].mean() == pytest.approx(0.5, abs=0.1)
    assert measured[flies].mean() == pytest.approx(2.0, abs=0.15)
    assert (measured[~flies] == view.depth[~flies]).all()


def test_what_flies_before_nothing_has_no_depth() -> None:
    view = plane(3.0)
    view.depth[:, 80:] = np.nan
    noise = DepthNoise(axial=0, disparity_step=0, edge_loss=0, flying=1)
    measured = noise.measure(view, rng())
    assert np.isnan(measured[:, 80:]).all()
    assert (measured[:, :79] == 3.0).all()


def test_a_wrong_scale_makes_all_depths_too_large() -> None:
    noise = DepthNoise(axial=0, disparity_step=0, edge_loss=0, scale=0.02)
    assert noise.measure(plane(2.0), rng()) == pytest.approx(2.04)


def test_dark_things_lose_their_depth_in_patches_and_others_keep_it() -> None:
    view = plane(2.0)
    view.instances[:60] = 0
    view.instances[60:] = 1
    noise = DepthNoise(axial=0, disparity_step=0, edge_loss=0, dark_surfaces=0.5, dark_loss=0.8)
    lost = np.isnan(noise.measure(view, rng(), np.array([True, False])))
    assert lost[:60].mean() == pytest.approx(0.8, abs=0.1)
    assert not lost[60:].any()
    alone = lost[1:59, 1:-1] & ~(lost[:58, 1:-1] | lost[2:60, 1:-1])
    assert alone.sum() < 0.02 * lost.sum()  # patches, not single pixels
    # One world in two has such things, and people who walk are none of them.
    assert noise.draw_dark(2000, rng()).mean() == pytest.approx(0.5, abs=0.05)
    view.instances[:] = 2
    assert not np.isnan(noise.measure(view, rng(), np.array([True, True]))).any()


def test_a_share_of_the_image_is_missing() -> None:
    noise = DepthNoise(axial=0, disparity_step=0, edge_loss=0, missing=0.2)
    lost = [np.isnan(noise.measure(plane(2.0), rng(seed))).mean() for seed in range(10)]
    assert np.mean(lost) == pytest.approx(0.2, abs=0.03)


def test_a_preset_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(HypermapError, match=r"no preset of a depth camera 'kinect1'; did you mean"):
        sensor_of("kinect1")
    assert sensor_of("kinect_v1") == DepthNoise()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: DepthNoise(axial=-1), "axial must be a number of at least 0, got -1"),
        (lambda: DepthNoise(edge_loss=math.nan), "edge_loss must be a share from 0 to 1, got nan"),
        (lambda: DepthNoise(min_range=9), "min_range must be below max_range"),
        (lambda: DepthNoise(flying=1.5), "flying must be a share from 0 to 1, got 1.5"),
        (lambda: DepthNoise(scale=math.nan), "scale must be between -0.5 and 0.5, got nan"),
        (lambda: DepthNoise(focal_baseline=0), "focal_baseline and correlation_length must be"),
    ],
)
def test_noise_out_of_range_is_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
