"""A Gaussian Markov random field on a lattice, and what samples say about it.

Before any sample it is the solution of (kappa^2 - Laplace) x = white noise on the lattice, a Matern
field of smoothness 1 (Lindgren, Rue and Lindstrom, J. R. Stat. Soc. B 73, 2011). The Laplacian is
that of the links, so that places that a wall parts have little to do with each other, as in Monroy,
Blanco and Gonzalez-Jimenez (Autonomous Robots 40, 2016). All nodes are given the same variance,
which the equation alone would not do at edges and in closets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from hypermap.core.arrays import IntArray
from hypermap.values.block_tridiagonal import BlockCholesky
from hypermap.values.lattice import Lattice

_Vector = NDArray[np.float64]
_OF_SOURCE = ("source_x", "source_y", "farther_by_wall")
_LIKELY_MIXTURE = 10.0  # of all trends but the first one, as a multiple of the field's deviation
Trends = NDArray[np.float64]

_LENGTH_OF_KAPPA = math.sqrt(8)  # where the correlation of a Matern field of smoothness 1 is 0.14


@dataclass(frozen=True)
class FieldSettings:
    """How a quantity varies over the floor.

    Attributes:
        length: how far apart two places are that have little to do with each other [m].
        deviation: standard deviation of the quantity over the floor, in its unit.
        noise: standard deviation of a sample at one place, in its unit.
        through_walls: how much of a link of 0.25 m is left where a wall cuts it, 0 to 1.
        away_from_walls: how much the quantity is driven there, as a share of that next to walls,
            where windows and radiators are; above 0, and 1 where it makes no difference.
        source_x: where the sender of a radio signal is [m]; NaN where the mean is one number.
        source_y: the same.
        farther_by_wall: behind a wall the signal is as if the sender were so many times as far.

    Raises:
        ValueError: If one is out of range.
    """

    length: float
    deviation: float
    noise: float
    through_walls: float = 0.0
    away_from_walls: float = 1.0
    source_x: float = math.nan
    source_y: float = math.nan
    farther_by_wall: float = 1.0

    def __post_init__(self) -> None:
        for name in ("length", "deviation", "noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be a positive number, got {value}")
        if not 0 <= self.through_walls <= 1:
            raise ValueError(f"through_walls must be from 0 to 1, got {self.through_walls}")
        if not 0 < self.away_from_walls <= 1:
            raise ValueError(f"away_from_walls must be above 0 to 1, got {self.away_from_walls}")
        if math.isfinite(self.source_x) != math.isfinite(self.source_y):
            raise ValueError(f"a source needs x and y, got {self.source_x} and {self.source_y}")
        if not 1 <= self.farther_by_wall < math.inf:
            raise ValueError(f"farther_by_wall must be at least 1, got {self.farther_by_wall}")

    def numbers(self) -> dict[str, float]:
        """Return them by name, without those of a source where there is none."""
        without = () if math.isfinite(self.source_x) else _OF_SOURCE
        return {name: value for name, value in vars(self).items() if name not in without}

    @staticmethod
    def of_numbers(numbers: Mapping[str, object]) -> FieldSettings:
        """Return settings from numbers by name; others are left out, and 1 is what is missing.

        Raises:
            ValueError: If a number is out of range or none.
            TypeError: If one is no number.
        """
        names = [field.name for field in fields(FieldSettings)]
        given: dict[str, Any] = {"deviation": 1.0, "noise": 1.0}
        given |= {name: numbers[name] for name in names if name in numbers}
        return FieldSettings(**{name: float(value) for name, value in given.items()})


@dataclass(frozen=True, eq=False)
class Observations:
    """Noisy sums of nodes.

    Attributes:
        weights: of the nodes in each, shape (M, N); rows add up to 1.
        values: shape (M,), in the quantity's unit.
        precision: of each, as a multiple of that of one sample, shape (M,).
        more: how many more samples there are, where some are means of several at one place.
        scatter: the sum of the squares, weighted by precision, by which these differ from their
            means.
    """

    weights: csr_array
    values: _Vector
    precision: _Vector
    more: int = 0
    scatter: float = 0.0

    @property
    def count(self) -> int:
        """How many samples say something."""
        return int(np.count_nonzero(self.precision)) + self.more

    @cached_property
    def information(self) -> csr_array:
        """What they add to the precision of the nodes, shape (N, N), where noise is 1."""
        return csr_array(self.weights.T @ diags_array(self.precision) @ self.weights)

    def pull(self, values: _Vector) -> _Vector:
        """Return what values, shape (M,), add to precision times mean, shape (N,)."""
        pulled: _Vector = self.weights.T @ (self.precision * values)
        return pulled


class Prior:
    """A field whose nodes all have the mean 0 and the variance 1, before any sample.

    Args:
        lattice: of the nodes.
        length: see `FieldSettings`.
        through_walls: see there.
        away_from_walls: see there.
    """

    def __init__(
        self, lattice: Lattice, length: float, through_walls: float, away_from_walls: float = 1.0
    ) -> None:
        self.order = _order(lattice)
        self.block = 2 * min(lattice.grid.shape)
        kappa = _LENGTH_OF_KAPPA / length
        here = np.full(len(self.order), (kappa * lattice.grid.resolution) ** 2)
        operator = diags_array(here) + lattice.laplacian(through_walls)
        driven = np.where(lattice.is_by_wall, 1.0, away_from_walls)
        precision = csr_array(operator @ diags_array(1 / driven) @ operator)
        factor = BlockCholesky.of(_ordered(precision, self.order), self.block)
        spread = np.empty(len(self.order))
        spread[self.order] = np.sqrt(factor.inverse_diagonal())
        scales = diags_array(spread)
        self.precision = csr_array(scales @ precision @ scales)
        self.log_determinant = factor.log_determinant() + 2 * float(np.log(spread).sum())


class Posterior:
    """A field of which noisy observations are known.

    Its mean before any observation is a sum of trends, in a mixture that is unknown and comes from
    the observations as well.

    Args:
        prior: before any observation.
        observations: at least one with a precision above 0.
        noise: standard deviation of a sample, as a multiple of that of the field.
        trends: at the nodes, shape (N, P); by default one that is 1 everywhere.
    """

    def __init__(
        self,
        prior: Prior,
        observations: Observations,
        noise: float,
        trends: Trends | None = None,
    ) -> None:
        self._prior, self._observations, self._noise = prior, observations, noise
        self._trends = np.ones((len(prior.order), 1)) if trends is None else trends
        precision = csr_array(prior.precision + observations.information / noise**2)
        self._factor = BlockCholesky.of(_ordered(precision, prior.order), prior.block)
        values = observations.values
        here = self._here = observations.weights @ self._trends
        # The part of the trends that the observations explain, and the rest.
        told = self._solve(observations.information @ self._trends / noise**2)
        self._away = self._trends - told
        weighted = self._weighted(here, told)
        # What the mixture is known by, shape (P, P); the more of a trend, the less likely.
        ridge = np.diag([0.0] + [_LIKELY_MIXTURE**-2] * (here.shape[1] - 1))
        self._sureness = here.T @ weighted + ridge
        self._mixture = np.linalg.solve(self._sureness, weighted.T @ values)
        self._rest = values - here @ self._mixture
        self._fitted = self._solve(observations.pull(self._rest) / noise**2)

    def trend_variance(self) -> float:
        """Return that of the mean over the observations before these, in the unit's square."""
        return float(np.var(self._here @ self._mixture))

    def mean(self) -> _Vector:
        """Return the mean of each node, shape (N,), in the quantity's unit."""
        return np.asarray(self._trends @ self._mixture + self._fitted)

    def variance(self) -> _Vector:
        """Return the variance of each node, shape (N,), as a multiple of the field's own."""
        variance = np.empty(len(self._away))
        variance[self._prior.order] = self._factor.inverse_diagonal()
        # The mixture is not known for sure, either (Rasmussen and Williams, Gaussian Processes for
        # Machine Learning, 2006, equation 2.42).
        unsure = np.linalg.solve(self._sureness, self._away.T)
        return np.asarray(variance + np.einsum("np,pn->n", self._away, unsure))

    def covariance_with(self, weights: csr_array) -> _Vector:
        """Return the covariance of all nodes with one sum of few neighboring ones, shape (N,).

        Args:
            weights: of the nodes in the sum, shape (1, N).

        Returns:
            As a multiple of the field's variance; that of the trends' mixture is in it.
        """
        right = np.zeros(len(self._away))
        right[weights.indices] = weights.data
        order = self._prior.order
        solved = np.empty_like(right)
        solved[order] = self._factor.solve_near(right[order])
        unsure = np.linalg.solve(self._sureness, right @ self._away)
        return np.asarray(solved + self._away @ unsure)

    def log_likelihood(self) -> tuple[float, float]:
        """Return how likely the observations are, and the field's deviation that makes them so.

        The deviation is that which makes them likeliest; the mixture of trends is integrated over
        (restricted likelihood).

        Returns:
            The logarithm of the density, but for a constant, and the deviation in the quantity's
            unit.
        """
        count, trends = self._observations.count, len(self._mixture)
        free = max(count - trends, 1)
        variance = max(self._misfit() / free, np.finfo(float).tiny)
        determinants = (
            self._factor.log_determinant()
            - self._prior.log_determinant
            + 2 * count * math.log(self._noise)
            + float(np.linalg.slogdet(self._sureness)[1])
        )
        return -0.5 * (free * math.log(variance) + determinants), math.sqrt(variance)

    def likelihoods_with(self, others: NDArray[np.float64]) -> _Vector:
        """Return how likely the observations are where the mean has another trend.

        Args:
            others: that trend and a constant in K cases, shape (N, K).

        Returns:
            Shape (K,): the logarithm but for a constant; -inf where its share would be negative.
        """
        information = self._observations.information / self._noise**2
        pull = self._observations.pull(self._observations.values) / self._noise**2
        pulled = self._solve(pull)
        trends = [np.ones_like(others), others]
        informed = [np.asarray(information @ trend) for trend in trends]
        solved = [self._solve(each) for each in informed]
        # What the trends and the values are to each other by the observations' inverse covariance.
        products = np.array(
            [
                [(trends[i] * informed[j] - informed[i] * solved[j]).sum(axis=0) for j in (0, 1)]
                for i in (0, 1)
            ]
        )
        sums = np.array([trends[i].T @ pull - informed[i].T @ pulled for i in (0, 1)])
        weighted = self._observations.precision / self._noise**2
        square = float((weighted * self._observations.values) @ self._observations.values)
        square += self._observations.scatter / self._noise**2
        ridge = np.diag([0.0, _LIKELY_MIXTURE**-2])
        mixtures = np.linalg.solve(products.T + ridge, sums.T[..., np.newaxis])[..., 0]
        misfits = square - pull @ pulled - np.einsum("kp,pk->k", mixtures, sums)
        misfits = np.maximum(misfits, np.finfo(float).tiny)
        likelihoods = -0.5 * self._observations.count * np.log(misfits)
        return np.where(mixtures[:, 1] > 0, likelihoods, -np.inf)

    def greatest_likelihood(self) -> float:
        """Return the logarithm of how likely the observations are by the likeliest mixture.

        Fields with different trends can be compared by it, other than by `log_likelihood`.
        """
        count, misfit = max(self._observations.count, 1), self._misfit()
        determinants = (
            self._factor.log_determinant()
            - self._prior.log_determinant
            + 2 * count * math.log(self._noise)
        )
        return -0.5 * (count * math.log(max(misfit / count, 1e-300)) + determinants)

    def _misfit(self) -> float:
        """Return the square of what is unexplained, by the observations' inverse covariance."""
        between = float(self._weighted(self._rest, self._fitted) @ self._rest)
        return between + self._observations.scatter / self._noise**2

    def _weighted(self, values: _Vector, solved: _Vector) -> _Vector:
        """Return the inverse covariance of the observations times values, shape (M,) or (M, P).

        Args:
            values: of that shape.
            solved: the mean of the nodes if these were observed, shape (N,) or (N, P).
        """
        left = values - self._observations.weights @ solved
        return np.asarray((self._observations.precision * left.T).T / self._noise**2)

    def _solve(self, right: _Vector) -> _Vector:
        solved = np.empty_like(right)
        solved[self._prior.order] = self._factor.solve(right[self._prior.order])
        return solved


def _order(lattice: Lattice) -> IntArray:
    """Return the nodes by lines along the shorter side of the lattice, shape (N,)."""
    numbers = np.arange(lattice.grid.width * lattice.grid.height).reshape(lattice.grid.shape)
    return (numbers if numbers.shape[1] <= numbers.shape[0] else numbers.T).ravel()


def _ordered(matrix: csr_array, order: IntArray) -> csr_array:
    """Return a matrix with rows and columns in an order; itself if that is the one they are in."""
    if (order[1:] > order[:-1]).all():
        return matrix
    return csr_array(matrix[order][:, order])
