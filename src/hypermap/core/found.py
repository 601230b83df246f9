"""The result of a query across layers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hypermap.core.objects import SemanticObject


@dataclass(frozen=True, eq=False)
class Found:
    """One result of a query across layers.

    Attributes:
        layer: name of the layer that holds it.
        point_xy: its location in the base frame [m], shape (2,); an object's centroid.
        distance: meters to the point or object in the query; None if the query has none.
        object: the object, with its footprint in the base frame; None in layers without objects.
    """

    layer: str
    point_xy: NDArray[np.float64]
    distance: float | None = None
    object: SemanticObject | None = None


@dataclass(frozen=True, eq=False)
class FoundObject(Found):
    """An object in the result of a query; as `Found`, but `object` is never None."""

    object: SemanticObject = field(kw_only=True)
