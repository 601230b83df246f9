"""Fit the parameters of a random field to samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import csr_array, vstack
from scipy.special import ndtr

from hypermap.values.lattice import Lattice
from hypermap.values.random_field import FieldSettings, Observations, Posterior, Prior

LEAST_SAMPLES = 5  # with a value, needed to estimate length, deviation and noise
_NOISE = (0.02, 20.0)  # as a multiple of the field's deviation
_THROUGH_WALLS = (0.0, 0.03, 0.3)
_STEPS = 40  # of the search
_LEAST_PRECISION = 1e-6  # of a limit, as multiples of a sample's
_ROUNDS = 12  # of expectation propagation
_DROPOUTS = 0.05  # share of the samples that miss an existing signal
_CLOSE = 1e-3  # change of a site's mean, in units of noise, at which the rounds end


@dataclass(frozen=True, eq=False)
class _Fit:
    parameters: NDArray[np.float64]  # logarithms of length and of noise over deviation
    through_walls: float
    likelihood: float
    deviation: float

    def settings(self) -> FieldSettings:
        length, noise = np.exp(self.parameters).tolist()
        return FieldSettings(length, self.deviation, noise * self.deviation, self.through_walls)


def fit_settings(lattice: Lattice, heard: Observations) -> FieldSettings:
    """Return the most likely settings of the field (restricted maximum likelihood).

    Args:
        lattice: of the nodes; the coarser, the quicker.
        heard: of the field, at least `LEAST_SAMPLES`.
    """
    side = lattice.grid.resolution
    longest = 4 * side * math.hypot(*lattice.grid.shape)
    shortest, longest = math.log(2 * side), math.log(max(longest, 4 * side))
    bounds = [(shortest, longest), (math.log(_NOISE[0]), math.log(_NOISE[1]))]
    start = np.array([(shortest + longest) / 2, math.log(0.5)])
    best: _Fit | None = None
    for through_walls in _THROUGH_WALLS if lattice.has_walls else (0.0,):
        found = _likeliest(lattice, heard, through_walls, start, bounds)
        if best is None or found.likelihood > best.likelihood:
            best = found
        start = found.parameters
    assert best is not None
    return best.settings()


def _likeliest(
    lattice: Lattice,
    heard: Observations,
    through_walls: float,
    start: NDArray[np.float64],
    bounds: list[tuple[float, float]],
) -> _Fit:
    """Return the most likely length and noise for a given `through_walls`."""
    least = float(np.abs(heard.values).max()) * 1e-6 + 1e-12  # for a constant field

    def fit(parameters: NDArray[np.float64]) -> _Fit:
        length, noise = np.exp(parameters).tolist()
        posterior = Posterior(Prior(lattice, length, through_walls), heard, noise)
        likelihood, deviation = posterior.log_likelihood()
        return _Fit(parameters, through_walls, likelihood, max(deviation, least))

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
    prior: Prior, heard: Observations, limits: Observations, settings: FieldSettings
) -> Observations:
    """Return observations that combine values and upper limits.

    What is only known to lie below a limit becomes the observation with the same effect, by
    expectation propagation (Minka 2001; Rasmussen and Williams 2006, section 3.6, with the limit
    in place of the class).

    Args:
        prior: of the nodes.
        heard: values.
        limits: upper limits in `values`, of so precise samples.
        settings: of the field.
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
        posterior = Posterior(prior, together, relative_noise)
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
