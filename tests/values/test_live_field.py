"""A field that takes in samples one by one, against one that is solved with all of them."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap import HypermapError
from hypermap.core.samples import Samples
from hypermap.testing import occupancy_from_text
from hypermap.values import FieldSettings, LiveField, interpolate

TWO_ROOMS = occupancy_from_text(
    "\n".join(["#" * 41, *["#" + "." * 19 + "#" + "." * 19 + "#"] * 20, "#" * 41])
)
SETTINGS = FieldSettings(length=8.0, deviation=3.0, noise=0.3, through_walls=0.03)


def some(count: int) -> Samples:
    random = np.random.default_rng(5)
    points = random.uniform([1.5, 1.5], [39.5, 20.5], (count, 2))
    on_floor = np.abs(points[:, 0] - 20.5) > 1
    values = 20 + 0.2 * points[:, 0] + random.normal(0, 0.3, count)
    return Samples.of(points, values, stamps=np.arange(count)).chosen(on_floor)


def added(known: Samples, rest: Samples, resolution: float) -> LiveField:
    field = LiveField(known, TWO_ROOMS, settings=SETTINGS, resolution=resolution)
    for point, value, stamp in zip(rest.points_xy.tolist(), rest.values, rest.stamps, strict=True):
        field.add((point[0], point[1]), float(value), stamp=float(stamp))
    return field


@pytest.mark.parametrize("resolution", [1.0, 0.07])  # a node each, and cells finer than the nodes
def test_samples_one_by_one_give_what_all_at_once_give(resolution: float) -> None:
    samples = some(60)
    first = np.arange(len(samples)) < 40
    # The grid is that of the first samples; so that both are the same, the outermost are there.
    first[[samples.points_xy[:, axis].argmin() for axis in (0, 1)]] = True
    first[[samples.points_xy[:, axis].argmax() for axis in (0, 1)]] = True
    field = added(samples.chosen(first), samples.chosen(~first), resolution)
    live = field.interpolation()
    whole = interpolate(samples, TWO_ROOMS, settings=SETTINGS, resolution=resolution)
    assert live.grid == whole.grid
    np.testing.assert_allclose(live.values, whole.values, atol=0.03)
    np.testing.assert_allclose(live.deviations, whole.deviations, atol=0.03)
    assert len(field.samples) == len(samples)


def test_all_is_solved_anew_after_many_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hypermap.values.live_field._MOST_UPDATES", 4)
    samples = some(60)
    first = np.arange(len(samples)) < len(samples) - 5
    live = added(samples.chosen(first), samples.chosen(~first), 1.0).interpolation()
    whole = interpolate(samples, TWO_ROOMS, settings=SETTINGS, resolution=1.0)
    if live.grid == whole.grid:
        np.testing.assert_allclose(live.values, whole.values, atol=0.03)
    assert np.isfinite(live.values).sum() > 300


def test_a_sample_changes_its_own_room_and_the_deviation_there() -> None:
    field = LiveField(some(60), TWO_ROOMS, settings=SETTINGS, resolution=1.0)
    before = field.interpolation()
    field.add((5.5, 10.5), 40.0)
    after = field.interpolation()
    row, col = before.grid.cells_at([[5.5, 10.5]])[0]
    other_row, other_col = before.grid.cells_at([[35.5, 10.5]])[0]
    assert after.values[row, col] > before.values[row, col] + 1
    assert after.deviations[row, col] < before.deviations[row, col]
    assert after.values[other_row, other_col] == pytest.approx(
        before.values[other_row, other_col], abs=0.05
    )


def test_a_limit_pulls_down_what_lies_above_it_alone() -> None:
    field = LiveField(some(60), TWO_ROOMS, settings=SETTINGS, resolution=1.0)
    before = field.interpolation()
    row, col = before.grid.cells_at([[5.5, 10.5]])[0]
    field.add((5.5, 10.5), 100.0, is_below=True)
    assert field.interpolation().values[row, col] == pytest.approx(
        before.values[row, col], abs=0.01
    )
    field.add((5.5, 10.5), float(before.values[row, col]) - 0.3, is_below=True)
    assert field.interpolation().values[row, col] < before.values[row, col] - 0.03


def test_a_sample_off_the_field_is_refused() -> None:
    field = LiveField(some(60), settings=SETTINGS, resolution=1.0)
    with pytest.raises(HypermapError, match="off the field"):
        field.add((900.0, 0.0), 20.0)


def test_old_samples_count_less_by_their_half_life() -> None:
    point = [[2.0, 2.0]] * 2
    changed = Samples.of(point, [20.0, 30.0], stamps=[0.0, 3600.0])
    wide = FieldSettings(length=8.0, deviation=30.0, noise=1.0)
    at = {
        life: float(
            np.nanmean(interpolate(changed, settings=wide, resolution=1.0, half_life=life).values)
        )
        for life in (None, 3600.0, 60.0)
    }
    assert at[None] == pytest.approx(25, abs=0.01)
    assert at[3600.0] == pytest.approx(20 + 10 / 1.5, abs=0.02)  # weights 1/2 and 1
    assert at[60.0] == pytest.approx(30, abs=0.01)
    found = interpolate(changed, settings=wide, half_life=60.0)
    assert found.settings["half_life"] == 60.0


def test_a_half_life_needs_stamps_and_the_random_field() -> None:
    unknown = Samples.of([[0, 0], [1, 1]], [20.0, 21.0])
    with pytest.raises(HypermapError, match="2 of 2 samples have no stamp"):
        interpolate(unknown, settings=SETTINGS, half_life=60.0)
    with pytest.raises(HypermapError, match="positive number of seconds"):
        interpolate(unknown, settings=SETTINGS, half_life=0.0)
    with pytest.raises(HypermapError, match="only the method gmrf"):
        interpolate(unknown, method="nearest", half_life=60.0)
