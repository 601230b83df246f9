"""Array types used throughout the package, and the checks at its interfaces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import isfinite
from typing import Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.floating[Any]]
IntArray: TypeAlias = NDArray[np.signedinteger[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]
ObjectArray: TypeAlias = NDArray[np.object_]

PointsLike: TypeAlias = ArrayLike | shapely.Point | shapely.MultiPoint | Sequence[shapely.Point]
"""Points [m]: numbers of shape (N, 2) or (2,), a shapely (Multi)Point, or an array of Points."""

_SEQUENCES = list, tuple


def _keep_memory() -> None:
    """Let the C library keep the memory of one query, or one frame, for the next.

    On Linux it returns large blocks to the system when they are freed. Getting them again page by
    page takes a tenth of the time of a frame, or of a query with many answers. Once a block of
    32 MB has been freed, it keeps that much.

    Source: mallopt(3), M_MMAP_THRESHOLD, which "is dynamic by default".
    """
    np.empty(2**25 - 2**13, np.uint8)  # never written to, so it takes no memory


_keep_memory()


def as_points_xy(points: PointsLike) -> NDArray[np.float64]:
    """Return points as a float64 array of shape (N, 2); a single point becomes (1, 2).

    Raises:
        ValueError: If the shape is wrong or a coordinate is not finite.
        TypeError: If they are neither numbers nor shapely points.

    >>> as_points_xy([1, 2]).shape
    (1, 2)
    """
    try:
        given = np.asarray(points, dtype=np.float64)
    except TypeError:
        given = _coordinates(points)
    array = given.reshape(-1, 2) if given.shape in ((0,), (2,)) else given
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"points must have shape (N, 2), got {given.shape}")
    # Queries for a single point are so frequent that numpy's calls would cost noticeable time.
    few = array[0].tolist() if len(array) == 1 else []
    is_finite = all(map(isfinite, few)) if few else np.isfinite(array).all()
    if not is_finite:
        raise ValueError("points must be finite; there is a NaN or infinite coordinate")
    return array


def _coordinates(points: Any) -> NDArray[np.float64]:
    """Return the coordinates of shapely points, shape (N, 2)."""
    parts = points.geoms if isinstance(points, shapely.MultiPoint) else points
    shapes = np.asarray(parts, dtype=object)
    for item in shapes.flat:
        if not isinstance(item, shapely.Point):
            kind = type(item).__name__
            raise TypeError(f"points must be numbers, shape (N, 2), or shapely Points, got {kind}")
        if item.is_empty:
            raise ValueError("points must have coordinates; one of them is empty")
    return np.asarray(shapely.get_coordinates(shapes))


def as_point_xy(point: PointsLike) -> NDArray[np.float64]:
    """Return one point as a float64 array of shape (2,).

    Raises:
        ValueError: If it is not one point, or a coordinate is not finite.
    """
    points = as_points_xy(point)
    if len(points) != 1:
        raise ValueError(f"expected a single point, got {len(points)}")
    first: NDArray[np.float64] = points[0]
    return first


def single_xy(points: PointsLike) -> tuple[float, float] | None:
    """Return x and y if this is a single valid point, faster than `as_points_xy`.

    Only for the most frequent kinds, two floats or an array of them; otherwise None.

    >>> single_xy([1.0, 2.0])
    (1.0, 2.0)
    """
    given = points.tolist() if isinstance(points, np.ndarray) and points.size == 2 else points
    if not isinstance(given, _SEQUENCES):
        return None
    pair = given[0] if len(given) == 1 else given
    if not isinstance(pair, _SEQUENCES) or len(pair) != 2:
        return None
    x, y = pair
    is_good = isinstance(x, float) and isinstance(y, float) and isfinite(x) and isfinite(y)
    return (x, y) if is_good else None


def as_objects(items: Iterable[Any]) -> ObjectArray:
    """Return Python objects as an array of shape (N,), even if they are sequences.

    >>> as_objects([(1, 2), (3, 4)]).shape
    (2,)
    """
    return np.fromiter(items, dtype=object)


def of_rows(table: NDArray[Any], rows: IntArray) -> NDArray[Any]:
    """Return `table[rows]`; ten times as fast for a table of columns."""
    return table[rows] if table.ndim == 1 else table.take(rows, axis=0)


def as_view(array: NDArray[Any]) -> memoryview[Any]:
    """Return a view of numbers, shape (N,); single ones are read from it several times faster."""
    return memoryview(np.ascontiguousarray(array))  # type: ignore[arg-type]  # numpy's stubs


def true_in(flat: BoolArray) -> IntArray:
    """Return the same as `numpy.flatnonzero`; twice as fast for sparse masks.

    Args:
        flat: shape (N,).

    >>> true_in(np.array([False, True, True]))
    array([1, 2])
    """
    whole = len(flat) - len(flat) % 8
    words = np.ascontiguousarray(flat[:whole]).view(np.uint64)
    places = np.flatnonzero(words != 0)
    if 2 * len(places) > len(words):
        return np.flatnonzero(flat)
    letters = np.flatnonzero(words[places].view(np.bool_))
    rest = np.flatnonzero(flat[whole:]) + whole
    return np.concatenate([(places[letters >> 3] << 3) + (letters & 7), rest])
