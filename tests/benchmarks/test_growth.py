"""Exponents, what is asked of them, and that the names next to lines keep apart."""

from __future__ import annotations

import numpy as np
import pytest

SIZES = (1, 10, 100, 1000, 10_000)


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 2.0])
def test_the_exponent_is_that_of_the_largest_three_sizes(power: float) -> None:
    from suite.growth import exponent

    amounts = [9.0, 7.0, *(3 * size**power for size in SIZES[2:])]
    assert exponent(SIZES, amounts) == power


@pytest.mark.parametrize(
    ("sizes", "amounts"),
    [((1, 2), (1.0,)), ((1,), (1.0,)), ((2, 1), (1.0, 1.0)), ((1, 2), (0.0, 1.0))],
)
def test_no_law_follows_from_unfit_numbers(sizes, amounts) -> None:
    from suite.growth import exponent

    with pytest.raises(ValueError, match=r"do not go with|must ascend"):
        exponent(sizes, amounts)


@pytest.mark.parametrize(
    ("law", "is_reached"),
    [
        (lambda n: n, True),
        (lambda n: n * np.log(n + 1), True),
        (lambda n: n**1.25, False),
        (lambda n: n**2, False),
    ],
)
def test_what_grows_faster_than_n_log_n_is_a_defect(law, is_reached: bool) -> None:
    from suite.race import Growth
    from suite.report import has_reached

    amounts, line = tuple(map(law, SIZES)), tuple(map(float, SIZES))
    assert has_reached(Growth("time", "evidence", SIZES, amounts)) is is_reached
    assert has_reached(Growth("memory", "evidence", SIZES, line, amounts)) is is_reached


def test_names_keep_apart_in_order_and_near_their_lines() -> None:
    from suite.plots import _spread

    wanted = np.array([200.0, 10.0, 11.0, 9.0, 100.0])
    heights = _spread(wanted, 20)
    assert np.diff(np.sort(heights)).min() == pytest.approx(20)
    assert np.argsort(heights).tolist() == [3, 1, 2, 4, 0]
    assert heights[[3, 1, 2]] == pytest.approx([-10, 10, 30])
    assert heights[[4, 0]] == pytest.approx([100, 200])
