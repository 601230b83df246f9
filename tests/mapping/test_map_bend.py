"""A bent map is told from wandering localization by what recurs where the robot comes back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.mapping.map_bend import bend_of_map

PLACES = np.stack(np.meshgrid(np.arange(6), np.arange(5)), axis=-1).reshape(-1, 2) + 0.5
VISITS = 4
STAMPS = np.repeat(100.0 * np.arange(VISITS), len(PLACES)) + np.tile(np.arange(len(PLACES)), VISITS)
XY = np.tile(PLACES, (VISITS, 1))


def drawn(count: int, size: float, seed: int) -> NDArray[np.float64]:
    return size * np.random.default_rng(seed).normal(size=(count, 2))


@pytest.mark.parametrize("bend", [0.02, 0.05])
def test_what_recurs_at_each_place_is_the_bend_of_the_map(bend: float) -> None:
    recurring = np.tile(drawn(len(PLACES), bend, 1), (VISITS, 1))
    wandering = drawn(len(XY), 0.03, 2)
    assert 0.6 * bend < bend_of_map(STAMPS, XY, recurring + wandering) < 1.1 * bend


@pytest.mark.parametrize("seed", range(5))
def test_localization_that_wanders_is_no_bend_of_the_map(seed: int) -> None:
    by_visit = np.repeat(drawn(VISITS, 0.03, seed), len(PLACES), axis=0)
    assert bend_of_map(STAMPS, XY, by_visit + drawn(len(XY), 0.02, 9 + seed)) < 0.005


def test_a_map_that_lies_aside_as_a_whole_is_not_bent() -> None:
    assert bend_of_map(STAMPS, XY, np.full((len(XY), 2), 0.1)) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("count", [0, 1, len(PLACES)])
def test_nothing_is_known_of_places_seen_once(count: int) -> None:
    assert bend_of_map(STAMPS[:count], XY[:count], drawn(count, 0.05, 3)) == 0


def test_two_looks_do_not_say_how_sure_they_are() -> None:
    """Localization errs alike in a row of places, and by chance alike in both looks."""
    stamps = np.repeat([0.0, 30.0], len(PLACES)) + np.tile(np.arange(len(PLACES)) / 3, 2)
    xy, row = np.tile(PLACES, (2, 1)), len(PLACES) // 5
    for seed in range(5):
        wandering = np.repeat(drawn(10, 0.03, seed), row, axis=0)
        assert bend_of_map(stamps, xy, wandering) == 0
