"""Hypermap: semantic maps for mobile robots.

Open a map with `open_map`, query it, and write it with `save_map`. Each name here is imported
when it is first used.
"""

import importlib
import logging
from typing import TYPE_CHECKING, Any

from hypermap._compiled import find_a_cache
from hypermap._lazy import attribute
from hypermap.core.outside import offer

if TYPE_CHECKING:
    from hypermap._version import __version__
    from hypermap.core.errors import (
        FileMissing,
        FormatError,
        FrameError,
        HypermapError,
        LayerNotFound,
        MissingExtra,
    )
    from hypermap.core.frames import FrameTree, Pose2D, Transform
    from hypermap.core.grid import GridGeometry
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.layer import Hits, Layer
    from hypermap.core.notes import Note
    from hypermap.core.notes_layer import NotesLayer
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.core.opaque import OpaqueLayer
    from hypermap.core.semantic import SemanticLayer, SemanticObject
    from hypermap.core.value_layer import ValueLayer
    from hypermap.formats.grid.map_server import load_occupancy
    from hypermap.formats.hmap import open_map, save_map
    from hypermap.formats.semantic.geojson import from_geojson, to_geojson
    from hypermap.formats.semantic.geopandas_bridge import from_geodataframe, to_geodataframe
    from hypermap.perception.embedders.load import load_embedder
    from hypermap.viewer.object_pictures import image_of
    from hypermap.viewer.picture import render
    from hypermap.viewer.plot import plot

_HOMES = {
    name: module
    for module, names in {
        "hypermap._version": "__version__",
        "hypermap.core.errors": (
            "FileMissing FormatError FrameError HypermapError LayerNotFound MissingExtra"
        ),
        "hypermap.core.frames": "FrameTree Pose2D Transform",
        "hypermap.core.grid": "GridGeometry",
        "hypermap.core.hypermap": "Hypermap",
        "hypermap.core.layer": "Hits Layer",
        "hypermap.core.notes": "Note",
        "hypermap.core.notes_layer": "NotesLayer",
        "hypermap.core.occupancy": "OccupancyLayer",
        "hypermap.core.opaque": "OpaqueLayer",
        "hypermap.core.semantic": "SemanticLayer SemanticObject",
        "hypermap.core.value_layer": "ValueLayer",
        "hypermap.formats.semantic.geojson": "from_geojson to_geojson",
        "hypermap.formats.semantic.geopandas_bridge": "from_geodataframe to_geodataframe",
        "hypermap.formats.hmap": "open_map save_map",
        "hypermap.formats.grid.map_server": "load_occupancy",
        "hypermap.perception.embedders.load": "load_embedder",
        "hypermap.viewer.object_pictures": "image_of",
        "hypermap.viewer.picture": "render",
        "hypermap.viewer.plot": "plot",
    }.items()
    for name in names.split()
}

__all__ = [
    "FileMissing",
    "FormatError",
    "FrameError",
    "FrameTree",
    "GridGeometry",
    "Hits",
    "Hypermap",
    "HypermapError",
    "Layer",
    "LayerNotFound",
    "MissingExtra",
    "Note",
    "NotesLayer",
    "OccupancyLayer",
    "OpaqueLayer",
    "Pose2D",
    "SemanticLayer",
    "SemanticObject",
    "Transform",
    "ValueLayer",
    "__version__",
    "from_geodataframe",
    "from_geojson",
    "image_of",
    "load_embedder",
    "load_occupancy",
    "open_map",
    "plot",
    "render",
    "save_map",
    "to_geodataframe",
    "to_geojson",
]

find_a_cache()
logging.getLogger(__name__).addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)


def _for_the_core(name: str) -> Any:
    others = {
        "as_of": "hypermap.history",
        "ask_map": "hypermap.questions.asking",
        "embedder_in_use": "hypermap.perception.embedders.load",
        "nearest_by_path": "hypermap.paths.planner",
        "open_site": "hypermap.fleet.store.stored_map",
        "refuse_pointer": "hypermap.formats.store",
        "stand_in_rooms": "hypermap.rooms.questions",
        "write_file": "hypermap.formats.atomic",
    }
    home = (_HOMES | others).get(name, "hypermap.viewer.notebook")
    return getattr(importlib.import_module(home), name)


offer(_for_the_core)


def __dir__() -> list[str]:
    return __all__
