"""Find the sender of a radio signal, and how its level falls around it.

The level falls with the logarithm of the distance, and by the same number of decibels at each wall
(the multi-wall model; COST 231 final report, 1999, section 4.7). This is the mean of the
field; the field itself is what this leaves of the samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.values.lattice import Lattice
from hypermap.values.random_field import Observations, Posterior, Trends

_CLOSE = 0.5  # meters; nearer to the sender the level is one number
_CANDIDATES = 200
_FARTHER = (1.0, 1.4, 2.0)  # by wall: 0, 3 and 6 dB where the level falls as in free space
_UNSURE = 0.3  # meters
_FINER = 2.5
_ROUNDS = 3  # of candidates, each around the best one before


@dataclass(frozen=True)
class Source:
    """A sender.

    Attributes:
        x: place in the frame of the lattice [m].
        y: the same.
        farther_by_wall: behind a wall the level is as if the sender were so many times as far; 1
            where walls make no difference.
    """

    x: float
    y: float
    farther_by_wall: float


def source_trends(lattice: Lattice, source: Source | None) -> Trends:
    """Return the trends of a field's mean, shape (N, P).

    They are a constant and, with a sender, how the level falls, and what that changes where the
    sender is a little farther along x and y, as its place is not known for sure.

    Args:
        lattice: of the nodes.
        source: the sender; None for none.
    """
    nodes = lattice.centers_xy
    constant = np.ones((len(nodes), 1))
    if source is None:
        return constant
    moved = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]]) * _UNSURE
    decades = _decades(lattice, nodes, np.array([source.x, source.y]) + moved)
    falls = decades[0] + decades[1] * math.log10(source.farther_by_wall)
    slopes = (falls[:, [1, 3]] - falls[:, [2, 4]]) / (2 * _UNSURE)
    return np.concatenate([constant, -10 * falls[:, :1], -10 * slopes], axis=1)


def find_source(
    lattice: Lattice, heard: Observations, posterior: Posterior, near: Source | None = None
) -> Source:
    """Return the sender that makes observations likeliest.

    Args:
        lattice: of the nodes, on which the sender is.
        heard: of the field.
        posterior: that of the field, by which deviations from the sender's level are weighed.
        near: where to look; None for everywhere.
    """
    grid = lattice.grid
    nodes = np.unique(heard.weights.indices)
    size = grid.resolution * np.array([grid.width, grid.height])
    side = float(np.sqrt(size.prod() / _CANDIDATES))
    places = grid.origin.apply(_square(*(np.arange(side / 2, each, side) for each in size)))
    if near is not None:
        side /= _FINER
        places = _around(near, side)
    best = (-math.inf, Source(0.0, 0.0, 1.0))
    for _ in range(_ROUNDS):
        by_distance, by_walls = _decades(lattice, lattice.centers_xy[nodes], places)
        for farther in _FARTHER if lattice.has_walls else _FARTHER[:1]:
            falls = np.zeros((grid.width * grid.height, len(places)))
            falls[nodes] = -10 * (by_distance + by_walls * math.log10(farther))
            likelihoods = posterior.likelihoods_with(falls)
            likeliest = int(np.argmax(likelihoods))
            x, y = places[likeliest].tolist()
            best = max(best, (float(likelihoods[likeliest]), Source(x, y, farther)), key=_first)
        side /= _FINER
        places = _around(best[1], side)
    return best[1]


def _first(pair: tuple[float, Source]) -> float:
    return pair[0]


def _decades(
    lattice: Lattice, places_xy: NDArray[np.float64], sources_xy: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the logarithm of distances from N places to K senders, and the walls between them."""
    distances = np.hypot(*(places_xy[:, np.newaxis] - sources_xy).transpose(2, 0, 1))
    walls = lattice.walls.between(places_xy, sources_xy)
    return np.log10(np.maximum(distances, _CLOSE)), walls


def _around(source: Source, side: float) -> NDArray[np.float64]:
    steps = np.arange(-2, 3) * side
    places: NDArray[np.float64] = np.array([source.x, source.y]) + _square(steps, steps)
    return places


def _square(xs: NDArray[Any], ys: NDArray[Any]) -> NDArray[np.float64]:
    return np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
