"""The signed-rank test against counting by hand, published values, and scipy."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import scipy  # its `stats` is imported when used, which takes half a second
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap.core.errors import HypermapError
from hypermap.evaluation.significance import effect_of, signed_rank


def p_by_counting(ranks: list[float], positive: list[bool]) -> float:
    """Return the share of all patterns of signs whose positive ranks sum up to as much."""
    observed = sum(itertools.compress(ranks, positive))
    sums = [
        sum(itertools.compress(ranks, signs))
        for signs in itertools.product([False, True], repeat=len(ranks))
    ]
    return sum(s >= observed for s in sums) / len(sums)


def mean_ranks(sizes: list[int]) -> list[float]:
    """Return each size's mean place among all of them, by looking for it."""
    ordered = sorted(sizes)
    first = {size: ordered.index(size) + 1 for size in sizes}
    return [first[size] + (sizes.count(size) - 1) / 2 for size in sizes]


@pytest.mark.parametrize(
    ("differences", "statistic", "p"),
    [
        # Of 2 ** n patterns of signs, those whose positive ranks sum up to the statistic or more.
        ([1], 1, 1 / 2),
        ([-1], 0, 1),
        ([1, 2, 3], 6, 1 / 8),
        ([-1, 2, 3], 5, 2 / 8),
        ([1, 2, 3, 4, 5], 15, 1 / 32),
        ([-1, 2, 3, 4, 5], 14, 2 / 32),
        ([1, 2, -3, 4, 5], 12, 5 / 32),  # 15, 14, 13 and twice 12
        ([2, 2, -2], 4, 4 / 8),  # ranks 2 2 2: two or three of the three signs
        ([-1, 1, 3], 4.5, 3 / 8),  # ranks 1.5 1.5 3: both with one of the others, and all
    ],
)
def test_small_samples_worked_out_by_hand(
    differences: list[float], statistic: float, p: float
) -> None:
    result = signed_rank(differences)
    assert (result.statistic, result.method, result.z) == (statistic, "exact", None)
    assert result.p == pytest.approx(p, abs=1e-15)


def test_the_mileage_example_of_the_documentation_of_signrank() -> None:
    # Six cars above 33 miles per gallon: published are 0.0156 exactly, and 0.0180 with z 2.0966.
    result = signed_rank([0.3, 1.3, 0.6, 1.5, 1.8, 1.0])
    assert (result.statistic, result.p) == (21, pytest.approx(0.0156, abs=5e-5))
    z = (21 - 6 * 7 / 4 - 0.5) / math.sqrt(6 * 7 * 13 / 24)
    assert z == pytest.approx(2.0966, abs=5e-5)


def test_the_normal_approximation_worked_out_by_hand() -> None:
    # 16 differences 1 .. 16, of which 1 and 2 are negative: 136 - 3 = 133, mean 68, variance 374.
    result = signed_rank([-1, -2, *range(3, 17)])
    assert (result.statistic, result.method) == (133, "normal")
    assert result.z == pytest.approx((133 - 68 - 0.5) / math.sqrt(374))
    assert result.p == pytest.approx(scipy.stats.norm.sf(result.z), rel=1e-12)


def test_ties_lessen_the_variance() -> None:
    # 20 equal differences, 15 above zero: ranks 10.5; the variance is
    # (20 * 21 * 41 - (20 ** 3 - 20) / 2) / 24 = 551.25, as that of 20 signs of 10.5 each.
    result = signed_rank([0.1] * 15 + [-0.1] * 5)
    assert result.statistic == 15 * 10.5
    assert 20 * 10.5**2 / 4 == 551.25
    assert result.z == pytest.approx((157.5 - 105 - 0.5) / math.sqrt(551.25))


def test_up_to_fifteen_differences_are_counted_and_more_only_if_asked() -> None:
    assert signed_rank(range(1, 16)).method == "exact"
    assert signed_rank(range(1, 17)).method == "normal"
    assert signed_rank([0.0, *range(1, 16)]).method == "exact"
    counted = signed_rank(range(1, 17), exact=True)
    assert (counted.method, counted.z, counted.p) == ("exact", None, 2.0**-16)


def test_zeros_are_dropped() -> None:
    with_zeros = signed_rank([0.0, 0.3, -0.1, 0.0, 0.2, 1e-10, -1e-10])
    without = signed_rank([0.3, -0.1, 0.2])
    assert (with_zeros.pairs, with_zeros.used) == (7, 3)
    assert (with_zeros.statistic, with_zeros.p) == (without.statistic, without.p)


def test_rounding_makes_no_difference_between_ties() -> None:
    rounded = [0.1 + 0.2, -0.3, 0.4 - 0.1, 0.8]
    assert len({abs(value) for value in rounded[:3]}) > 1
    assert signed_rank(rounded).statistic == 2 + 2 + 4
    assert signed_rank([0.3, -0.3 - 1e-8]).statistic == 1


@pytest.mark.parametrize("nothing", [[], [0.0], [0.0] * 30])
def test_without_differences_nothing_is_shown(nothing: list[float]) -> None:
    result = signed_rank(nothing)
    assert (result.pairs, result.used, result.statistic, result.p) == (len(nothing), 0, 0, 1)


