"""From samples to values all over the floor: right, honest, and bounded by walls."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.values import FieldSettings, Interpolation, Samples, interpolate, interpolation

pytestmark = pytest.mark.xdist_group("interpolation")  # they share what takes long to make


@pytest.fixture(scope="module")
def two_rooms() -> OccupancyLayer:
    """8 x 4 m, with a wall across the middle at x = 4."""
    cells = np.zeros((40, 80), dtype=np.int8)
    cells[[0, -1], :] = 100
    cells[:, [0, -1, 39, 40]] = 100
    return OccupancyLayer("occupancy", "map", GridGeometry(80, 40, 0.1), cells)


def warm_and_cold(count: int = 60) -> Samples:
    random = np.random.default_rng(5)
    points = random.uniform([0.3, 0.3], [7.7, 3.7], size=(count, 2))
    warmth = np.where(points[:, 0] < 4, 24.0, 16.0) + 0.3 * points[:, 1]
    return Samples.of(points, warmth + random.normal(0, 0.2, count))


@pytest.fixture(scope="module")
def mapped(two_rooms: OccupancyLayer) -> Interpolation:
    return interpolate(warm_and_cold(), two_rooms)


def settings_of(result: Interpolation) -> FieldSettings:
    return FieldSettings(**result.settings)


def at(result, points):
    rows, cols = result.grid.cells_at(points).T
    return result.values[rows, cols]


def test_warmth_does_not_leak_through_a_wall(mapped):
    beside_the_wall = [[3.7, 2.0], [4.3, 2.0]]
    right = np.array([24.6, 16.6])
    without = interpolate(warm_and_cold())
    assert np.abs(at(mapped, beside_the_wall) - right).max() < 0.3
    assert np.abs(at(without, beside_the_wall) - right).max() > 1
    assert mapped.settings["through_walls"] == 0


@pytest.mark.parametrize("resolution", [0.3, 0.5])
def test_a_sample_counts_on_its_own_side_of_a_wall(two_rooms, resolution):
    # Samples 5 cm off the wall, in cells whose centers lie on its other side.
    points = [[x, y] for y in np.arange(0.3, 3.8, 0.1) for x in (3.85, 4.15)]
    warmth = [24.0, 16.0] * (len(points) // 2)
    settings = FieldSettings(length=2.0, deviation=4.0, noise=0.2)
    result = interpolate(
        Samples.of(points, warmth), two_rooms, settings=settings, resolution=resolution
    )
    np.testing.assert_allclose(at(result, [[3.4, 2.0], [4.6, 2.0]]), [24, 16], atol=0.5)


def test_values_are_where_the_floor_is_and_samples_say_something(two_rooms, mapped):
    centers = mapped.grid.centers(*np.nonzero(~np.isnan(mapped.values)))
    assert set(two_rooms.label_at(centers)) == {"Free"}
    assert not np.isnan(at(mapped, [[1.0, 2.0], [7.0, 2.0]])).any()

    left = warm_and_cold()
    left = left.chosen(left.points_xy[:, 0] < 4)
    one_room = interpolate(left, two_rooms, settings=settings_of(mapped))
    assert not np.isnan(at(one_room, [[1.0, 2.0]])).any()
    assert np.isnan(at(one_room, [[5.5, 2.0]])).all()


def test_deviations_are_honest():
    random = np.random.default_rng(8)
    points = random.uniform(0, 10, size=(240, 2))
    truth = 5 * np.sin(points[:, 0] / 2) + 3 * np.cos(points[:, 1] / 3)
    measured = truth + random.normal(0, 0.5, 240)
    result = interpolate(Samples.of(points[:120], measured[:120]))
    rows, cols = result.grid.cells_at(points[120:]).T
    errors = np.abs(measured[120:] - result.values[rows, cols])
    within = errors < 2 * np.hypot(result.deviations[rows, cols], result.noise)
    assert 0.9 < within.mean() <= 1
    assert result.noise == pytest.approx(0.5, rel=0.3)


def test_not_heard_is_information_but_not_believed_against_all_around():
    random = np.random.default_rng(2)
    x = random.uniform(0, 20, 80)
    points = np.column_stack([x, random.uniform(0, 2, 80)])
    level = -50 - 4 * x  # below -95 from x = 11.25 on
    measured = level + random.normal(0, 2, 80)
    below = measured < -95
    samples = Samples.of(points, np.where(below, -95, measured), below)
    result = interpolate(samples)
    far = at(result, [[15.0, 1.0], [19.0, 1.0]])
    assert (far < -95).all()

    deaf = np.zeros(80, dtype=bool)
    deaf[int(np.argmin(np.abs(x - 3)))] = True
    samples = Samples.of(points, np.where(below | deaf, -95, measured), below | deaf)
    (near,) = at(interpolate(samples, settings=settings_of(result)), [[3.0, 1.0]])
    assert near == pytest.approx(-62, abs=3)


@pytest.mark.parametrize("method", ["gmrf", "kernel"])
def test_a_field_that_is_the_same_all_over_is_so_everywhere(method):
    points = np.random.default_rng(1).uniform(0, 3, size=(9, 2))
    result = interpolate(Samples.of(points, np.full(9, 21.5)), method=method)
    known = ~np.isnan(result.values)
    assert known.any()
    np.testing.assert_allclose(result.values[known], 21.5)


def test_the_same_samples_give_the_same_values(two_rooms, mapped):
    again = interpolate(warm_and_cold(), two_rooms)
    np.testing.assert_array_equal(again.values, mapped.values)
    np.testing.assert_array_equal(again.deviations, mapped.deviations)


def test_settings_are_taken_as_given_even_for_one_sample():
    settings = FieldSettings(length=2.0, deviation=3.0, noise=0.1)
    result = interpolate(Samples.of([[1.0, 1.0]], [18.0]), settings=settings)
    (value,) = at(result, [[1.0, 1.0]])
    assert value == pytest.approx(18)


@pytest.mark.parametrize(
    ("count", "below", "said"),
    [
        (4, 0, "4 samples with a value are too few to estimate how the quantity varies"),
        (6, 6, "no sample of 6 has a value"),
        (6, 3, "3 samples with a value are too few"),
    ],
)
def test_too_few_samples_are_refused_with_a_remedy(count, below, said):
    points = np.random.default_rng(1).uniform(0, 3, size=(count, 2))
    with pytest.raises(HypermapError, match=said):
        interpolate(Samples.of(points, np.arange(count), np.arange(count) < below))


@pytest.mark.parametrize("method", ["gmrf", "kernel", "nearest"])
@pytest.mark.parametrize(
    ("places", "values", "said"),
    [
        ([1.0, 2e5], [1.0, 2.0], r"reach from \(1, 0\) to \(200000, 0\); are their places in"),
        ([1e12, 1e12], [1.0, 2.0], "are their places in meters"),
        ([-1.7e308, 1.7e308], [1.0, 2.0], "are their places in meters"),
        ([1.0, 2.0], [1.0, -1e308], "a sample has a value of 1e.308, too large"),
    ],
)
def test_absurd_samples_are_refused(method, places, values, said):
    points = np.column_stack([places * 3, np.zeros(6)])
    with pytest.raises(HypermapError, match=said):
        interpolate(Samples.of(points, values * 3), method=method)


@pytest.mark.parametrize("resolution", [0, -1, float("nan"), float("inf"), 1e9])
def test_what_is_no_side_of_a_cell_is_refused(resolution):
    with pytest.raises(HypermapError, match="resolution must be from"):
        interpolate(warm_and_cold(), resolution=resolution)


def test_a_resolution_that_is_too_fine_is_refused():
    with pytest.raises(HypermapError, match="take a coarser one"):
        interpolate(warm_and_cold(), resolution=0.005)


# Two surveys of WiFi signal strength; the figures of other methods are in their README.


def read_survey(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return places, (N, 2), and what is heard of each radio there, (N, R), with NaN for nothing.

    A radio counts as heard where at least half of the scans hear it; its value is their median.
    """
    scans: dict[tuple[float, float], list[list[float]]] = {}
    with path.open() as file:
        for x, y, *heard in list(csv.reader(file))[1:]:
            scans.setdefault((float(x), float(y)), []).append(
                [float(value) if value else np.nan for value in heard]
            )
    levels = []
    for there in scans.values():
        columns = np.array(there).T
        levels.append(
            [
                np.nanmedian(column) if np.isfinite(column).mean() >= 0.5 else np.nan
                for column in columns
            ]
        )
    return np.array(list(scans)), np.array(levels)


