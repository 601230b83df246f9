"""Semantic layers as CSV, for spreadsheets and scripts: a row per object."""

from __future__ import annotations

import json
from typing import Any

import shapely

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats.semantic.records import record_from_object
from hypermap.formats.yaml_text import plain_value
from hypermap.spreadsheet import as_csv

_FIRST = ("id", "name", "x", "y", "area", "existence", "first_seen", "last_seen", "tags")
_GEOMETRY = "geometry"
_DECIMALS = 9  # of meters


def to_csv(layer: SemanticLayer) -> str:
    """Return a layer's objects as CSV text (RFC 4180) with a header.

    `x` and `y` are the centroid [m] and `area` that of the shape [m^2]; both and the `geometry`
    (well-known text) are in the layer's frame, to a nanometer. What is more than a number or a
    text, as `tags`, is JSON. Attributes stand behind, in the order of their first object.
    """
    table = layer.table
    middles, areas = table.centroids.round(_DECIMALS), table.areas.round(_DECIMALS)
    measured = zip(middles.tolist(), areas.tolist(), strict=True)
    rows = [_row(table.object(row), *both) for row, both in enumerate(measured)]
    others = dict.fromkeys(key for row in rows for key in row)
    columns = [*_FIRST, *(key for key in others if key not in (*_FIRST, _GEOMETRY)), _GEOMETRY]
    cells = ([row.get(column) for column in columns] for row in rows)
    return as_csv(columns, cells, end="\r\n")


def _row(item: SemanticObject, middle: list[float], area: float) -> dict[str, Any]:
    own = {"id": item.id, "x": middle[0], "y": middle[1], "area": area}
    checked = plain_value(record_from_object(item), f"object {item.id}")
    record = {str(key): _cell(value) for key, value in checked.items()}
    # An attribute may have the name of one of our columns.
    return {
        **record,
        **own,
        _GEOMETRY: shapely.to_wkt(item.footprint, rounding_precision=_DECIMALS),
    }


def _cell(value: Any) -> Any:
    """Return a number or text as it is, and everything else as JSON."""
    if value is None or isinstance(value, str | float) or type(value) is int:
        return value
    return json.dumps(value, ensure_ascii=False, default=str)
