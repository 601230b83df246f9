"""The evidence behind a semantic layer as a file of columns in JSON.

The specification is docs/formats/evidence.md.
"""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray
from hypermap.core.errors import FormatError
from hypermap.core.evidence import EvidenceTable
from hypermap.core.layer import Store
from hypermap.core.semantic import SemanticLayer
from hypermap.core.tangles import are_untangled, check_tangle
from hypermap.formats import limits

logger = logging.getLogger(__name__)

KEY = "evidence"
"""The key of a layer's configuration that names the file of the evidence behind its objects."""

FORMAT = "hypermap evidence"
VERSION = 1

_PER_METER = 10_000  # the unit of coordinates is 0.1 mm
_WRONG = (KeyError, TypeError, ValueError, OverflowError, IndexError, shapely.GEOSException)


class EvidenceFile:
    """Evidence as the bytes of a file, parsed at the first access.

    Attributes:
        content: the bytes.
        path: how messages name the file.
    """

    def __init__(self, content: bytes, path: str) -> None:
        self.content = content
        self.path = path
        self._table: EvidenceTable | None = None
        self._reading = threading.Lock()

    def __call__(self) -> EvidenceTable:
        """Return the evidence.

        Raises:
            FormatError: If the file cannot be read.
        """
        with self._reading:
            if self._table is None:
                self._table = parse_evidence(self.content, self.path)
            return self._table


def load_evidence(store: Store, settings: Mapping[str, Any]) -> EvidenceFile | None:
    """Return the evidence that a layer's configuration names, unparsed; None if it names none.

    Older programs do not copy the file. Without it, the map still opens, and a warning is logged.
    """
    name = settings.get(KEY)
    if not isinstance(name, str):
        return None
    try:
        return EvidenceFile(store.read(name), store.path_of(name))
    except FormatError as error:
        logger.warning("the evidence behind the objects is missing: %s", error)
        return None


def save_evidence(layer: SemanticLayer, store: Store, file: str) -> Mapping[str, Any]:
    """Write the evidence for a layer's objects next to the layer's file.

    Evidence that cannot be read is written unchanged. If there is too much, it is left out and
    logged.

    Returns:
        What the layer's configuration has to say; nothing if there is no evidence.
    """
    kept = layer.kept_evidence
    try:
        evidence = layer.evidence()
        content = dump_evidence(evidence) if evidence is not None and len(evidence) else b""
    except FormatError as error:
        logger.warning("the evidence behind the objects is unchanged: %s", error)
        content = kept.content if isinstance(kept, EvidenceFile) else b""
    if len(content) > limits.MAX_EVIDENCE_BYTES:
        megabytes = len(content) // 1_000_000
        where = f"layer {layer.name!r}"
        logger.warning("%s: its evidence is left out: %d MB are too much", where, megabytes)
        content = b""
    if not content:
        return {}
    name = f"{file}.{KEY}.json"
    store.write(name, content)
    return {KEY: name}


def without_evidence(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return a layer's configuration without the keys about evidence."""
    return {key: value for key, value in settings.items() if key != KEY}


def dump_evidence(table: EvidenceTable) -> bytes:
    """Return a file; `parse_evidence` gives the same again, rounded as `rounded` does."""
    table = table.rounded()
    document = {
        "format": FORMAT,
        "version": VERSION,
        "views": {
            "stamp": table.stamps.tolist(),
            "map_T_camera": table.poses[:, :3].reshape(-1, 12).tolist(),
            "area": _packed(table.areas),
        },
        "observations": {
            "object": table.object_ids.tolist(),
            "view": table.views.tolist(),
            "score": table.scores.tolist(),
            "z_min": table.heights[:, 0].tolist(),
            "z_max": table.heights[:, 1].tolist(),
            "footprint": _packed(table.footprints),
        },
    }
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()


def parse_evidence(content: bytes, path: str) -> EvidenceTable:
    """Return the evidence that a file holds.

    Args:
        content: the file.
        path: how messages name it.

    Raises:
        FormatError: If it has none, or is of a later version.
    """
    if len(content) > limits.MAX_EVIDENCE_BYTES:
        raise FormatError(
            f"holds {len(content)} bytes, more than the {limits.MAX_EVIDENCE_BYTES} that are "
            "allowed",
            path=path,
        )
    try:
        document = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"is not JSON: {error}", path=path) from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise FormatError(f"does not say that its format is {FORMAT!r}", path=path, key="format")
    if document.get("version") != VERSION:
        raise FormatError(
            f"is of version {document.get('version')!r}; this program reads {VERSION}",
            path=path,
            key="version",
        )
    try:
        return _table(document["views"], document["observations"])
    except _WRONG as error:
        reason = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        raise FormatError(f"has damaged columns: {reason}", path=path) from None


