"""The errors of localization, clocks and mounting."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hypermap.simulation.pose_noise import PoseNoise


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


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


def test_a_camera_is_mounted_wrong_by_as_much_as_asked() -> None:
    noise = PoseNoise(mounting_deg=0.5, mounting=0.01)
    errors = [noise.mounting_error(rng(seed)) for seed in range(20)]
    for error in errors:
        angle = math.acos((np.trace(error[:3, :3]) - 1) / 2)
        assert math.degrees(angle) == pytest.approx(0.5, rel=1e-6)
        assert np.linalg.norm(error[:3, 3]) == pytest.approx(0.01)
    assert np.std([error[0, 3] for error in errors]) > 0.003  # in another direction each time


def test_odometry_is_off_by_its_shares_after_ten_meters_and_a_turn() -> None:
    way = np.column_stack([np.linspace(0, 10, 101), np.zeros((101, 2))])
    turn = np.column_stack([np.zeros((101, 2)), np.linspace(0, math.tau, 101)])
    noise = PoseNoise(odometry=0.01, odometry_yaw_deg=0.1, odometry_turn=0.02)
    ends = np.array([noise.estimate(np.arange(101.0), way, rng(seed))[-1] for seed in range(800)])
    assert ends[:, 0].std() == pytest.approx(0.1, rel=0.08)
    assert np.degrees(ends[:, 2].std()) == pytest.approx(1, rel=0.08)
    turned = [noise.estimate(np.arange(101.0), turn, rng(seed))[-1, 2] for seed in range(800)]
    assert np.std(turned) == pytest.approx(0.02 * math.tau, rel=0.08)


def test_odometry_starts_exactly_and_its_errors_add_up() -> None:
    there_and_back = np.zeros((401, 3))
    there_and_back[:, 0] = np.concatenate([np.linspace(0, 20, 201), np.linspace(20, 0, 201)[1:]])
    noise = PoseNoise(odometry=0.01, odometry_yaw_deg=0.1)
    made = [noise.estimate(np.arange(401.0), there_and_back, rng(seed)) for seed in range(200)]
    errors = np.array(made) - there_and_back
    assert (errors[:, 0] == 0).all()
    assert errors[:, 400, 2].std() > 1.2 * errors[:, 200, 2].std()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PoseNoise(yaw_deg=-1), "yaw_deg must be a number of at least 0, got -1"),
        (lambda: PoseNoise(odometry=-1), "odometry must be a number of at least 0, got -1"),
        (lambda: PoseNoise(mounting=-1), "mounting must be a number of at least 0, got -1"),
        (lambda: PoseNoise(time_offset=math.inf), "time_offset must be a number of seconds"),
    ],
)
def test_noise_out_of_range_is_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