@pytest.mark.parametrize("site", ["corridor", "office"])
def test_real_surveys_are_predicted_as_well_as_by_a_gaussian_process(shared_data, site):
    folder = shared_data / "values"
    if not folder.is_dir():
        pytest.skip("the surveys of WiFi are not here")
    places, levels = read_survey(folder / f"{site}_train.csv")
    others, truth = read_survey(folder / f"{site}_test.csv")
    squares, within = [], []
    for radio in range(levels.shape[1]):
        below = np.isnan(levels[:, radio])
        samples = Samples.of(places, np.where(below, -95, levels[:, radio]), below)
        result = interpolate(samples)
        rows, cols = result.grid.cells_at(others).T
        errors = truth[:, radio] - result.values[rows, cols]
        heard = ~np.isnan(truth[:, radio])
        squares.append(np.mean(errors[heard] ** 2))
        spread = np.hypot(result.deviations[rows, cols], result.noise)
        within.extend(np.abs(errors[heard]) <= 2 * spread[heard])
    assert np.sqrt(np.mean(squares)) < 3.3  # dB
    assert 0.92 <= np.mean(within) <= 0.98


def test_limits_among_louder_samples_leave_the_field_within_what_was_measured():
    """A few samples that heard nothing where others did are misses, and must not tear it away."""
    random = np.random.default_rng(3)
    points = random.uniform([0, 0], [12, 4], size=(150, 2))
    level = -40 - 3 * points[:, 0] + random.normal(0, 2, len(points))
    is_below = level < -70
    is_below[[3, 40, 90]] = True  # missed
    values = np.where(is_below, -70.0, level)
    settings = FieldSettings(length=12.0, deviation=16.0, noise=2.3, through_walls=0.0)
    found = interpolate(Samples.of(points, values, is_below), settings=settings)
    known = found.values[np.isfinite(found.values)]
    assert known.min() > -85
    assert known.max() < -30


