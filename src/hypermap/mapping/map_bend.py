"""How far the map to which poses are corrected is bent: corrections by it recur in a place.

A correction is the error of the recorded pose, less that of the map. Localization errs in another
way when the robot comes back later, but a bent map errs in one place always in the same way. So
corrections at one place and different times have a covariance that is the variance of the bend.

Source: analysis of variance with random effects, by products of pairs as in the variogram of
geostatistics (Matheron, "Principles of geostatistics", 1963); its standard error by leaving out
parts of the time, the jackknife (Tukey, 1958).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray

_TIME = 15.0  # seconds; corrections one such time apart, or more, have independent errors
_PARTS = 10  # of the time, of which one is left out
_FEWEST = 3  # of two parts, one alone shows no place twice, so there is no standard error
_SIDE = 1.0  # meters; of the square cells that count as one place

Array = NDArray[np.float64]


def bend_of_map(stamps: Array, xy: Array, moves: Array) -> float:
    """Return how far a map is surely bent: standard deviation in x and in y [m].

    It is the estimate of the variance less its standard error. What all places share is no bend.
    It is 0 if no place was seen twice, or at fewer than three times.

    Args:
        stamps: when something was seen [s], shape (N,).
        xy: where it was [m], shape (N, 2).
        moves: by how much the correction of the pose moved it [m], shape (N, 2).
    """
    cells = np.floor(xy / _SIDE).astype(np.int64)
    times = np.floor(stamps / _TIME).astype(np.int64)
    keys, sums = _totals(
        np.column_stack([cells, times]), np.column_stack([moves, np.ones(len(xy))])
    )
    means = sums[:, :2] / sums[:, 2:]
    places, times = _numbered(keys[:, :2]), keys[:, 2]
    parts = _numbered(times[:, np.newaxis])
    parts = parts * _PARTS // max(len(np.unique(parts)), _PARTS)
    without = [
        _recurring(places[parts != part], times[parts != part], means[parts != part])
        for part in np.unique(parts)
    ]
    if len(without) < _FEWEST:
        return 0.0
    error = math.sqrt((len(without) - 1) * float(np.var(without)))
    return math.sqrt(max(_recurring(places, times, means) - error, 0.0))


def _recurring(places: IntArray, times: IntArray, moves: Array) -> float:
    """Return the variance of moves, in x and in y, that recurs at the same place [m²]."""
    here, pairs_here = _products(places, times, moves)
    everywhere, pairs = _products(np.zeros(len(times), np.int64), times, moves)
    if pairs_here == 0 or pairs == pairs_here:
        return 0.0
    elsewhere = (everywhere - here) / (pairs - pairs_here)
    return (here / pairs_here - elsewhere) / 2  # of x and y together


def _products(groups: IntArray, times: IntArray, vectors: Array) -> tuple[float, float]:
    """Return the sum of the products of pairs in a group, and the number of the pairs.

    Pairs of the same and of subsequent times do not count.
    """
    values = np.column_stack([vectors, np.ones(len(vectors))])
    keys, sums = _totals(np.column_stack([groups, times]), values)
    group = _numbered(keys[:, :1])
    wholes = _totals(group[:, np.newaxis], sums)[1]
    follows = (np.diff(group) == 0) & (np.diff(keys[:, 1]) == 1)
    products = (wholes**2).sum(axis=0) - (sums**2).sum(axis=0)
    products -= 2 * (sums[:-1] * sums[1:])[follows].sum(axis=0)
    return float(products[:2].sum()), float(products[2])


def _totals(keys: IntArray, values: Array) -> tuple[IntArray, Array]:
    """Return the distinct keys in ascending order, shape (K, ...), and the sums of their values."""
    order, is_new = _ordered(keys)
    sums = np.add.reduceat(values[order], np.flatnonzero(is_new), axis=0)
    return keys[order][is_new], np.asarray(sums)


def _numbered(keys: IntArray) -> IntArray:
    """Return the number of each key among the distinct ones, shape (N,)."""
    order, is_new = _ordered(keys)
    numbers = np.empty(len(keys), np.int64)
    numbers[order] = np.cumsum(is_new) - 1
    return numbers


def _ordered(keys: IntArray) -> tuple[IntArray, BoolArray]:
    """Return the order of keys, shape (N,), and which of them, in it, differ from the one before.

    This is several times faster than `np.unique` along an axis.
    """
    order = np.lexsort(keys.T[::-1])
    is_new: BoolArray = np.ones(len(keys), dtype=bool)
    is_new[1:] = (np.diff(keys[order], axis=0) != 0).any(axis=1)
    return order, is_new
