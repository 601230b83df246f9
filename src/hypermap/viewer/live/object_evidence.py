"""The evidence for an object as the page shows it: observations, cameras, and other fusions."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.errors import HypermapError
from hypermap.core.evidence import EvidenceTable
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import valid_copies
from hypermap.viewer.live.shapes import polygons_in_base

_TOLERANCE = 0.001  # meters by which an outline may be simplified
_DECIMALS = 4  # of meters
NO_EVIDENCE = (
    "This map contains no evidence. `hypermap map` saves it unless you pass --drop-evidence."
)
NONE_HERE = "There is no evidence for this object; it may have been drawn by hand."


def describe_evidence(hypermap: Hypermap, layer_name: str, number: int) -> dict[str, Any]:
    """Return the evidence for an object as the page shows it, in the base frame [m].

    Observations are in the order of time. Of each there are `stamp`, `score`, `polygons`, `area`,
    `camera` (x, y), `yaw` (where the camera looked) and `distance` from camera to shape. `fused`
    has for each method the shape that it makes of all of them, its area, and the Jaccard index
    with the shape in the map. `start` is the first stamp of the layer's evidence.

    Without evidence there are no observations, but a `reason`.

    Raises:
        LayerNotFound, ObjectNotFound: If there is none.
        HypermapError: If the layer has no objects.
        FormatError: If the evidence is kept in a file that cannot be read.
    """
    layer = hypermap[layer_name]
    if not isinstance(layer, SemanticLayer):
        raise HypermapError(f"layer {layer_name!r} has no objects")
    item = layer.get(number)
    kept = layer.evidence()
    table = layer.evidence_of(number)
    answer: dict[str, Any] = {
        "layer": layer_name,
        "id": number,
        "name": item.name,
        "first_seen": item.first_seen,
        "last_seen": item.last_seen,
        "seen": max(_count(item.attributes.get("evidence")), len(table)),
        "observations": [],
        "fused": [],
    }
    if len(table) == 0:
        return {**answer, "reason": NO_EVIDENCE if kept is None else NONE_HERE}
    assert kept is not None  # it holds the table's rows
    # The compiled loops take longer to import than the rest of the server.
    from hypermap.mapping.evidence_table import config_of, fused_shapes

    base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    config = config_of(hypermap.metadata)
    answer["start"] = float(kept.stamps.min())
    answer["observations"] = _observations(table, base_T_layer)
    fused = fused_shapes(table, config, item.name)
    own = config.fusion if "config" in hypermap.metadata else None
    answer["fused"] = _compared(fused, item.footprint, own, base_T_layer)
    return answer


def _observations(table: EvidenceTable, base_T_layer: Pose2D) -> list[dict[str, Any]]:
    order = np.argsort(table.stamps[table.views], kind="stable")
    views, footprints = table.views[order], table.footprints[order]
    poses = table.poses[views]
    cameras = base_T_layer.apply(poses[:, :2, 3])
    yaws = np.arctan2(poses[:, 1, 2], poses[:, 0, 2]) + base_T_layer.yaw
    spots = shapely.points(poses[:, :2, 3])
    columns = {
        "stamp": table.stamps[views],
        "score": table.scores[order],
        "area": _rounded(shapely.area(footprints)),
        "distance": _rounded(shapely.distance(valid_copies(footprints), spots)),
        "camera": np.round(cameras, _DECIMALS),
        "yaw": _rounded(yaws),
        "z_min": table.heights[order, 0],
        "z_max": table.heights[order, 1],
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    outlines = _outlines(footprints, base_T_layer)
    return [
        {**dict(zip(columns, row, strict=True)), "polygons": outline}
        for row, outline in zip(rows, outlines, strict=True)
    ]


def _compared(
    fused: dict[str, BaseGeometry], footprint: BaseGeometry, own: str | None, base_T_layer: Pose2D
) -> list[dict[str, Any]]:
    """Return the shapes of all fusion methods, the one used for the map first."""
    shapes = valid_copies(as_objects(fused.values()))
    (in_map,) = valid_copies(as_objects([footprint]))
    common = shapely.area(shapely.intersection(shapes, in_map))
    together = shapely.area(shapely.union(shapes, in_map))
    jaccard = np.divide(common, together, out=np.zeros(len(shapes)), where=together > 0)
    outlines = _outlines(shapes, base_T_layer)
    areas = _rounded(shapely.area(shapes)).tolist()
    answer = [
        {"method": method, "is_own": method == own, "area": area, "jaccard": index, "polygons": at}
        for method, area, index, at in zip(
            fused, areas, _rounded(jaccard).tolist(), outlines, strict=True
        )
    ]
    return sorted(answer, key=lambda one: not one["is_own"])


def _outlines(shapes: ObjectArray, base_T_layer: Pose2D) -> list[Any]:
    simple = shapely.simplify(shapes, _TOLERANCE, preserve_topology=True)
    return polygons_in_base(simple, base_T_layer, _DECIMALS)


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.round(values, _DECIMALS))


def _count(value: Any) -> int:
    """Return how often an object was seen, if its attribute is a count."""
    return value if isinstance(value, int) and not isinstance(value, bool) and value > 0 else 0
