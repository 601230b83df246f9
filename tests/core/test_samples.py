from __future__ import annotations

import numpy as np
import pytest

from hypermap.core.samples import Samples

NAN = np.nan


def heard() -> Samples:
    return Samples.of([[0, 0], [1, 0], [2, 0]], [-60, -97, -90], [False, False, True])


def test_what_is_below_a_limit_was_not_heard():
    censored = heard().censored(-95)
    assert censored.values.tolist() == [-60, -95, -90]
    assert censored.is_below.tolist() == [False, True, True]
    assert heard().censored(-80).values.tolist() == [-60, -80, -80]


def test_samples_are_joined_and_chosen():
    both = heard().joined(Samples.of([[5, 5]], [1], stamps=[7.5]))
    assert both.values.tolist() == [-60, -97, -90, 1]
    np.testing.assert_array_equal(both.stamps, [NAN, NAN, NAN, 7.5])
    assert both.chosen(both.points_xy[:, 0] == 5).values.tolist() == [1]


@pytest.mark.parametrize(
    ("values", "others", "said"),
    [
        ([1.0, NAN], {}, r"values\[1\] is not finite"),
        ([1.0], {}, r"values must have shape \(2,\)"),
        ([1.0, 2.0], {"stamps": [1.0, np.inf]}, r"stamps\[1\] is not finite"),
        ([1.0, 2.0], {"is_below": [True]}, r"is_below must have shape \(2,\)"),
    ],
)
def test_samples_are_checked(values, others, said):
    with pytest.raises(ValueError, match=said):
        Samples.of([[0, 0], [1, 1]], values, **others)
