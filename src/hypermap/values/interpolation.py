"""Interpolate samples to values all over the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, vstack
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

from hypermap.core.arrays import BoolArray
from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry, check_resolution
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.text import counted, noun
from hypermap.values.fitting import LEAST_SAMPLES, fit_settings, with_limits
from hypermap.values.kernel import kernel_estimate
from hypermap.values.lattice import Lattice, floor_cells, padded_grid
from hypermap.values.methods import METHODS, Method
from hypermap.values.random_field import FieldSettings, Observations, Posterior, Prior, Trends
from hypermap.values.source import Source, source_trends

_MARGIN = 2.0  # meters around the samples
_RESOLUTION = 0.25  # meters; the finest automatic resolution
_NODES = 20_000  # maximum at automatic resolution
_MOST_NODES = 100_000  # a gigabyte of blocks if the floor is square
_MOST_CELLS = 2_000_000  # of a grid; smaller than the nodes' where these are too many
_ROWS_AT_ONCE = 50  # of cells
_MOST_APART = 200_000  # samples; of more, those at one place become their mean
_SAME_PLACE = 0.25  # of a cell's side
_SAME_PLACE_AT_MOST = 0.1  # meters, as samples on both sides of a wall must stay apart
_NODES_TO_FIT = 2_500
_UNEXPLAINED = 0.5  # of the variance, above which there is no value
_FARTHEST = 1e9  # meters from the origin
_WIDEST = 1e5  # meters from one sample to another
_LARGEST = 1e30  # value whose square is still finite
_OLDEST = 100.0  # half-lives; older samples count no less
_UNSURE = 0.5  # confidence of the kernel, below which there is no value


@dataclass(frozen=True, eq=False)
class Interpolation:
    """An estimate of a quantity all over the floor.

    Attributes:
        grid: geometry of the cells, in the frame of the samples.
        values: float64, shape (height, width), in the quantity's unit; NaN where no sample says
            enough, or there is no free floor.
        deviations: standard deviation of each value, not of a sample there; of the same shape.
        noise: standard deviation of a sample at one place; a sample that is still to be taken lies
            within two times hypot(deviation, noise) of the value in 95 of 100 cases. 0 where the
            deviations have it already.
        method: one of `METHODS`.
        settings: by which names and numbers the method found it, so that it can be repeated.
    """

    grid: GridGeometry
    values: NDArray[np.float64]
    deviations: NDArray[np.float64]
    noise: float
    method: Method
    settings: dict[str, float]


def interpolate(
    samples: Samples,
    occupancy: OccupancyLayer | None = None,
    *,
    method: Method = "gmrf",
    settings: FieldSettings | None = None,
    resolution: float | None = None,
    half_life: float | None = None,
    may_have_source: bool = False,
) -> Interpolation:
    """Return the most probable values between samples.

    "gmrf" is a Gaussian Markov random field, whose links walls cut (`random_field`); it takes
    limits for what they are, and its deviations are honest. "kernel" is quicker, knows no walls,
    and takes limits for values (`kernel`). "nearest" gives each cell the value of the nearest
    sample, up to 2 m away: to compare with, and for few samples.

    Args:
        samples: in the frame of the occupancy layer.
        occupancy: walls, and where the floor is; without it the floor is open everywhere.
        method: one of `METHODS`.
        settings: of the field; without them those that make the samples likeliest. The kernel
            takes the length for its width.
        resolution: side of a cell [m]; without it 0.25 m, or more on a large floor. The field of
            more than 100,000 cells has at most 20,000 nodes, and cells take their values from the
            nodes around them that they see.
        half_life: time in which a sample loses half of its weight [s], counted back from the newest
            sample; for "gmrf" alone. Without it, old samples count as much as new ones.
        may_have_source: whether the quantity may be the signal of one sender, in decibels. If the
            samples say so, its mean falls with the distance from there, and at each wall. For
            "gmrf" without settings, and where there are walls.

    Raises:
        HypermapError: If there are too few samples with a value, they are too far apart, a value is
            absurdly large, the resolution is too fine or none, or a half-life is given and the
            method is another or a sample has no stamp.
    """
    if method not in METHODS:
        raise HypermapError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if half_life is not None:
        _check_half_life(samples, half_life, method)
    if method == "gmrf":
        with threadpool_limits(1, "blas"):  # threads wait for each other at each small block
            found = field_of(
                samples,
                occupancy,
                settings=settings,
                resolution=resolution,
                half_life=half_life,
                may_have_source=may_have_source,
            )
            return found.interpolation()
    _check(samples, method == "nearest" or settings is not None)
    grid = grid_around(samples, resolution)
    if method == "nearest":
        return _by_nearest(grid, samples, occupancy)
    return _by_kernel(grid, samples, occupancy, settings)


def _check_half_life(samples: Samples, half_life: float, method: str) -> None:
    if not (math.isfinite(half_life) and half_life > 0):
        raise HypermapError(f"a half-life is a positive number of seconds, got {half_life:g}")
    if method != "gmrf":
        raise HypermapError(f"only the method gmrf supports a half-life, not {method}")
    if np.isnan(samples.stamps).any():
        count = int(np.isnan(samples.stamps).sum())
        raise HypermapError(
            f"{count} of {counted(len(samples), 'sample')} {noun(count, 'has', 'have')} no stamp, "
            "so their age is unknown; leave out the half-life"
        )


def _check(samples: Samples, is_given: bool) -> None:
    """Refuse samples of which no map can be made.

    Args:
        samples: those.
        is_given: whether there is nothing to estimate but the values.
    """
    heard = int(np.count_nonzero(~samples.is_below))
    if heard == 0:
        raise HypermapError(
            f"no sample of {len(samples)} has a value; without one there is nothing to map"
        )
    if not is_given and heard < LEAST_SAMPLES:
        number = counted(heard, "sample with a value is", "samples with a value are")
        raise HypermapError(
            f"{number} too few to estimate how the quantity varies; give at least {LEAST_SAMPLES}, "
            "or its length, deviation and noise, or use the method nearest"
        )


def _check_numbers(samples: Samples) -> None:
    farthest = float(np.abs(samples.points_xy).max())
    if farthest > _FARTHEST or np.ptp(samples.points_xy, axis=0).max() > _WIDEST:
        (x0, y0), (x1, y1) = samples.points_xy.min(axis=0), samples.points_xy.max(axis=0)
        raise HypermapError(
            f"the samples reach from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}); are their places in "
            "meters?"
        )
    largest = float(np.abs(samples.values).max())
    if largest > _LARGEST:
        raise HypermapError(f"a sample has a value of {largest:g}, too large to compute with")


@dataclass(frozen=True, eq=False)
class SolvedField:
    """A field and what samples say about it.

    Attributes:
        grid: of the cells.
        lattice: of the nodes.
        is_floor: which cells lie on free floor, shape (height, width).
        prior: of the nodes.
        trends: what the mean of the nodes is made of.
        observed: the samples; what only lies below a limit as observations with the same effect.
        posterior: of the nodes.
        settings: of the field.
        half_life: of samples [s]; None where all count the same.
    """

    grid: GridGeometry
    lattice: Lattice
    is_floor: BoolArray
    prior: Prior
    trends: Trends
    observed: Observations
    posterior: Posterior
    settings: FieldSettings
    half_life: float | None

    @cached_property
    def _whole_variance(self) -> float:
        """That of the field and of its mean together, as a multiple of the field's."""
        return 1 + self.posterior.trend_variance() / self.settings.deviation**2

    def interpolation(self) -> Interpolation:
        """Return the values of the cells."""
        nodes = self.posterior.mean(), self.posterior.variance()
        mean, variance = _on_cells(self.grid, self.lattice, nodes)
        return self.interpolation_with(*self.known(mean, variance, self.is_floor))

    def interpolation_with(
        self, values: NDArray[np.float64], deviations: NDArray[np.float64]
    ) -> Interpolation:
        """Return values and deviations of the cells with what they were made by."""
        settings = self.settings.numbers()
        if self.half_life is not None:
            settings["half_life"] = self.half_life
        return Interpolation(self.grid, values, deviations, self.settings.noise, "gmrf", settings)

    def known(
        self, mean: NDArray[np.float64], variance: NDArray[np.float64], is_floor: BoolArray
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values and deviations of given cells; NaN where samples say too little."""
        nowhere = (variance > _UNEXPLAINED * self._whole_variance) | ~is_floor
        deviations = self.settings.deviation * np.sqrt(np.maximum(variance, 0))
        return np.where(nowhere, np.nan, mean), np.where(nowhere, np.nan, deviations)


def field_of(
    samples: Samples,
    occupancy: OccupancyLayer | None = None,
    *,
    settings: FieldSettings | None = None,
    resolution: float | None = None,
    half_life: float | None = None,
    may_have_source: bool = False,
) -> SolvedField:
    """Return the field of samples; the arguments and errors are those of `interpolate`."""
    _check(samples, settings is not None)
    grid = grid_around(samples, resolution)
    is_too_fine = grid.width * grid.height > _MOST_NODES
    lattice = Lattice.over(_at_most(grid, _NODES) if is_too_fine else grid, occupancy)
    known = samples.chosen(~samples.is_below)
    newest = float(samples.stamps.max())
    if settings is None:
        coarse = _at_most(grid, _NODES_TO_FIT)
        rough = lattice if coarse == lattice.grid else Lattice.over(coarse, occupancy)
        settings = fit_settings(
            rough, _observed(rough, known, half_life, newest), may_have_source=may_have_source
        )
    prior = Prior(lattice, settings.length, settings.through_walls, settings.away_from_walls)
    trends = source_trends(lattice, _source_of(settings))
    observed = _observed(lattice, known, half_life, newest)
    if samples.is_below.any():
        below = samples.chosen(samples.is_below)
        limits = _observed(lattice, below, half_life, newest)
        observed = with_limits(prior, observed, limits, settings, trends)
    posterior = Posterior(prior, observed, settings.noise / settings.deviation, trends)
    is_floor = lattice.is_floor if lattice.grid == grid else floor_cells(grid, occupancy)
    return SolvedField(
        grid, lattice, is_floor, prior, trends, observed, posterior, settings, half_life
    )


def _source_of(settings: FieldSettings) -> Source | None:
    if math.isnan(settings.source_x):
        return None
    return Source(settings.source_x, settings.source_y, settings.farther_by_wall)


def weights_of_cells(grid: GridGeometry, lattice: Lattice) -> csr_array:
    """Return from which nodes each cell takes its value, by rows, shape (height * width, N)."""
    if lattice.grid == grid:
        return csr_array(eye_array(grid.width * grid.height))
    parts = []
    for row in range(0, grid.height, _ROWS_AT_ONCE):
        rows = np.arange(row, min(row + _ROWS_AT_ONCE, grid.height))
        places = np.repeat(rows, grid.width), np.tile(np.arange(grid.width), len(rows))
        parts.append(lattice.weights_at(grid.centers(*places)))
    return csr_array(vstack(parts))


def _on_cells(
    grid: GridGeometry, lattice: Lattice, nodes: Sequence[NDArray[np.float64]]
) -> list[NDArray[np.float64]]:
    """Return numbers of nodes as numbers of cells, (height, width) each.

    Cells smaller than the lattice's take theirs from the nodes around them that they see.
    """
    if lattice.grid == grid:
        return [numbers.reshape(grid.shape) for numbers in nodes]
    cells = [np.empty(grid.shape) for _ in nodes]
    for row in range(0, grid.height, _ROWS_AT_ONCE):
        rows = np.arange(row, min(row + _ROWS_AT_ONCE, grid.height))
        places = np.repeat(rows, grid.width), np.tile(np.arange(grid.width), len(rows))
        weights = lattice.weights_at(grid.centers(*places))
        for out, numbers in zip(cells, nodes, strict=True):
            out[rows] = (weights @ numbers).reshape(len(rows), grid.width)
    return cells


def _by_kernel(
    grid: GridGeometry,
    samples: Samples,
    occupancy: OccupancyLayer | None,
    settings: FieldSettings | None,
) -> Interpolation:
    width = None if settings is None else settings.length
    values, deviations, confidence, width = kernel_estimate(grid, samples, width)
    nowhere = (confidence < _UNSURE) | ~floor_cells(grid, occupancy)
    noise = float(np.median(deviations[~nowhere])) if (~nowhere).any() else float("nan")
    return Interpolation(
        grid,
        np.where(nowhere, np.nan, values),
        np.where(nowhere, np.nan, deviations),
        noise,
        "kernel",
        {"length": width},
    )


def _by_nearest(
    grid: GridGeometry, samples: Samples, occupancy: OccupancyLayer | None
) -> Interpolation:
    tree = cKDTree(samples.points_xy)
    centers = grid.centers(*np.divmod(np.arange(grid.width * grid.height), grid.width))
    distances, owners = map(np.asarray, tree.query(centers))
    nowhere = (distances.reshape(grid.shape) > _MARGIN) | ~floor_cells(grid, occupancy)
    # How wrong each sample's neighbor is about it; of one sample, nobody knows.
    error = math.nan
    if len(samples) > 1:
        others = np.asarray(tree.query(samples.points_xy, k=2)[1])[:, 1]
        error = math.sqrt(np.mean((samples.values - samples.values[others]) ** 2))
    return Interpolation(
        grid,
        np.where(nowhere, np.nan, samples.values[owners].reshape(grid.shape)),
        np.where(nowhere, np.nan, error),
        0.0,
        "nearest",
        {},
    )


def _observed(
    lattice: Lattice, samples: Samples, half_life: float | None, newest: float
) -> Observations:
    """Return samples as observations; older ones than the newest are less precise."""
    ages = np.zeros(len(samples)) if half_life is None else (newest - samples.stamps) / half_life
    precision = np.exp2(-np.minimum(ages, _OLDEST))
    if len(samples) > _MOST_APART and not samples.is_below.any():
        return _by_place(lattice, samples, precision)
    return Observations(lattice.weights_at(samples.points_xy), samples.values, precision)


def _by_place(lattice: Lattice, samples: Samples, precision: NDArray[np.float64]) -> Observations:
    """Return the means of the samples in each small square as observations."""
    side = min(_SAME_PLACE * lattice.grid.resolution, _SAME_PLACE_AT_MOST)
    places, values = samples.points_xy, samples.values
    rows, cols = np.floor((places - places.min(axis=0)) / side).astype(np.int64).T
    _, square = np.unique(rows * (cols.max() + 1) + cols, return_inverse=True)
    sums = np.asarray(np.bincount(square, precision), dtype=np.float64)
    x, y, mean = (np.bincount(square, precision * each) / sums for each in (*places.T, values))
    scatter = float((precision * (values - mean[square]) ** 2).sum())
    weights = lattice.weights_at(np.column_stack([x, y]))
    return Observations(weights, mean, sums, len(values) - len(sums), scatter)


def grid_around(samples: Samples, resolution: float | None = None) -> GridGeometry:
    """Return the grid of the cells that samples are interpolated to.

    Args:
        samples: at least one.
        resolution: as `interpolate` takes it.

    Raises:
        HypermapError: If the samples are too far apart, a value is absurdly large, or the
            resolution is too fine or none.
    """
    _check_numbers(samples)
    try:
        check_resolution(_RESOLUTION if resolution is None else resolution)
    except ValueError as error:
        raise HypermapError(str(error)) from None
    if resolution is None:
        return _at_most(padded_grid(samples.points_xy, _MARGIN, _RESOLUTION), _NODES)
    grid = padded_grid(samples.points_xy, _MARGIN, resolution)
    if grid.width * grid.height > _MOST_CELLS:
        raise HypermapError(
            f"a resolution of {resolution:g} m makes {grid.width} x {grid.height} cells, more than "
            f"the {_MOST_CELLS} that can be interpolated; take a coarser one"
        )
    return grid


def _at_most(grid: GridGeometry, nodes: int) -> GridGeometry:
    """Return the grid, with larger cells where it has too many."""
    count = grid.width * grid.height
    if count <= nodes:
        return grid
    factor = math.ceil(math.sqrt(count / nodes))
    width, height = math.ceil(grid.width / factor), math.ceil(grid.height / factor)
    return GridGeometry(width, height, grid.resolution * factor, grid.origin)