def _table(views: Mapping[str, Any], observations: Mapping[str, Any]) -> EvidenceTable:
    count = len(views["stamp"])
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3] = np.array(views["map_T_camera"], dtype=np.float64).reshape(count, 3, 4)
    heights = [np.array(observations[key], dtype=np.float64) for key in ("z_min", "z_max")]
    return EvidenceTable(
        object_ids=_whole(observations["object"]),
        views=_whole(observations["view"]),
        scores=np.array(observations["score"], dtype=np.float64),
        footprints=_unpacked(observations["footprint"]),
        heights=np.column_stack(heights),
        stamps=np.array(views["stamp"], dtype=np.float64),
        poses=poses,
        areas=_unpacked(views["area"]),
    )


def _packed(shapes: ObjectArray) -> dict[str, list[int]]:
    """Return polygons and multipolygons as counts of their parts, and steps between points."""
    parts, shape_of = shapely.get_parts(shapes, return_index=True)
    is_polygon = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    is_polygon &= ~shapely.is_empty(parts)
    parts, shape_of = parts[is_polygon], shape_of[is_polygon]
    rings, part_of = shapely.get_rings(parts, return_index=True)
    xy, ring_of = shapely.get_coordinates(rings, return_index=True)
    is_last = np.append(ring_of[1:] != ring_of[:-1], True)[: len(ring_of)]
    xy, ring_of = xy[~is_last], ring_of[~is_last]  # which is the first again
    units = np.rint(xy * _PER_METER).astype(np.int64)
    return {
        "polygons": np.bincount(shape_of, minlength=len(shapes)).tolist(),
        "rings": np.bincount(part_of, minlength=len(parts)).tolist(),
        "points": np.bincount(ring_of, minlength=len(rings)).tolist(),
        "steps": np.diff(units, axis=0, prepend=0).ravel().tolist(),
    }


def _unpacked(columns: Mapping[str, Any]) -> ObjectArray:
    """Return the shapes that `_packed` was given; raises one of `_WRONG` for anything else."""
    polygons, rings, points = (_counts(columns[key]) for key in ("polygons", "rings", "points"))
    if rings.sum() != len(points) or polygons.sum() != len(rings):
        raise ValueError("the counts of polygons, rings and points do not match")
    if (rings < 1).any() or (points < 3).any():
        raise ValueError("a polygon has at least one ring, and a ring at least three points")
    steps = np.array(columns["steps"], dtype=np.float64).reshape(-1, 2)
    if points.sum() != len(steps):
        raise ValueError(f"{points.sum()} points were expected, found {len(steps)}")
    xy = np.cumsum(steps, axis=0) / _PER_METER
    if not np.abs(xy).max(initial=0) <= limits.MAX_PLACE:
        raise ValueError(f"a point is farther away than {limits.MAX_PLACE:g} m")
    if len(xy) == 0:
        return np.full(len(polygons), shapely.Polygon(), dtype=object)
    ends = np.cumsum(points)
    closed = np.insert(xy, ends, xy[ends - points], axis=0)
    ring_of_point = np.repeat(np.arange(len(points)), points + 1)
    linear = np.asarray(shapely.linearrings(closed, indices=ring_of_point))
    part_of_ring = np.repeat(np.arange(len(rings)), rings)
    parts = np.asarray(shapely.polygons(linear, indices=part_of_ring))
    shapes = _gathered(parts, polygons)
    for tangled in shapes[~are_untangled(shapes)][:1]:
        check_tangle(tangled)
    return shapes


def _whole(values: Any) -> NDArray[np.int64]:
    numbers = np.array(values)
    if numbers.ndim != 1 or (len(numbers) and numbers.dtype.kind != "i"):
        raise ValueError("objects, views and counts of parts are lists of whole numbers")
    return numbers.astype(np.int64)


def _counts(values: Any) -> NDArray[np.int64]:
    counts = _whole(values)
    if (counts < 0).any() or counts.max(initial=0) > limits.MAX_EVIDENCE_BYTES:
        raise ValueError("counts of parts must be 0 or more, and not too large")
    return counts


def _gathered(parts: ObjectArray, polygons: NDArray[np.int64]) -> ObjectArray:
    """Group polygons into shapes, by the number of polygons of each shape."""
    ends = np.cumsum(polygons)
    shapes = np.full(len(polygons), shapely.Polygon(), dtype=object)
    shapes[polygons == 1] = parts[ends[polygons == 1] - 1]
    for i in np.flatnonzero(polygons > 1):
        shapes[i] = shapely.MultiPolygon(list(parts[ends[i] - polygons[i] : ends[i]]))
    return shapes