def test_cells_finer_than_the_field_are_on_their_own_side_of_a_wall(two_rooms, mapped):
    settings = settings_of(mapped)
    fine = interpolate(warm_and_cold(), two_rooms, settings=settings, resolution=0.02)
    assert fine.grid.width * fine.grid.height > 100_000
    places = np.array([[1.0, 1.0], [2.5, 2.0], [5.5, 2.0], [7.0, 3.0]])
    np.testing.assert_allclose(at(fine, places), at(mapped, places), atol=0.3)
    beside = at(fine, [[3.85, 2.0], [4.15, 2.0]])
    assert abs(beside[0] - beside[1]) > 3


def test_very_many_samples_are_taken_together_by_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """Means at one place say what all samples there say, also of the noise."""
    rng = np.random.default_rng(3)
    points = np.repeat(rng.uniform(0, 4, (200, 2)), 10, axis=0)
    values = 20 + np.sin(points[:, 0]) + rng.normal(0, 0.3, len(points))
    samples = Samples.of(points, values, stamps=np.arange(len(points)))
    alone = interpolate(samples, half_life=5000.0)
    monkeypatch.setattr(interpolation, "_MOST_APART", 1000)
    monkeypatch.setattr(interpolation, "_SAME_PLACE_AT_MOST", 1e-6)
    together = interpolate(samples, half_life=5000.0)
    np.testing.assert_allclose(together.values, alone.values, atol=1e-6)
    np.testing.assert_allclose(together.deviations, alone.deviations, atol=1e-6)
    assert together.noise == pytest.approx(alone.noise, rel=1e-6)
    monkeypatch.setattr(interpolation, "_SAME_PLACE_AT_MOST", 0.1)
    moved = points + rng.uniform(-0.02, 0.02, points.shape)
    near = interpolate(Samples.of(moved, values))
    assert near.noise == pytest.approx(0.3, rel=0.1)
