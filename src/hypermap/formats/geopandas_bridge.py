"""Semantic layers as GeoDataFrames; the only module that imports geopandas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypermap.core.errors import MissingExtra
from hypermap.core.semantic import SemanticLayer
from hypermap.formats.crs import engineering_wkt
from hypermap.formats.records import record_from_object

if TYPE_CHECKING:
    from geopandas import GeoDataFrame


def to_geodataframe(layer: SemanticLayer) -> GeoDataFrame:
    """Return one row per object: its id (the index), name, what else is known, and geometry.

    Coordinates are metres in the layer's frame; the coordinate reference system has its name.

    Raises:
        MissingExtra: If geopandas is not installed.
    """
    try:
        import geopandas
    except ImportError:
        raise MissingExtra("a GeoDataFrame", "geo") from None
    objects = layer.objects()
    columns = dict.fromkeys(["name", "tags", "confidence", "existence", "first_seen", "last_seen"])
    records = [record_from_object(item) for item in objects]
    for record in records:
        columns.update(dict.fromkeys(record))
    return geopandas.GeoDataFrame(
        {key: [record.get(key) for record in records] for key in columns},
        geometry=[item.footprint for item in objects],
        index=[item.id for item in objects],
        crs=engineering_wkt(layer.frame_id),
    ).rename_axis("id")
