"""Whether one map is better than another by more than chance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hypermap.core.errors import HypermapError

Method: TypeAlias = Literal["exact", "normal"]

TIE = 1e-9  # differences within this are equal, or zero
MOST_EXACT = 15  # differences up to which the exact distribution is the default
_MOST = 1000  # differences up to which it is possible; beyond, float64 underflows


@dataclass(frozen=True)
class SignedRank:
    """The result of a one-sided Wilcoxon signed-rank test: are paired differences above zero?

    Attributes:
        pairs: number of differences.
        used: number of those that are not zero.
        statistic: sum of the ranks of the differences above zero.
        z: the statistic in standard deviations from its mean; None if the method is exact.
        p: probability of this statistic or a larger one if the signs were random.
        method: how `p` was computed.
    """

    pairs: int
    used: int
    statistic: float
    z: float | None
    p: float
    method: Method


@dataclass(frozen=True)
class Effect:
    """How large paired differences are, and whether they may be due to chance.

    Attributes:
        pairs: number of differences.
        mean: of the differences.
        low: lower end of the interval that holds their mean with a confidence of 95 %.
        high: its upper end.
        rank_biserial: matched-pairs rank-biserial correlation: 1 where all differences are above
            zero, 0 where as much is below, -1 where all are; 0 if all are zero.
    """

    pairs: int
    mean: float
    low: float
    high: float
    rank_biserial: float


def signed_rank(differences: ArrayLike, exact: bool = False) -> SignedRank:
    """Return the probability that chance alone makes paired differences so much larger than zero.

    Zero differences are dropped. Ties get their mean rank. Up to 15 differences,
    or if `exact`, the distribution is exact; otherwise normal,
    with corrections for ties and for continuity.

    Args:
        differences: one per pair, shape (N,).
        exact: whether to use the exact distribution, however many there are.

    Raises:
        ValueError: If the shape is wrong or a difference is not finite.
        HypermapError: If there are too many for the exact distribution.

    Source: Wilcoxon 1945; choices as in MATLAB's `signrank(x, y, 'tail', 'right')`.

    >>> signed_rank([0.3, 0.1, 0.2, 0.0]).p  # one of eight patterns has all signs positive
    0.125
    """
    given = _checked(differences)
    used = given[np.abs(given) > TIE]
    ranks = _ranks(np.abs(used))
    statistic = float(ranks[used > 0].sum())
    if exact or len(used) <= MOST_EXACT:
        p = _exact_p(ranks, statistic)
        return SignedRank(len(given), len(used), statistic, None, p, "exact")
    z = _z(ranks, statistic)
    p = 0.5 * math.erfc(z / math.sqrt(2))
    return SignedRank(len(given), len(used), statistic, z, p, "normal")


def effect_of(differences: ArrayLike) -> Effect:
    """Return how large paired differences are.

    The interval is Student's. It has no width if there is one difference, which does not tell how
    much others differ. The bootstrap's intervals are too narrow for few differences.

    Args:
        differences: one per pair, at least one, shape (N,).

    Raises:
        ValueError: If the shape is another, there is none, or a difference is not finite.

    Source: Student, "The probable error of a mean", Biometrika 6, 1908; Kerby, "The simple
    difference formula", Comprehensive Psychology 3, 2014.

    >>> effect_of([0.1, 0.2, -0.1]).rank_biserial  # ranks 1.5 and 3 against 1.5
    0.5
    """
    given = _checked(differences)
    if (count := len(given)) == 0:
        raise ValueError("there must be at least one difference")
    mean, half = float(given.mean()), 0.0
    if count > 1:
        half = float(scipy.special.stdtrit(count - 1, 0.975) * given.std(ddof=1)) / math.sqrt(count)
    used = given[np.abs(given) > TIE]
    ranks = _ranks(np.abs(used))
    total = float(ranks.sum())
    biserial = float((np.sign(used) * ranks).sum()) / total if total else 0.0
    return Effect(count, mean, mean - half, mean + half, biserial)


def _checked(differences: ArrayLike) -> NDArray[np.float64]:
    given = np.asarray(differences, dtype=np.float64)
    if given.ndim != 1:
        raise ValueError(f"differences must have shape (N,), got {given.shape}")
    if not np.isfinite(given).all():
        raise ValueError("differences must be finite; there is a NaN or infinite one")
    return given


def _ranks(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ranks from 1; neighbors that differ by no more than rounding share their mean."""
    order = np.argsort(sizes, kind="stable")
    starts = np.diff(sizes[order], prepend=-np.inf) > TIE
    group = np.cumsum(starts) - 1
    places = np.arange(1, len(sizes) + 1)
    means = np.bincount(group, places) / np.bincount(group) if len(sizes) else places
    ranks = np.empty(len(sizes))
    ranks[order] = means[group]
    return ranks


def _exact_p(ranks: NDArray[np.float64], statistic: float) -> float:
    """Return the share of all patterns of signs whose sum of positive ranks reaches `statistic`."""
    if len(ranks) > _MOST:
        raise HypermapError(
            f"the exact distribution is not computed for more than {_MOST} pairs, and there are "
            f"{len(ranks)}; leave out the exact test; the normal approximation is as good here"
        )
    doubled = np.rint(2 * ranks).astype(np.int64)  # mean ranks are halves
    share = np.ones(1)  # of the patterns so far, indexed by twice their sum
    for rank in doubled:
        share = 0.5 * (np.pad(share, (0, rank)) + np.pad(share, (rank, 0)))
    return min(1.0, float(share[round(2 * statistic) :].sum()))


def _z(ranks: NDArray[np.float64], statistic: float) -> float:
    n = len(ranks)
    mean = n * (n + 1) / 4
    _, ties = np.unique(ranks, return_counts=True)
    variance = (n * (n + 1) * (2 * n + 1) - (ties**3 - ties).sum() / 2) / 24
    return float((statistic - 0.5 - mean) / math.sqrt(variance))
