"""The evidence for objects as a table, and the shape that each fusion method makes of it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.errors import FormatError
from hypermap.core.evidence import EvidenceTable
from hypermap.mapping.completion import completed
from hypermap.mapping.config import profile
from hypermap.mapping.evidence_buffer import Evidence, EvidenceBuffer
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.overrides import override
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig

_TOLERANCE = 0.005  # meters; visible areas are simplified by up to a voting cell


def lazy_evidence_table(evidence: Mapping[int, Sequence[Evidence]]) -> Callable[[], EvidenceTable]:
    """Return a function that makes the `evidence_table` on its first call."""
    return functools.cache(functools.partial(evidence_table, evidence))


def evidence_table(evidence: Mapping[int, Sequence[Evidence]]) -> EvidenceTable:
    """Return the evidence for objects, by their ids, as the table that is saved in files.

    Visible areas are simplified by up to 5 mm.
    """
    observations = [(number, item) for number, items in evidence.items() for item in items]
    rows: dict[tuple[float, int, int], int] = {}
    views: list[Evidence] = []
    view_of = np.empty(len(observations), dtype=np.int64)
    for i, (_, item) in enumerate(observations):
        # Observations of one frame share its pose and its area.
        key = (item.stamp, id(item.map_T_camera), id(item.prepared_area))
        view_of[i] = rows.setdefault(key, len(views))
        if view_of[i] == len(views):
            views.append(item)
    items = [item for _, item in observations]
    heights = np.array([(item.z_min, item.z_max) for item in items], dtype=np.float64)
    poses = np.array([view.map_T_camera for view in views], dtype=np.float64)
    return EvidenceTable(
        object_ids=np.array([number for number, _ in observations], dtype=np.int64),
        views=view_of,
        scores=np.array([item.score for item in items], dtype=np.float64),
        footprints=as_objects(item.footprint for item in items),
        heights=heights.reshape(-1, 2),
        stamps=np.array([view.stamp for view in views], dtype=np.float64),
        poses=poses.reshape(-1, 4, 4),
        areas=shapely.simplify(as_objects(view.visible_area for view in views), _TOLERANCE),
    ).rounded()


def fused_shapes(
    table: EvidenceTable, config: EvidenceConfig, name: str = ""
) -> dict[str, BaseGeometry]:
    """Return the shape that each fusion method makes of all observations in a table.

    Args:
        table: evidence for one object, at least one observation.
        config: settings of the methods; its `fusion` names the method that made the map.
        name: class of the object. The shape of the map's method is completed by it if the settings
            say so.

    Returns:
        A polygon per method, by its name, in the frame of the table [m].

    Raises:
        ValueError: If the table is empty.
    """
    if len(table) == 0:
        raise ValueError("there is no evidence to fuse")
    buffer = EvidenceBuffer(len(table))
    centroids = shapely.get_coordinates(shapely.centroid(table.footprints))
    footprints, areas = map(PreparedPolygon.all_of, (list(table.footprints), list(table.areas)))
    for row in np.argsort(table.stamps[table.views], kind="stable"):
        view = table.views[row]
        z_min, z_max = table.heights[row].tolist()
        buffer.add(
            Evidence(
                stamp=float(table.stamps[view]),
                map_T_camera=table.poses[view],
                prepared_area=areas[view],
                score=float(table.scores[row]),
                prepared=footprints[row],
                centroid_xy=centroids[row],
                z_min=z_min,
                z_max=z_max,
            )
        )
    fused = {method: fuse(buffer, config).geometry for method, fuse in FUSIONS.items()}
    if config.completion == "class_depth":
        cameras_xy = table.poses[table.views, :2, 3]
        fused[config.fusion] = completed(
            fused[config.fusion], name, cameras_xy, class_depths=config.class_depths
        )
    return fused


def config_of(metadata: Mapping[str, Any]) -> EvidenceConfig:
    """Return the evidence settings in a map's metadata.

    Missing or unknown settings are those of the profile "default".
    """
    default = profile("default").evidence
    config = metadata.get("config")
    values = config.get("evidence") if isinstance(config, Mapping) else None
    if not isinstance(values, Mapping):
        return default
    try:
        return override(default, values)
    except FormatError:
        return default
