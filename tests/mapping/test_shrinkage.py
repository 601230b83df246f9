"""Which share of corrections is made."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.mapping.shrinkage import Shrinkage


def shares(sizes: list[float], expected: float = 3.0) -> list[float]:
    shrinkage = Shrinkage()
    return [shrinkage.share_of(size, expected) for size in sizes]


def of_errors(true: float, count: int = 200) -> list[float]:
    """Sizes of corrections of values that are off by `true` standard deviations."""
    rng = np.random.default_rng(0)
    values = true * rng.normal(size=(count, 3)) + rng.normal(size=(count, 3))
    return [float(size) for size in np.sum(values**2, axis=1)]


def test_corrections_like_errors_are_hardly_made() -> None:
    assert np.mean(shares(of_errors(0))) < 0.02


@pytest.mark.parametrize("true", [2.0, 3.0, 5.0])
def test_larger_corrections_are_made_nearly_as_far_as_they_are_right(true: float) -> None:
    """The best share is that of the variance of the true errors in all."""
    best = true**2 / (1 + true**2)
    assert best - 0.1 < np.mean(shares(of_errors(true))) < best + 0.05


@given(st.lists(st.tuples(st.floats(0, 1e9), st.floats(0, 3)), min_size=1, max_size=50))
def test_a_share_is_one(sizes: list[tuple[float, float]]) -> None:
    shrinkage = Shrinkage()
    for size, expected in sizes:
        assert 0 <= shrinkage.share_of(size, expected) <= 1


def test_the_newest_corrections_count() -> None:
    found = shares([3.0] * 100 + [60.0] * 60 + [3.0] * 100)
    assert found[99] == 0
    assert found[159] > 0.9
    assert found[259] == 0
