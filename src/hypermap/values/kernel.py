"""Kernel DM+V, a quick way to estimate a quantity and how much it varies.

A. J. Lilienthal, M. Reggente, M. Trincavelli, J. L. Blanco and J. Gonzalez: A statistical approach
to gas distribution modelling with mobile robots: the Kernel DM+V algorithm. IROS 2009. It knows no
walls. Samples count at the nodes that are nearest to them, and the Gaussian kernel is a filter over
the grid, so that its time does not depend on the number of samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.optimize import minimize_scalar

from hypermap.core.grid import GridGeometry
from hypermap.core.samples import Samples

_Cells = NDArray[np.float64]
_REACH = 4.0  # standard deviations, beyond which a kernel is 0


def kernel_estimate(
    grid: GridGeometry, samples: Samples, width: float | None = None
) -> tuple[_Cells, _Cells, _Cells, float]:
    """Return values, standard deviations and confidences of cells, and the kernel's width.

    Args:
        grid: of the cells, (height, width).
        samples: on the grid, at least two; limits count as values.
        width: standard deviation of the kernel [m]; without it that which predicts each sample best
            from all others.

    Returns:
        Three arrays of the grid's shape and the width [m]. Confidence is 0 where no sample is
        near, and 1 where there are many.
    """
    rows, cols = np.clip(grid.cells_at(samples.points_xy), 0, np.array(grid.shape) - 1).T
    counted = _Counted(grid.shape, rows, cols, samples.values)
    side = grid.resolution
    if width is None:
        longest = max(2.0, max(grid.shape) / 4)
        found = minimize_scalar(
            lambda log_width: counted.error(float(np.exp(log_width))),
            bounds=(np.log(0.5), np.log(longest)),
            method="bounded",
        )
        width = side * float(np.exp(found.x))
    values, deviations, confidence = counted.estimate(width / side)
    return values, deviations, confidence, width


class _Counted:
    """Samples by cells."""

    def __init__(
        self,
        shape: tuple[int, int],
        rows: NDArray[np.int64],
        cols: NDArray[np.int64],
        values: NDArray[np.float64],
    ) -> None:
        self._shape, self._rows, self._cols, self._values = shape, rows, cols, values
        self._mean = float(values.mean())

    def estimate(self, width: float) -> tuple[_Cells, _Cells, _Cells]:
        """Return values, deviations and confidences for a kernel of a width in cells."""
        weights, values = self._smooth(width, self._values - self._mean)
        confidence = 1 - np.exp(-((weights / _top(width)) ** 2))
        mean = self._mean + confidence * values
        errors = (self._values - mean[self._rows, self._cols]) ** 2
        _, variances = self._smooth(width, errors)
        spread = confidence * variances + (1 - confidence) * float(errors.mean())
        return mean, np.sqrt(spread), confidence

    def error(self, width: float) -> float:
        """Return the mean squared error of samples that are predicted from all others."""
        weights, values = self._smooth(width, self._values - self._mean)
        own = _top(width)
        weight = weights[self._rows, self._cols]
        pull = weight * values[self._rows, self._cols]
        left = np.maximum(weight - own, 1e-12 * own)
        others = (pull - own * (self._values - self._mean)) / left
        share = 1 - np.exp(-((left / own) ** 2))
        return float(np.mean((self._values - self._mean - share * others) ** 2))

    def _smooth(self, width: float, values: NDArray[np.float64]) -> tuple[_Cells, _Cells]:
        """Return the kernels' sum and the weighted mean of values at each cell."""
        weights, pulls = np.zeros(self._shape), np.zeros(self._shape)
        np.add.at(weights, (self._rows, self._cols), 1.0)
        np.add.at(pulls, (self._rows, self._cols), values)
        weights = _filtered(weights, width)
        return weights, _filtered(pulls, width) / np.maximum(weights, np.finfo(float).tiny)


def _filtered(cells: _Cells, width: float) -> _Cells:
    smooth: _Cells = gaussian_filter(cells, width, mode="constant", truncate=_REACH)
    return smooth


def _top(width: float) -> float:
    """Return the kernel weight of a sample in its own cell."""
    radius = int(_REACH * width + 0.5)
    line = np.exp(-0.5 * (np.arange(-radius, radius + 1) / width) ** 2)
    return float((line[radius] / line.sum()) ** 2)
