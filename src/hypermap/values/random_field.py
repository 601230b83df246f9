"""A Gaussian Markov random field on a lattice, and what samples say about it.

Before any sample it is the solution of (kappa^2 - Laplace) x = white noise on the lattice, a Matern
field of smoothness 1 (Lindgren, Rue and Lindstrom, J. R. Stat. Soc. B 73, 2011). The Laplacian is
that of the links, so that places that a wall parts have little to do with each other, as in Monroy,
Blanco and Gonzalez-Jimenez (Autonomous Robots 40, 2016). All nodes are given the same variance,
which the equation alone would not do at edges and in closets.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from hypermap.core.arrays import IntArray
from hypermap.values.block_tridiagonal import BlockCholesky
from hypermap.values.lattice import Lattice

_Vector = NDArray[np.float64]

_LENGTH_OF_KAPPA = math.sqrt(8)  # where the correlation of a Matern field of smoothness 1 is 0.14


@dataclass(frozen=True)
class FieldSettings:
    """How a quantity varies over the floor.

    Attributes:
        length: how far apart two places are that have little to do with each other [m].
        deviation: standard deviation of the quantity over the floor, in its unit.
        noise: standard deviation of a sample at one place, in its unit.
        through_walls: how much of a link is left where a wall cuts it, 0 to 1.

    Raises:
        ValueError: If one is out of range.
    """

    length: float
    deviation: float
    noise: float
    through_walls: float = 0.0

    def __post_init__(self) -> None:
        for name in ("length", "deviation", "noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be a positive number, got {value}")
        if not 0 <= self.through_walls <= 1:
            raise ValueError(f"through_walls must be from 0 to 1, got {self.through_walls}")


@dataclass(frozen=True, eq=False)
class Observations:
    """Noisy sums of nodes.

    Attributes:
        weights: of the nodes in each, shape (M, N); rows add up to 1.
        values: shape (M,), in the quantity's unit.
        precision: of each, as a multiple of that of one sample, shape (M,).
    """

    weights: csr_array
    values: _Vector
    precision: _Vector

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
    """

    def __init__(self, lattice: Lattice, length: float, through_walls: float) -> None:
        self.order = _order(lattice)
        self.block = 2 * min(lattice.grid.shape)
        kappa = _LENGTH_OF_KAPPA / length
        here = np.full(len(self.order), (kappa * lattice.grid.resolution) ** 2)
        operator = diags_array(here) + lattice.laplacian(through_walls)
        precision = csr_array(operator @ operator)
        factor = BlockCholesky.of(csr_array(precision[self.order][:, self.order]), self.block)
        spread = np.empty(len(self.order))
        spread[self.order] = np.sqrt(factor.inverse_diagonal())
        scales = diags_array(spread)
        self.precision = csr_array(scales @ precision @ scales)
        self.log_determinant = factor.log_determinant() + 2 * float(np.log(spread).sum())


class Posterior:
    """A field of which noisy observations are known.

    Its mean over the floor is unknown before, and comes from the observations as well.

    Args:
        prior: before any observation.
        observations: at least one with a precision above 0.
        noise: standard deviation of a sample, as a multiple of that of the field.
    """

    def __init__(self, prior: Prior, observations: Observations, noise: float) -> None:
        self._prior, self._observations, self._noise = prior, observations, noise
        precision = csr_array(prior.precision + observations.information / noise**2)
        self._factor = BlockCholesky.of(
            csr_array(precision[prior.order][:, prior.order]), prior.block
        )
        values = observations.values
        self._ones = self._solve(observations.pull(np.ones_like(values)) / noise**2)
        weighted = self._weighted(np.ones_like(values), self._ones)
        self._sureness = float(weighted.sum())  # of the mean over the floor
        self.base = float(weighted @ values) / self._sureness
        self._rest = values - self.base
        self._fitted = self._solve(observations.pull(self._rest) / noise**2)

    def mean(self) -> _Vector:
        """Return the mean of each node, shape (N,), in the quantity's unit."""
        return self.base + self._fitted

    def variance(self) -> _Vector:
        """Return the variance of each node, shape (N,), as a multiple of the field's own."""
        variance = np.empty(len(self._ones))
        variance[self._prior.order] = self._factor.inverse_diagonal()
        # The mean over the floor is not known for sure, either (Rasmussen and Williams, Gaussian
        # Processes for Machine Learning, 2006, equation 2.42).
        return np.asarray(variance + (1 - self._ones) ** 2 / self._sureness)

    def covariance_with(self, weights: csr_array) -> _Vector:
        """Return the covariance of all nodes with one sum of few neighboring ones, shape (N,).

        Args:
            weights: of the nodes in the sum, shape (1, N).

        Returns:
            As a multiple of the field's variance; that of the mean over the floor is in it.
        """
        right = np.zeros(len(self._ones))
        right[weights.indices] = weights.data
        order = self._prior.order
        solved = np.empty_like(right)
        solved[order] = self._factor.solve_near(right[order])
        away = 1 - self._ones
        return np.asarray(solved + away * (float(right @ away) / self._sureness))

    def log_likelihood(self) -> tuple[float, float]:
        """Return how likely the observations are, and the field's deviation that makes them so.

        The deviation is that which makes them likeliest; the mean over the floor is integrated
        over (restricted likelihood).

        Returns:
            The logarithm of the density, but for a constant, and the deviation in the quantity's
            unit.
        """
        count = int(np.count_nonzero(self._observations.precision))
        free = max(count - 1, 1)
        misfit = float(self._weighted(self._rest, self._fitted) @ self._rest)
        variance = max(misfit / free, np.finfo(float).tiny)
        determinants = (
            self._factor.log_determinant()
            - self._prior.log_determinant
            + 2 * count * math.log(self._noise)
            + math.log(self._sureness)
        )
        return -0.5 * (free * math.log(variance) + determinants), math.sqrt(variance)

    def _weighted(self, values: _Vector, solved: _Vector) -> _Vector:
        """Return the inverse covariance of the observations times values, shape (M,).

        Args:
            values: shape (M,).
            solved: the mean of the nodes if these were observed, shape (N,).
        """
        left = values - self._observations.weights @ solved
        return np.asarray(self._observations.precision * left / self._noise**2)

    def _solve(self, right: _Vector) -> _Vector:
        solved = np.empty_like(right)
        solved[self._prior.order] = self._factor.solve(right[self._prior.order])
        return solved


def _order(lattice: Lattice) -> IntArray:
    """Return the nodes by lines along the shorter side of the lattice, shape (N,)."""
    numbers = np.arange(lattice.grid.width * lattice.grid.height).reshape(lattice.grid.shape)
    return (numbers if numbers.shape[1] <= numbers.shape[0] else numbers.T).ravel()
