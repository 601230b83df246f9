"""The result of a query across layers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hypermap.core.objects import SemanticObject


@dataclass(frozen=True, eq=False)
class Found:
    """Something that a question across layers has found.

    Attributes:
        layer: name of the layer that holds it.
        point_xy: its location in the base frame [m], shape (2,); an object's centroid.
        distance: meters to what the question named; None where it named nothing to be near to.
        object: the object, its footprint in the base frame; None in layers without objects.
    """

    layer: str
    point_xy: NDArray[np.float64]
    distance: float | None = None
    object: SemanticObject | None = None


@dataclass(frozen=True, eq=False)
class FoundObject(Found):
    """An object that a question has found; as `Found`, but there always is one."""

    object: SemanticObject = field(kw_only=True)
