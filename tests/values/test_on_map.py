"""Samples that a map already has."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.core.samples import Samples
from hypermap.values.on_map import unlike

TIMES = 1_700_000_000 + np.array([0.1, 0.2, 0.3])


def measured(
    stamps: np.ndarray = TIMES, values: np.ndarray | None = None, x: float = 1.0
) -> Samples:
    """Return three samples in a row."""
    given = np.array([20.1, 20.2, 20.3]) if values is None else values
    points_xy = np.column_stack([x + np.arange(3) / 3, np.full(3, 2 / 7)])
    return Samples(points_xy, given, np.zeros(3, bool), stamps)


@pytest.mark.parametrize(
    ("samples", "new"),
    [
        (measured(), 0),
        (measured(TIMES + 2e-7), 0),  # as of ns in floating-point numbers
        (measured(values=measured().values + 273.15 - 273.15), 0),  # another unit, and back
        (measured(x=1.0 + 1e-9), 0),  # another frame, and back
        (measured(TIMES + 1e-3), 3),
        (measured(values=measured().values + 1e-3), 3),
        (measured(x=1.001), 3),
        (measured(np.full(3, np.nan)), 3),  # when is unknown
        (measured(TIMES[::-1].copy()), 2),  # only the middle one is the same
    ],
)
def test_a_sample_that_differs_only_by_rounding_is_known(samples: Samples, new: int) -> None:
    assert len(unlike(samples, measured())) == new


def test_samples_without_a_stamp_are_compared_with_nothing() -> None:
    assert len(unlike(measured(), measured(np.full(3, np.nan)))) == 3
