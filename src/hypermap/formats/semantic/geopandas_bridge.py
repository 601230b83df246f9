"""Semantic layers as GeoDataFrames and back; the only module that imports geopandas."""

from __future__ import annotations

import collections
import json
import math
import tempfile
import warnings
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from hypermap.core.arguments import check_kind
from hypermap.core.errors import FormatError, MissingExtra
from hypermap.core.hypermap import Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.core.semantic import SemanticLayer
from hypermap.formats.columns.crs import System, engineering_wkt, frame_of
from hypermap.formats.letters import check_savable
from hypermap.formats.semantic.records import object_from_record, record_from_object
from hypermap.formats.yaml_text import plain_value

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

_WHERE = "the GeoDataFrame"
_COLUMNS = ["name", "tags", "confidence", "existence", "first_seen", "last_seen"]


def to_geodataframe(source: SemanticLayer | Hypermap) -> GeoDataFrame:
    """Return one row per object: its id (the index), name, what else is known, and geometry.

    Coordinates are meters in the layer's frame, or in the base frame of a map, whose objects have
    the name of their layer in the column `layer`; ids are unique within a layer. Layers that no
    transform connects to that frame are left out and logged. The coordinate reference system has
    the frame's name.

    Raises:
        MissingExtra: If geopandas is not installed.
        HypermapError: If a text holds half of a character.
        TypeError: If it is neither a semantic layer nor a map.
    """
    check_kind(source, SemanticLayer, Hypermap)
    geopandas = _geopandas()
    if isinstance(source, Hypermap):
        found = source.objects()
        items, frame_id = [hit.object for hit in found], source.base_frame
        layers = {"layer": [hit.layer for hit in found]}
    else:
        items, frame_id, layers = source.objects(), source.frame_id, {}
    records = [record_from_object(item) for item in items]
    columns = dict.fromkeys(_COLUMNS)
    for record in records:
        columns.update(dict.fromkeys(record))
    try:
        return geopandas.GeoDataFrame(
            {key: [record.get(key) for record in records] for key in columns} | layers,
            geometry=[item.footprint for item in items],
            index=[item.id for item in items],
            crs=engineering_wkt(frame_id),
        ).rename_axis("id")
    except UnicodeEncodeError as error:
        check_savable(error.object, "a text")
        raise


def _geopandas() -> ModuleType:
    try:
        import geopandas
    except ImportError:
        raise MissingExtra("a GeoDataFrame", "geo") from None
    module: ModuleType = geopandas
    return module


def to_geopackage(layer: SemanticLayer) -> bytes:
    """Return a layer's objects as the content of a GeoPackage, in a table of the layer's name.

    Lists and mappings, which it does not know, are JSON.

    Raises:
        MissingExtra: If geopandas is not installed.
        FormatError: If GDAL cannot write it, as a column that is named `fid`.
    """
    check_savable(layer.name, "the layer's name")
    check_savable(layer.frame_id, "the layer's frame")
    frame = to_geodataframe(layer)
    for name in frame.columns.drop("geometry"):
        check_savable(str(name), "an attribute")
        if frame[name].dtype == object:
            frame[name] = [_text(value) for value in frame[name]]
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of GDAL's, on what is about to be written
        path = Path(folder, "objects.gpkg")
        try:
            frame.to_file(path, driver="GPKG", layer=layer.name, index=True)
        except (RuntimeError, ValueError, TypeError) as error:
            raise FormatError(f"cannot be written as GeoPackage: {error}", key=layer.name) from None
        return path.read_bytes()


def _text(value: Any) -> Any:
    plain = plain_value(value, "an attribute")
    if plain is None or isinstance(plain, str):
        return plain
    return json.dumps(plain, ensure_ascii=False, default=str)


def from_geodataframe(
    frame: GeoDataFrame, name: str = "semantic", frame_id: str | None = None
) -> SemanticLayer:
    """Return the layer whose objects are the rows of a GeoDataFrame.

    Columns are those of `to_geodataframe`; others become attributes, and what is missing in a row
    is left out. The ids are those of a column `id`, or of an index of that name; without either,
    the layer gives them.

    Args:
        frame: polygons and multipolygons in meters, with a column `name`.
        name: the layer's name.
        frame_id: the frame of the coordinates; None takes the one that the coordinate reference
            system names.

    Raises:
        FormatError: Naming the row that is wrong; or if the coordinates are not meters of a frame.
        MissingExtra: If geopandas is not installed.
        TypeError: If it is not a GeoDataFrame.
    """
    check_kind(frame, _geopandas().GeoDataFrame)
    frame_id = frame_of(_system_of(frame), frame_id, _WHERE, "crs")
    geometries, rows = list(frame.geometry), frame.drop(columns=frame.geometry.name)
    if rows.index.name == "id" and "id" not in rows:
        rows = rows.reset_index()
    records = enumerate(rows.to_dict("records"))
    objects = [_object(row, record, geometries[row]) for row, record in records]
    ids = collections.Counter(item.id for item in objects if item.id is not None)
    for number, count in ids.most_common(1):
        if count > 1:
            raise FormatError(f"the id {number} appears twice", path=_WHERE, key="id")
    return SemanticLayer(name, frame_id, objects)


def _system_of(frame: GeoDataFrame) -> System | None:
    """Return the coordinate reference system that a table names."""
    if frame.crs is None:
        return None
    name = str(frame.crs.name)
    return System(name, name if frame.crs.is_engineering else None)


def _object(row: int, record: dict[Any, Any], geometry: Any) -> SemanticObject:
    try:
        return object_from_record(_known(record), geometry)
    except ValueError as error:
        raise FormatError(str(error), path=_WHERE, key=f"row {row}") from None


def _known(record: dict[Any, Any]) -> dict[Any, Any]:
    """Return the known fields of an object, as plain Python values."""
    plain = {
        key: value.tolist() if isinstance(value, np.ndarray | np.generic) else value
        for key, value in record.items()
    }
    known = {key: value for key, value in plain.items() if not _is_missing(value)}
    number = known.get("id")
    if isinstance(number, float) and number.is_integer():  # in a column with missing values
        known["id"] = int(number)
    return known


def _is_missing(value: Any) -> bool:
    """Return whether pandas uses this value for a missing one."""
    is_nan = isinstance(value, float) and math.isnan(value)
    return value is None or is_nan or type(value).__name__ in ("NAType", "NaTType")
