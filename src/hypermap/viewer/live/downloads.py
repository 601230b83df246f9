"""The objects of an area as files: CSV for spreadsheets, GeoJSON for GIS programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats.semantic.geojson import to_geojson
from hypermap.spreadsheet import as_csv

_COLUMNS = (
    "layer", "id", "name", "x", "y", "area", "existence", "first_seen", "last_seen", "tags",
)  # fmt: skip


def rows_as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows of an answer as CSV with a head; several tags are separated by semicolons."""
    joined = ({**row, "tags": ";".join(row["tags"])} for row in rows)
    cells = ([row[column] for column in _COLUMNS] for row in joined)
    return as_csv(_COLUMNS, cells, end="\r\n")


def rows_as_geojson(hypermap: Hypermap, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the objects of an answer's rows as GeoJSON in the base frame.

    Each has its layer as the attribute `layer`. Where objects of two layers have the same id, all
    are numbered again, in the order of the rows.
    """
    ids = [row["id"] for row in rows]
    objects = []
    for number, row in enumerate(rows):
        layer = hypermap[row["layer"]]
        assert isinstance(layer, SemanticLayer)  # rows are objects
        item = layer.get(row["id"])
        pose = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
        placed = replace(
            item,
            id=item.id if len(set(ids)) == len(ids) else number,
            footprint=pose.apply_geometry(item.footprint),
            attributes={**item.attributes, "layer": layer.name},
        )
        objects.append(placed)
    return to_geojson(SemanticLayer("area", hypermap.base_frame, objects))
