"""The history of a map as a table for other programs: CSV or GeoParquet."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from hypermap.core.arrays import as_objects
from hypermap.core.errors import HypermapError
from hypermap.core.history import Change, Revision
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticObject
from hypermap.formats.atomic import write_file
from hypermap.formats.columns.arrow import Column, Numbers, Words
from hypermap.formats.columns.footprints import footprint_to_wkt
from hypermap.formats.columns.geoparquet import write_geoparquet
from hypermap.spreadsheet import as_csv

_KEYS = (
    *("version", "time", "cause", "drive", "layer", "id", "what", "name_before", "name"),
    *("distance", "confidence", "shape_before"),
)
_TEXTS = ("time", "cause", "drive", "layer", "what", "name_before", "name", "shape_before")


def save_history_table(hypermap: Hypermap, path: str | Path) -> int:
    """Save all changes of a map's objects, a row each, oldest first; return how many there are.

    The geometry is the shape after the change, or the last one of what is gone.

    Args:
        hypermap: the map.
        path: ends in `.csv`, or in `.parquet`, which needs pyarrow.

    Raises:
        MissingExtra: If pyarrow is not installed.
        HypermapError: If the path has another ending, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise HypermapError(f"{path}: a table is saved as .csv or .parquet")
    revisions = [] if hypermap.history is None else hypermap.history.revisions()
    pairs = [(revision, change) for revision in revisions for change in revision.changes]
    rows = [_row(revision, change) for revision, change in pairs]
    objects = [change.object for _, change in pairs]
    is_csv = path.suffix.lower() == ".csv"
    write_file(path, _csv(rows, objects) if is_csv else _parquet(rows, objects, hypermap))
    return len(rows)


def _row(revision: Revision, change: Change) -> dict[str, Any]:
    before, after = change.before, change.after
    return {
        "version": revision.version,
        "time": "" if revision.time is None else _utc(revision.time),
        "cause": revision.cause,
        "drive": revision.drive,
        "layer": change.layer,
        "id": change.object.id,
        "what": change.kind,
        "name_before": "" if before is None else before.name,
        "name": "" if after is None else after.name,
        "distance": change.distance,
        "confidence": change.confidence,
        "shape_before": "" if before is None else footprint_to_wkt(before.footprint),
    }


def _utc(stamp: float) -> str:
    try:
        return datetime.fromtimestamp(stamp, timezone.utc).isoformat(timespec="milliseconds")
    except (ValueError, OverflowError, OSError):  # beyond the year 9999
        return repr(stamp)


def _csv(rows: Sequence[dict[str, Any]], objects: Sequence[SemanticObject]) -> bytes:
    cells = (
        [*(row[key] for key in _KEYS), footprint_to_wkt(item.footprint)]
        for row, item in zip(rows, objects, strict=True)
    )
    return as_csv([*_KEYS, "geometry"], cells).encode()


def _parquet(
    rows: Sequence[dict[str, Any]], objects: Sequence[SemanticObject], hypermap: Hypermap
) -> bytes:
    columns = {key: _column([row[key] for row in rows], key) for key in _KEYS}
    shapes = as_objects(item.footprint for item in objects)
    return write_geoparquet(columns, shapes, hypermap.base_frame, {})


def _column(values: Sequence[Any], key: str) -> Column:
    if key in _TEXTS:
        words = list(dict.fromkeys(values))
        at = {word: code for code, word in enumerate(words)}
        return Words(np.array([at[value] for value in values], np.int32), words)
    kind = np.int64 if key in ("version", "id") else np.float64
    there = np.array([value is not None for value in values], dtype=bool)
    return Numbers(np.array([value or 0 for value in values], kind), there)
