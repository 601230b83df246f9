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
    pulled = 1 - posterior._away[middle : middle + 31, 0]
    assert np.interp(length, 0.25 * np.arange(31), pulled) == pytest.approx(0.14, abs=0.04)


def test_trends_are_mixed_as_in_universal_kriging(lattice):
    random = np.random.default_rng(4)
    observations = Observations(
        lattice.weights_at(random.uniform([0, 0], [3.5, 2.5], size=(12, 2))),
        random.normal(20, 3, size=12),
        np.ones(12),
    )
    noise, prior = 0.4, Prior(lattice, 1.5, 0.0)
    trends = np.stack([np.ones(35), lattice.centers_xy[:, 0]], axis=1)

    posterior = Posterior(prior, observations, noise, trends)

    # Rasmussen and Williams, Gaussian Processes for Machine Learning, equations 2.41 and 2.42
    k, a = np.linalg.inv(prior.precision.toarray()), observations.weights.toarray()
    inverse = np.linalg.inv(a @ k @ a.T + noise**2 * np.eye(12))
    here = a @ trends
    sureness = here.T @ inverse @ here + np.diag([0, 0.01])
    mixture = np.linalg.solve(sureness, here.T @ inverse @ observations.values)
    gain = k @ a.T @ inverse
    left = trends - gain @ here
    np.testing.assert_allclose(
        posterior.mean(), trends @ mixture + gain @ (observations.values - here @ mixture)
    )
    np.testing.assert_allclose(
        posterior.variance(),
        np.diagonal(k - gain @ a @ k) + np.diagonal(left @ np.linalg.inv(sureness) @ left.T),
        rtol=1e-8,
    )
    (likelihood,) = posterior.likelihoods_with(trends[:, 1:])
    rest = observations.values - here @ mixture
    misfit = observations.values @ inverse @ rest
    expected = -6 * np.log(misfit) if mixture[1] > 0 else -np.inf
    np.testing.assert_allclose(likelihood, expected)


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


def test_a_wall_parts_as_much_whatever_the_size_of_the_cells():
    """The warmth of one room reaches the next one alike on a fine and on a coarse lattice."""
    walls = occupancy_from_text(TWO_ROOMS, resolution=1.0)
    shared = []
    for side in (0.5, 0.25):
        lattice = Lattice.over(GridGeometry(round(9 / side), round(5 / side), side), walls)
        prior = Prior(lattice, 6.0, 0.2)
        weights = lattice.weights_at(np.array([[2.6, 2.6], [6.4, 2.6]]))
        far = Posterior(prior, Observations(weights, np.zeros(2), np.full(2, 1e-9)), 1.0)
        with_left = far.covariance_with(weights[[0]])
        shared.append(float((weights[[1]] @ with_left)[0] / (weights[[0]] @ with_left)[0]))
    assert shared[0] == pytest.approx(shared[1], rel=0.2)


def test_away_from_walls_a_quantity_that_is_driven_beside_them_is_smoother():
    """Between what two walls do, it is nearly a straight line."""
    room = occupancy_from_text("#" * 41 + "\n" + ("#" + "." * 39 + "#\n") * 3 + "#" * 41, 0.25)
    lattice = Lattice.over(room.grid, room)
    middle = 2 * 41 + 20
    bends = []
    for away in (1.0, 0.01):
        covariance = np.linalg.inv(Prior(lattice, 8.0, 0.05, away).precision.toarray())
        bend = np.zeros(len(covariance))
        bend[[middle - 8, middle, middle + 8]] = 1, -2, 1
        bends.append(bend @ covariance @ bend)
    assert bends[1] == pytest.approx(bends[0], rel=1.0)
