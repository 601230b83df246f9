"""A layer that grows while a robot drives is that of all its samples."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.values import value_layer_of
from hypermap.values.growing import GrowingLayer

FLOOR = OccupancyLayer("occupancy", "map", GridGeometry(80, 60, 0.1), np.zeros((60, 80), np.int8))


def along(count: int, first: int = 0) -> Samples:
    """Samples of a drive along x: the value is where it was taken."""
    numbers = np.arange(first, first + count)
    points = np.column_stack([1 + 0.1 * numbers, 2 + 0.3 * np.sin(numbers)])
    return Samples.of(points, points[:, 0], stamps=100.0 + numbers)


def grown(count: int = 10) -> GrowingLayer:
    layer = GrowingLayer("warmth", "map", "temperature", "°C")
    layer.add(along(count))
    layer.solve(FLOOR)
    return layer


def cells(layer: GrowingLayer) -> NDArray[np.float32]:
    made = layer.layer()
    assert made is not None
    assert made.cells is not None
    return made.cells


def test_it_is_the_layer_of_its_samples() -> None:
    layer = grown().layer()
    assert layer is not None
    expected = value_layer_of("warmth", along(10), FLOOR, quantity="temperature", unit="°C")
    assert layer.grid == expected.grid
    np.testing.assert_allclose(layer.cells, expected.cells, rtol=1e-5)
    np.testing.assert_array_equal(layer.stamps, expected.stamps)
    assert layer.made_by == expected.made_by
    assert (layer.quantity, layer.unit, layer.frame_id) == ("temperature", "°C", "map")


def test_too_few_samples_are_kept_without_values() -> None:
    layer = GrowingLayer("warmth", "map", "temperature", "°C")
    assert layer.layer() is None
    layer.add(along(4))
    assert not layer.is_due
    made = layer.layer()
    assert made is not None
    assert made.samples is not None
    assert len(made.samples) == 4
    assert np.isnan(cells(layer)).all()
    with pytest.raises(HypermapError, match="too few"):
        layer.solve(FLOOR)
    layer.add(along(1, first=4))
    assert layer.is_due


def test_a_sample_changes_the_field_at_once_and_counts_once() -> None:
    layer = grown()
    before, revision = cells(layer), layer.revision
    other = dataclasses.replace(along(1, first=10), values=np.array([9.0]))
    layer.add(other)
    layer.add(other)
    assert (len(layer), layer.revision) == (11, revision + 1)
    assert not layer.is_due
    assert np.nanmax(cells(layer)) > np.nanmax(before) + 1


def test_what_the_field_cannot_take_in_waits_for_it_and_is_kept() -> None:
    layer = grown()
    layer.add(along(1, first=45))  # off the grid
    assert layer.is_due
    made = layer.layer()
    assert made is not None
    assert made.samples is not None
    assert len(made.samples) == 11
    layer.solve(FLOOR)
    assert not layer.is_due
    last = layer.layer()
    assert last is not None
    assert last.value_at(along(1, first=45).points_xy)[0] == pytest.approx(5.5, abs=0.2)
    layer.add(along(9, first=10))
    assert layer.is_due  # twice as many samples: the settings are estimated anew


def test_moved_samples_make_another_field() -> None:
    layer = grown()
    shift = np.array([0.0, 1.0])
    layer.move(lambda old: dataclasses.replace(old, points_xy=old.points_xy + shift))
    assert layer.is_due
    layer.solve(FLOOR)
    made = layer.layer()
    assert made is not None
    assert made.samples is not None
    np.testing.assert_allclose(made.samples.points_xy, along(10).points_xy + shift)
    assert made.value_at([1.5, 3.0])[0] == pytest.approx(1.5, abs=0.2)


def test_samples_that_are_forgotten_while_the_field_is_solved_stay_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    layer = grown()
    walls = FLOOR.value_at

    def clear_amid(points: NDArray[np.float64]) -> NDArray[np.int64]:
        layer.clear()
        return walls(points)

    monkeypatch.setattr(FLOOR, "value_at", clear_amid)
    layer.solve(FLOOR)
    assert len(layer) == 0
    assert layer.layer() is None
    assert not layer.is_due


def test_samples_of_an_earlier_layer_count_and_are_nothing_new() -> None:
    layer = GrowingLayer("warmth", "map", "temperature", "°C", along(10))
    assert layer.is_due
    assert not layer.is_new
    assert layer.layer() is None  # the earlier layer is still right
    layer.add(along(11))  # a bag that is played again, and goes on
    assert (len(layer), layer.is_new) == (11, True)


@pytest.mark.parametrize(
    ("method", "half_life"), [("kernel", None), ("nearest", None), ("gmrf", 60.0)]
)
def test_layers_of_other_methods_and_with_a_half_life_are_continued(method, half_life):
    kept = along(20)
    layer = GrowingLayer("warmth", "map", "t", "°C", kept, method=method, half_life=half_life)
    layer.solve(FLOOR)
    layer.add(along(6, first=20))
    assert layer.is_due
    layer.solve(FLOOR)
    expected = value_layer_of("warmth", along(26), FLOOR, method=method, half_life=half_life)
    np.testing.assert_array_equal(cells(layer), expected.cells)
    made = layer.layer()
    assert made is not None
    assert made.made_by == expected.made_by
