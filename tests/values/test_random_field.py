"""A field on a lattice, against the formulas for Gaussian processes on the whole covariance."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.core.grid import GridGeometry
from hypermap.testing import occupancy_from_text
from hypermap.values.lattice import Lattice
from hypermap.values.random_field import Observations, Posterior, Prior

TWO_ROOMS = """
#########
#...#...#
#...#...#
#...#...#
#########
"""


@pytest.fixture
def lattice() -> Lattice:
    return Lattice.over(GridGeometry(7, 5, 0.5))


def test_nodes_have_the_same_variance_and_less_in_common_the_farther_apart_they_are(lattice):
    covariance = np.linalg.inv(Prior(lattice, 2.0, 0.0).precision.toarray())
    np.testing.assert_allclose(np.diagonal(covariance), 1)
    assert (np.diff(covariance[14, 14:21]) < 0).all()


@pytest.mark.parametrize("length", [0.8, 3.0])
def test_correlation_is_about_0_14_at_the_length(length):
    lattice = Lattice.over(GridGeometry(61, 61, 0.25))
    prior = Prior(lattice, length, 0.0)
    middle = 30 * 61 + 30
    posterior = Posterior(
        prior,
        Observations(lattice.weights_at(lattice.grid.centers([30], [30])), np.ones(1), np.ones(1)),
        noise=1e-3,
    )
    # What is seen at one node pulls the others by their correlation with it.
    pulled = posterior._ones[middle : middle + 31]
    assert np.interp(length, 0.25 * np.arange(31), pulled) == pytest.approx(0.14, abs=0.04)


def test_the_posterior_is_that_of_a_gaussian_process_whose_mean_is_not_known(lattice):
    random = np.random.default_rng(3)
    points = random.uniform([0, 0], [3.5, 2.5], size=(12, 2))
    values = random.normal(20, 3, size=12)
    noise, prior = 0.4, Prior(lattice, 1.5, 0.0)
    observations = Observations(lattice.weights_at(points), values, np.ones(12))

    posterior = Posterior(prior, observations, noise)

    # Rasmussen and Williams, Gaussian Processes for Machine Learning, equations 2.41 and 2.42
    k = np.linalg.inv(prior.precision.toarray())
    a = observations.weights.toarray()
    inverse = np.linalg.inv(a @ k @ a.T + noise**2 * np.eye(12))
    ones = np.ones(12)
    base = (ones @ inverse @ values) / (ones @ inverse @ ones)
    gain = k @ a.T @ inverse
    left = 1 - gain @ ones
    np.testing.assert_allclose(posterior.mean(), base + gain @ (values - base))
    np.testing.assert_allclose(
        posterior.variance(),
        np.diagonal(k - gain @ a @ k) + left**2 / (ones @ inverse @ ones),
        rtol=1e-8,
    )
    rest = values - base
    variance = rest @ inverse @ rest / 11
    likelihood = -0.5 * (
        11 * np.log(variance) - np.linalg.slogdet(inverse)[1] + np.log(ones @ inverse @ ones)
    )
    np.testing.assert_allclose(
        posterior.log_likelihood(), (likelihood, np.sqrt(variance)), rtol=1e-8
    )


def test_what_a_wall_parts_has_nothing_in_common():
    rooms = occupancy_from_text(TWO_ROOMS)
    assert rooms.grid is not None
    lattice = Lattice.over(rooms.grid, rooms)
    here, there = 2 * 9 + 2, 2 * 9 + 6
    closed = np.linalg.inv(Prior(lattice, 5.0, 0.0).precision.toarray())
    thin = np.linalg.inv(Prior(lattice, 5.0, 0.3).precision.toarray())
    assert abs(closed[here, there]) < 1e-9 < 0.05 < thin[here, there]
    assert closed[here, here + 1] > 0.5


def test_points_take_from_the_nodes_that_see_each_other():
    rooms = occupancy_from_text(TWO_ROOMS)
    assert rooms.grid is not None
    lattice = Lattice.over(rooms.grid, rooms)
    weights = lattice.weights_at(np.array([[2.0, 2.0], [3.9, 2.5], [99.0, -5.0]])).toarray()
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    open_nodes = [9 + 1, 9 + 2, 18 + 1, 18 + 2]
    np.testing.assert_allclose(weights[0, open_nodes], 0.25)
    assert weights[1, 2 * 9 + 3] == 1  # a wall is to its right
    assert weights[2, 8] == 1  # off the grid: the nearest corner
