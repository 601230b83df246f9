"""How large one object is seen to be: what is much larger than any view is more than one object.

Shelves in a row, desks or beds that touch: footprints of single frames reach over the next one, so
that the tracks of two overlap. But each frame shows one of them in a box of its own, so no view is
as long as two.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.tracks import Track

_MOST = 0.9  # quantile of the views of a class; larger ones are often cut out wrongly
_ABSORBED = 1.05  # a track that grows no more than this takes in a piece of itself


def may_be_one(
    one: tuple[Track, PreparedPolygon],
    other: tuple[Track, PreparedPolygon],
    like: Iterable[Track],
    max_growth: float,
) -> bool:
    """Return whether two tracks together are small enough for one object.

    Together, they may be `max_growth` times as long as the longest view of them, or as nine of ten
    views of their class, and take so much more floor in both directions. A track that is too large
    already may still take in what is nearly inside of it.

    Args:
        one: a track and its shape.
        other: another one of the same class, likewise.
        like: all tracks of this class.
        max_growth: at least 1; infinite if any size will do.
    """
    if max_growth == np.inf:
        return True
    one_shape, other_shape = one[1], other[1]
    size = _size(hull_of_both(one_shape, other_shape))
    absorbing = _ABSORBED * np.maximum(_size(one_shape), _size(other_shape))
    growth = np.array([max_growth, max_growth**2])
    seen = np.vstack([one[0].buffer.sizes, other[0].buffer.sizes]).max(axis=0, initial=0)
    largest = np.maximum(absorbing, growth * seen)
    if (size <= largest).all():
        return True
    views = np.vstack([np.empty((0, 2)), *(track.buffer.sizes for track in like)])
    usual = np.quantile(views, _MOST, axis=0) if len(views) else np.zeros(2)
    return bool((size <= np.maximum(largest, growth * usual)).all())


def hull_of_both(one: PreparedPolygon, other: PreparedPolygon) -> PreparedPolygon:
    """Return the convex hull of two shapes together."""
    both = shapely.union(one.geometry, other.geometry)
    return PreparedPolygon.of(shapely.convex_hull(both))


def _size(shape: PreparedPolygon) -> NDArray[np.float64]:
    return np.array([shape.diameter, shape.area])
