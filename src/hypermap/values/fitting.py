"""Fit the parameters of a random field to samples."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import csr_array, vstack
from scipy.special import ndtr

from hypermap.values.lattice import Lattice
from hypermap.values.random_field import FieldSettings, Observations, Posterior, Prior, Trends
from hypermap.values.source import find_source, source_trends

LEAST_SAMPLES = 5  # with a value, needed to estimate length, deviation and noise
_NOISE = (0.02, 20.0)  # as a multiple of the field's deviation
# What length, noise over deviation and `through_walls` are before any sample, and the standard
# deviation of their logarithms. What remains of a signal besides its mean is shadowing, some meters
# wide (Gudmundson, Electronics Letters 27, 1991).
_THROUGH_WALLS = 0.05
_EXPECTED = ((1.0, math.inf), (1.0, math.inf), (_THROUGH_WALLS, 1.1))
_EXPECTED_BESIDE_SOURCE = ((3.0, 0.7), (0.7, 0.7), (_THROUGH_WALLS, 1.1))
_LEAST_THROUGH = 1e-3
_NOTHING_THROUGH = 0.01  # so little is none, so that nothing is said of rooms without samples
_AWAY = (1.0, 0.1)
_SEARCHES = 2  # for the sender
_UNKNOWNS = 4  # of a sender: place, level, walls
_STEPS = 60  # of the search
_LEAST_PRECISION = 1e-6  # of a limit, as multiples of a sample's
_ROUNDS = 12  # of expectation propagation
_DROPOUTS = 0.05  # share of the samples that miss an existing signal
_CLOSE = 1e-3  # change of a site's mean, in units of noise, at which the rounds end


@dataclass(frozen=True, eq=False)
class _Fit:
    """Settings that were tried.

    Attributes:
        parameters: logarithms of length, of noise over deviation and, where there are walls, of
            `through_walls`.
        away_from_walls: see `FieldSettings`.
        deviation: see there.
        likelihood: the logarithm, with what is known of walls beforehand.
        posterior: with these settings.
    """

    parameters: NDArray[np.float64]
    away_from_walls: float
    deviation: float
    likelihood: float
    posterior: Posterior

    def settings(self) -> FieldSettings:
        length, noise, *rest = np.exp(self.parameters).tolist()
        through_walls = rest[0] if rest and rest[0] > _NOTHING_THROUGH else 0.0
        return FieldSettings(
            length, self.deviation, noise * self.deviation, through_walls, self.away_from_walls
        )


def fit_settings(lattice: Lattice, heard: Observations, *, may_have_source: bool) -> FieldSettings:
    """Return the most likely settings of the field (restricted maximum likelihood).

    Args:
        lattice: of the nodes; the coarser, the quicker.
        heard: of the field, at least `LEAST_SAMPLES`.
        may_have_source: whether to look for a sender.
    """
    side = lattice.grid.resolution
    longest = 4 * side * math.hypot(*lattice.grid.shape)
    shortest, longest = math.log(2 * side), math.log(max(longest, 4 * side))
    bounds = [(shortest, longest), (math.log(_NOISE[0]), math.log(_NOISE[1]))]
    start = [(shortest + longest) / 2, math.log(0.5)]
    if lattice.has_walls:
        bounds.append((math.log(_LEAST_THROUGH), 0.0))
        start.append(math.log(_THROUGH_WALLS))
    best = _likeliest(lattice, heard, np.array(start), bounds, _AWAY[0])
    for away in _AWAY[1:] if lattice.has_walls else ():
        found = _likeliest(lattice, heard, best.parameters, bounds, away)
        if found.likelihood > best.likelihood:
            best = found
    if not (may_have_source and lattice.has_walls):  # without walls, samples suffice
        return best.settings()
    return _with_source(lattice, heard, best, bounds) or best.settings()


def _with_source(
    lattice: Lattice, heard: Observations, without: _Fit, bounds: list[tuple[float, float]]
) -> FieldSettings | None:
    """Return the most likely settings with a sender; None where one explains too little."""
    best, source, found = without, None, without
    for _ in range(_SEARCHES):  # the better the field is known, the better is the sender
        place = find_source(lattice, heard, found.posterior, near=source)
        trends = source_trends(lattice, place)
        found = _likeliest(lattice, heard, found.parameters, bounds, found.away_from_walls, trends)
        unknowns = 0 if source else _UNKNOWNS
        gain = found.posterior.greatest_likelihood() - best.posterior.greatest_likelihood()
        if gain <= 0.5 * unknowns * math.log(heard.count):  # Schwarz 1978
            break
        best, source = found, place
    if source is None:
        return None
    return replace(
        best.settings(),
        source_x=source.x,
        source_y=source.y,
        farther_by_wall=source.farther_by_wall,
    )


def _likeliest(
    lattice: Lattice,
    heard: Observations,
    start: NDArray[np.float64],
    bounds: list[tuple[float, float]],
    away_from_walls: float,
    trends: Trends | None = None,
) -> _Fit:
    """Return the most likely parameters for a given `away_from_walls`."""
    least = float(np.abs(heard.values).max()) * 1e-6 + 1e-12  # for a constant field

    def fit(parameters: NDArray[np.float64]) -> _Fit:
        length, noise, *rest = np.exp(parameters).tolist()
        prior = Prior(lattice, length, rest[0] if rest else 0.0, away_from_walls)
        posterior = Posterior(prior, heard, noise, trends)
        likelihood, deviation = posterior.log_likelihood()
        expected = _EXPECTED if trends is None else _EXPECTED_BESIDE_SOURCE
        center, spread = np.array(expected[: len(parameters)]).T
        likelihood -= 0.5 * float((((parameters - np.log(center)) / spread) ** 2).sum())
        return _Fit(parameters, away_from_walls, max(deviation, least), likelihood, posterior)

    def unlikelihood(parameters: NDArray[np.float64]) -> float:
        return -fit(parameters).likelihood

    search: dict[str, Any] = {
        "method": "Nelder-Mead",
        "bounds": bounds,
        "options": {"maxfev": _STEPS, "xatol": 0.05, "fatol": 0.02},
    }
    found = minimize(unlikelihood, start, **search)
    return fit(found.x)


def with_limits(
    prior: Prior,
    heard: Observations,
    limits: Observations,
    settings: FieldSettings,
    trends: Trends,
) -> Observations:
    """Return observations that combine values and upper limits.

    What is only known to lie below a limit becomes the observation with the same effect, by
    expectation propagation (Minka 2001; Rasmussen and Williams 2006, section 3.6, with the limit
    instead of the class).

    Args:
        prior: of the nodes.
        heard: values.
        limits: upper limits in `values`, of so precise samples.
        settings: of the field.
        trends: at the nodes, as `Posterior` takes them.
    """
    scale = settings.deviation
    relative_noise = settings.noise / scale
    variance = settings.noise**2
    limit_variance = variance / limits.precision
    # Precision, as multiples of a sample's, and precision times mean of the sites. These are what
    # can be averaged: a site that says next to nothing may have its mean anywhere.
    precision = np.full(len(limits.values), _LEAST_PRECISION)
    shift = precision * limits.values
    together = _joined(heard, limits, shift / precision, precision)
    for _ in range(_ROUNDS):
        posterior = Posterior(prior, together, relative_noise, trends)
        mean = limits.weights @ posterior.mean()
        spread = limits.weights @ posterior.variance() * scale**2
        left = 1 / np.maximum(1 / spread - precision / variance, 1e-9 / spread)  # without the site
        center = left * (mean / spread - shift / variance)
        new_mean, new_spread = below_limit(center, left, limits.values, limit_variance)
        new_precision = np.maximum(variance * (1 / new_spread - 1 / left), _LEAST_PRECISION)
        new_shift = new_mean * (variance / left + new_precision) - center * variance / left
        change = float(np.abs(new_mean - mean).max(initial=0)) / settings.noise
        precision = 0.5 * (precision + new_precision)
        shift = 0.5 * (shift + new_shift)
        together = _joined(heard, limits, shift / precision, precision)
        if change < _CLOSE:
            break
    return together


def below_limit(
    mean: NDArray[np.float64],
    spread: NDArray[np.float64],
    limit: NDArray[np.float64],
    variance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and variance of normal values, one noisy sample of each being below a limit.

    It says so by mistake in a share of `_DROPOUTS`, so that one that contradicts all others around
    it says little.
    """
    width = np.sqrt(spread + variance)
    z = (limit - mean) / width
    probability = _DROPOUTS + (1 - _DROPOUTS) * ndtr(z)
    ratio = (1 - _DROPOUTS) * np.exp(-0.5 * z**2) / math.sqrt(2 * math.pi) / probability
    return mean - spread * ratio / width, spread - spread**2 * ratio * (z + ratio) / width**2


def _joined(
    heard: Observations,
    limits: Observations,
    means: NDArray[np.float64],
    precision: NDArray[np.float64],
) -> Observations:
    return Observations(
        csr_array(vstack([heard.weights, limits.weights])),
        np.concatenate([heard.values, means]),
        np.concatenate([heard.precision, precision]),
    )
