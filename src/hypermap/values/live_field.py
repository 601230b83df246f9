"""A random field that takes in new samples one by one.

After a sample, mean and covariance of all nodes follow from those before it and from one column of
that covariance, which the factors give that are there (a Kalman filter without motion; Rasmussen
and Williams, Gaussian Processes for Machine Learning, 2006, appendix A.3). With the same settings,
the result is that of all samples at once.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack
from threadpoolctl import threadpool_limits

from hypermap.core.arrays import PointsLike, as_points_xy
from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.values.fitting import below_limit
from hypermap.values.interpolation import Interpolation, field_of, weights_of_cells
from hypermap.values.random_field import FieldSettings, Posterior

_MOST_UPDATES = 100  # with the same factors; the memory of each is that of all nodes
_FELT = 1e-3  # of a deviation: cells that change by less wait for a sample nearer to them


class LiveField:
    """A quantity all over the floor, which new samples update.

    A sample takes milliseconds; every hundredth one solves everything from scratch. The settings
    stay those of the start. A cell changes if the sample changes it by at least a thousandth of a
    standard deviation.

    Args:
        samples: known at the start, as `interpolate` takes them, like all others.
        occupancy: walls, and where the floor is.
        settings: of the field.
        resolution: side of a cell [m].
        may_have_source: whether to look for a sender, as there.

    Raises:
        HypermapError: As `interpolate`.
    """

    def __init__(
        self,
        samples: Samples,
        occupancy: OccupancyLayer | None = None,
        *,
        settings: FieldSettings | None = None,
        resolution: float | None = None,
        may_have_source: bool = False,
    ) -> None:
        with threadpool_limits(1, "blas"):
            self._field = field_of(
                samples,
                occupancy,
                settings=settings,
                resolution=resolution,
                may_have_source=may_have_source,
            )
        self._cells = weights_of_cells(self._field.grid, self._field.lattice)
        self._columns: list[NDArray[np.float64]] = []  # each scaled, so that their squares add up
        self._observed = self._field.observed
        self.samples = samples
        self._start()

    @property
    def settings(self) -> FieldSettings:
        """The settings of the field."""
        return self._field.settings

    def covers(self, point_xy: PointsLike) -> bool:
        """Return whether a point is on the field's grid, so that a sample there can be added."""
        grid = self._field.grid
        return bool(grid.contains(*grid.cells_at(as_points_xy(point_xy)).T)[0])

    def add(
        self,
        point_xy: tuple[float, float],
        value: float,
        *,
        is_below: bool = False,
        stamp: float = math.nan,
    ) -> None:
        """Take in a sample.

        Args:
            point_xy: where it was taken, in the frame of the others [m].
            value: what it measured.
            is_below: whether `value` is a limit, and the quantity lies below it.
            stamp: when it was measured [s]; NaN if unknown.

        Raises:
            HypermapError: If the point is off the grid.
            ValueError: If a number is not finite.
        """
        sample = Samples.of([point_xy], [value], [is_below], [stamp])
        if not self.covers(point_xy):
            x, y = point_xy
            raise HypermapError(f"({x:g}, {y:g}) is off the field's grid; make a field with it")
        with threadpool_limits(1, "blas"):
            self._take(self._field.lattice.weights_at(sample.points_xy), value, is_below)
            self.samples = self.samples.joined(sample)
            if len(self._columns) >= _MOST_UPDATES:
                field = self._field
                noise = field.settings.noise / field.settings.deviation
                posterior = Posterior(field.prior, self._observed, noise, field.trends)
                self._field = replace(field, observed=self._observed, posterior=posterior)
                self._columns = []
                self._start()

    def interpolation(self) -> Interpolation:
        """Return the values now; they do not change with further samples."""
        return self._field.interpolation_with(self._values.copy(), self._deviations.copy())

    def _start(self) -> None:
        """Compute all cells."""
        field = self._field
        self._mean, self._variance = field.posterior.mean(), field.posterior.variance()
        mean, variance = ((self._cells @ each).reshape(field.grid.shape) for each in self._nodes())
        self._values, self._deviations = field.known(mean, variance, field.is_floor)

    def _take(self, weights: csr_array, value: float, is_below: bool) -> None:
        settings = self._field.settings
        noise = (settings.noise / settings.deviation) ** 2
        column = self._field.posterior.covariance_with(weights)
        here, shares = weights.indices, weights.data
        for each in self._columns:
            column -= each * float(shares @ each[here])
        spread = float(shares @ column[here])
        mean = float(shares @ self._mean[here])
        precision = 1.0
        if is_below:  # as an observation with the same effect
            scale = settings.deviation**2
            new, left = below_limit(
                np.array([mean]),
                np.array([spread * scale]),
                np.array([value]),
                np.array([noise * scale]),
            )
            gained = max(scale / float(left[0]) - 1 / spread, 1e-9 / spread)
            value = mean + (float(new[0]) - mean) * (gained + 1 / spread) / gained
            precision = gained * noise
        total = spread + noise / precision
        self._mean += column * ((value - mean) / total)
        self._variance -= column**2 / total
        column /= math.sqrt(total)
        self._columns.append(column)
        observed = self._observed
        self._observed = replace(
            observed,
            weights=csr_array(vstack([observed.weights, weights])),
            values=np.append(observed.values, value),
            precision=np.append(observed.precision, precision),
        )
        self._draw(column)

    def _draw(self, column: NDArray[np.float64]) -> None:
        """Compute the cells around the nodes that a sample changed."""
        field = self._field
        nodes, grid = field.lattice.grid, field.grid
        changed = np.abs(column).reshape(nodes.shape) > _FELT
        if not changed.any():
            return
        scale = nodes.resolution / grid.resolution
        windows = []
        for axis, length in ((1, grid.height), (0, grid.width)):
            first, last = np.flatnonzero(changed.any(axis=axis))[[0, -1]].tolist()
            begin = max(0, math.floor((first - 1) * scale))
            windows.append(slice(begin, min(length, math.ceil((last + 2) * scale))))
        rows, cols = windows
        shape = (rows.stop - rows.start, grid.width)
        some = self._cells[rows.start * grid.width : rows.stop * grid.width]
        mean, variance = ((some @ each).reshape(shape)[:, cols] for each in self._nodes())
        is_floor = field.is_floor[rows, cols]
        self._values[rows, cols], self._deviations[rows, cols] = field.known(
            mean, variance, is_floor
        )

    def _nodes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._mean, self._variance
