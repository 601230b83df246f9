"""Names for the arrays that travel through the package, and the checks made once at its joints."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.floating[Any]]
IntArray: TypeAlias = NDArray[np.signedinteger[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]
ObjectArray: TypeAlias = NDArray[np.object_]


def as_points_xy(points: ArrayLike) -> NDArray[np.float64]:
    """Return points as a float64 array of shape (N, 2); a single point becomes (1, 2).

    Raises:
        ValueError: If the shape is another or a coordinate is not finite.

    >>> as_points_xy([1, 2]).shape
    (1, 2)
    """
    array = np.asarray(points, dtype=np.float64)
    if array.size == 0:
        return np.empty((0, 2))
    if array.ndim == 1:
        array = array[np.newaxis]
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"points must have shape (N, 2), got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError("points must be finite; there is a NaN or infinite coordinate")
    return array
