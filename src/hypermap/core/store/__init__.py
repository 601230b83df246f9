"""Stores and finds the objects of a semantic layer. `ObjectStore` is its only interface.

An `ObjectStore` is the content of a layer at one moment. `object_log` is the change log, and a
`Snapshot` of it says which rows exist. `at_points`, `in_areas` and `named` answer queries on a
snapshot; `changes` makes the next one. `box_grid` and `recent_boxes` find bounding boxes, and
`outlines` tests points exactly. `placed` combines the stores of several layers in one frame.
`KeptObjects` is what a layer asks of its objects; others can answer it, as the shared store does.
"""

from hypermap.core.store.kept_objects import KeptObjects
from hypermap.core.store.object_store import ObjectStore
from hypermap.core.store.placed import Matches, Placed, PlacedLayer, PlacedLayers

__all__ = ["KeptObjects", "Matches", "ObjectStore", "Placed", "PlacedLayer", "PlacedLayers"]
