"""Random objects and maps, and how to tell whether two are exactly the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
words = texts.filter(bool)
finite = st.floats(allow_nan=False, allow_infinity=False)
# GEOS divides by lengths of 1e-200 m, which numpy warns about; no robot measures them.
meters = st.floats(-1e9, 1e9).map(lambda value: value if abs(value) > 1e-12 else 0.0)
points = st.tuples(meters, meters)
rings = st.lists(points, min_size=3, max_size=6)
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | finite | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=6,
)


@st.composite
def polygons(draw: st.DrawFn) -> shapely.Polygon:
    """Any rings at all: crossing themselves, without area, holes outside, wound either way."""
    return shapely.Polygon(draw(rings), draw(st.lists(rings, max_size=2)))


footprints = polygons() | st.lists(polygons(), min_size=1, max_size=3).map(shapely.MultiPolygon)

objects = st.builds(
    SemanticObject,
    name=texts,
    footprint=footprints,
    tags=st.lists(texts, max_size=3).map(tuple),
    confidence=st.lists(finite, max_size=3).map(tuple),
    existence=st.none() | finite,
    first_seen=st.none() | finite,
    last_seen=st.none() | finite,
    attributes=st.dictionaries(
        texts | st.sampled_from(["name", "shape", "id", "attributes", "tags"]), plain, max_size=3
    ),
)

ids = st.integers(0, 2**31 - 1)


@st.composite
def semantic_layers(
    draw: st.DrawFn, name: str = "semantic", frame_id: str = "map"
) -> SemanticLayer:
    items = draw(st.lists(objects, max_size=4))
    numbers = draw(
        st.lists(ids | st.integers(0, 5), min_size=len(items), max_size=len(items), unique=True)
    )
    numbered = [
        SemanticObject(**{**vars(item), "id": number})
        for item, number in zip(items, numbers, strict=True)
    ]
    return SemanticLayer(name, frame_id, numbered)


@st.composite
def occupancy_layers(draw: st.DrawFn, name: str, frame_id: str) -> OccupancyLayer:
    width, height = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    origin = draw(st.builds(Pose2D, meters, meters, finite))
    grid = GridGeometry(width, height, draw(st.floats(1e-3, 1e3)), origin)
    values = draw(st.lists(st.integers(-1, 255), min_size=width * height, max_size=width * height))
    return OccupancyLayer(name, frame_id, grid, np.array(values, np.int16).reshape(height, width))


@st.composite
def hypermaps(draw: st.DrawFn) -> Hypermap:
    """Maps of layers with any names, each in a frame of its own or in the base frame."""
    names = draw(st.lists(words, max_size=3, unique=True))
    frames = FrameTree()
    layers: list[Layer] = []
    for number, name in enumerate(names):
        frame_id = f"frame{number}" if number and draw(st.booleans()) else "map"
        if frame_id != "map":
            frames.add(Transform("map", frame_id, draw(st.builds(Pose2D, meters, meters, finite))))
        kind = draw(st.sampled_from(["occupancy", "semantic", "empty", "opaque"]))
        if kind == "occupancy":
            layers.append(draw(occupancy_layers(name, frame_id)))
        elif kind == "semantic":
            layers.append(draw(semantic_layers(name, frame_id)))
        elif kind == "empty":
            layers.append(OccupancyLayer(name, frame_id))
        else:
            files = {f"opaque{number}.{end}": draw(st.binary(max_size=9)) for end in ("a", "b")}
            settings = {"file": f"opaque{number}"}
            layers.append(OpaqueLayer("RoomLayer", name, frame_id, files, settings=settings))
    return Hypermap(layers, frames, draw(st.dictionaries(words, plain, max_size=2)))


def object_facts(item: SemanticObject) -> list[Any]:
    """Everything about an object, in a form that is equal only where every bit is."""
    values = {key: value for key, value in vars(item).items() if key != "footprint"}
    values["attributes"] = dict(sorted(item.attributes.items()))
    return [repr(values), exact(item.footprint)]


def exact(geometry: BaseGeometry) -> list[Any]:
    coordinates = shapely.get_coordinates(geometry)
    return [geometry.geom_type, repr(shapely.to_wkt(geometry, 0)), repr(coordinates.tolist())]


def layer_facts(layer: Layer) -> list[Any]:
    """Everything about a layer but where its files lie."""
    facts: list[Any] = [layer.class_name, layer.name, layer.frame_id]
    if isinstance(layer, SemanticLayer):
        facts += [[object_facts(item) for item in layer.objects()], layer.rejected]
    elif isinstance(layer, OccupancyLayer):
        facts += [repr(layer.grid), None if layer.cells is None else layer.cells.tolist()]
    elif isinstance(layer, OpaqueLayer):
        facts += [layer.files, layer.load_file]
    return facts


def map_facts(hypermap: Hypermap) -> list[Any]:
    """Everything about a map but where its files lie."""
    return [
        [layer_facts(layer) for layer in hypermap.layers],
        repr(list(hypermap.frames)),
        repr(hypermap.metadata),
    ]
