"""What the options of a query may be, in a map."""

from __future__ import annotations

from collections.abc import Iterable

from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer

STATES = ("Free", "Occupied", "Unknown")
"""What the cells of an occupancy layer are."""


def values_of(hypermap: Hypermap, option: str) -> Iterable[str]:
    """Return the possible values of a query's option; nothing where there are too many to tell."""
    if option == "--layer":
        return [layer.name for layer in hypermap]
    if option == "--frame":
        return dict.fromkeys([layer.frame_id for layer in hypermap] + hypermap.frames.frames)
    if option == "--by":
        return ("air", "path")
    if option == "--measured":
        return [layer.name for layer in hypermap if isinstance(layer, ValueLayer)]
    if option not in ("--name", "--near", "--inside", "--in", "--with"):
        return ()
    layers = [layer for layer in hypermap if isinstance(layer, SemanticLayer)]
    names = sorted({str(name) for layer in layers for name in layer.names})
    has_grid = any(isinstance(layer, OccupancyLayer) for layer in hypermap)
    return [*names, *(STATES if option == "--name" and has_grid else ())]