@pytest.mark.parametrize(
    ("differences", "message"),
    [
        ([[1.0]], r"differences must have shape \(N,\), got \(1, 1\)"),
        ([1.0, math.nan], "differences must be finite"),
        ([math.inf], "differences must be finite"),
    ],
)
def test_what_is_no_sample_is_refused(differences: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        signed_rank(differences)


def test_a_thousand_pairs_are_counted_but_no_more() -> None:
    assert signed_rank(np.ones(1000), exact=True).p == pytest.approx(2.0**-1000)
    with pytest.raises(HypermapError, match="not computed for more than 1000 pairs, and there are"):
        signed_rank(np.ones(1001), exact=True)


sizes = st.integers(1, 6)
signs = st.booleans()


@given(st.lists(st.tuples(sizes, signs), min_size=1, max_size=10))
def test_the_exact_distribution_with_ties_agrees_with_counting_all_patterns(
    sample: list[tuple[int, bool]],
) -> None:
    positive = [sign for _, sign in sample]
    result = signed_rank([size / 10 if sign else -size / 10 for size, sign in sample])
    expected = p_by_counting(mean_ranks([size for size, _ in sample]), positive)
    assert result.p == pytest.approx(expected, abs=1e-12)


distinct = st.lists(st.integers(1, 1000), min_size=1, max_size=60, unique=True).flatmap(
    lambda xs: st.tuples(*(st.sampled_from([x / 7, -x / 7]) for x in xs))
)


@given(distinct)
def test_the_exact_distribution_agrees_with_scipy(sample: tuple[float, ...]) -> None:
    expected = scipy.stats.wilcoxon(sample, alternative="greater", method="exact").pvalue
    assert signed_rank(sample, exact=True).p == pytest.approx(expected, rel=1e-9)


@given(st.lists(st.integers(-9, 9).filter(bool), min_size=16, max_size=60))
def test_the_normal_approximation_agrees_with_scipy(sample: list[int]) -> None:
    expected = scipy.stats.wilcoxon(
        sample, alternative="greater", correction=True, method="asymptotic"
    )
    result = signed_rank(np.array(sample) / 8)
    assert result.p == pytest.approx(expected.pvalue, rel=1e-9)


@given(st.lists(st.integers(-9, 9), max_size=12))
def test_both_directions_together_are_sure(sample: list[int]) -> None:
    forth, back = signed_rank(sample), signed_rank([-x for x in sample])
    assert forth.p + back.p >= 1
    assert forth.statistic + back.statistic == pytest.approx(forth.used * (forth.used + 1) / 2)


def test_an_effect_has_a_mean_an_interval_and_a_correlation() -> None:
    # Ranks 1 .. 4, of which 2 belongs to the negative one: (8 - 2) / 10.
    effect = effect_of([0.1, -0.2, 0.3, 0.4])
    assert effect.pairs == 4
    assert effect.mean == pytest.approx(0.15)
    assert effect.rank_biserial == pytest.approx(0.6)
    assert effect_of([0.0, 0.0]).rank_biserial == 0.0
    # The interval of a mean of many normal deviates is known: 1.96 standard errors to each side.
    many = effect_of(np.random.default_rng(3).normal(1.0, 2.0, 400))
    half = 1.96 * 2.0 / 20
    assert [many.mean - many.low, many.high - many.mean] == pytest.approx([half, half], rel=0.1)


@settings(deadline=None, max_examples=20)
@given(st.lists(st.floats(-5, 5), min_size=1, max_size=30))
def test_the_interval_holds_the_mean_and_turns_with_the_signs(differences: list[float]) -> None:
    effect, turned = effect_of(differences), effect_of([-one for one in differences])
    assert effect == effect_of(differences)
    assert effect.low - 1e-9 <= effect.mean <= effect.high + 1e-9
    assert (turned.mean, turned.low, turned.high) == pytest.approx(
        (-effect.mean, -effect.high, -effect.low)
    )
    assert turned.rank_biserial == pytest.approx(-effect.rank_biserial)
    assert -1 <= effect.rank_biserial <= 1


@pytest.mark.parametrize("count", [3, 5, 10])
def test_the_interval_of_few_normal_differences_is_as_sure_as_it_says(count: int) -> None:
    samples = np.random.default_rng(count).normal(1.0, 2.0, (1500, count))
    effects = [effect_of(sample) for sample in samples]
    share = np.mean([effect.low <= 1.0 <= effect.high for effect in effects])
    assert share == pytest.approx(0.95, abs=0.02)  # 3.5 standard errors


def test_the_interval_is_that_of_scipy_and_one_difference_has_none() -> None:
    sample = [0.1, -0.2, 0.3, 0.4]
    expected = scipy.stats.ttest_1samp(sample, 0.0).confidence_interval(0.95)
    effect = effect_of(sample)
    assert (effect.low, effect.high) == pytest.approx((expected.low, expected.high))
    alone = effect_of([0.3])
    assert (alone.low, alone.high) == (0.3, 0.3)


@pytest.mark.parametrize("differences", [[], [[0.1]], [float("nan")]])
def test_an_effect_needs_differences(differences: list[float]) -> None:
    with pytest.raises(ValueError, match="difference"):
        effect_of(differences)
