"""Stores and finds the objects of a semantic layer. `ObjectStore` is its only interface.

An `ObjectStore` is what a layer holds at one moment. Behind it, an `object_log` keeps what changes
have written, a `Snapshot` of the log says which of it is there, `at_points`, `in_areas` and `named`
answer questions by it, and `changes` makes the next one. `box_grid` and `recent_boxes` find boxes,
`outlines` says exactly what a shape has. `placed` puts the stores of several layers side by side.
"""

from hypermap.core.store.object_store import ObjectStore
from hypermap.core.store.placed import Matches, Placed, PlacedLayer, PlacedLayers

__all__ = ["Matches", "ObjectStore", "Placed", "PlacedLayer", "PlacedLayers"]
