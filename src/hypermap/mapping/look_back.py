"""Looking behind objects: the evidence for them as a table, and what other fusions make of it."""

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
from hypermap.mapping.config import profile
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.overrides import override
from hypermap.mapping.pile import Evidence, Pile
from hypermap.mapping.stages import EvidenceConfig

_SLACK = 0.005  # metres by which the ground seen may be simplified: a quarter of a voting cell


def later_table(evidence: Mapping[int, Sequence[Evidence]]) -> Callable[[], EvidenceTable]:
    """Return a function that makes the `evidence_table` when it is called first."""
    return functools.cache(functools.partial(evidence_table, evidence))


def evidence_table(evidence: Mapping[int, Sequence[Evidence]]) -> EvidenceTable:
    """Return the evidence for objects, by their ids, as a table as files keep it.

    The ground that a view has seen is simplified by up to 5 mm.
    """
    observations = [(number, item) for number, items in evidence.items() for item in items]
    rows: dict[tuple[float, int, int], int] = {}
    views: list[Evidence] = []
    view_of = np.empty(len(observations), dtype=np.int64)
    for i, (_, item) in enumerate(observations):
        # What one frame shows shares its pose and its area.
        key = (item.stamp, id(item.map_T_camera), id(item.visible_area))
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
        areas=shapely.simplify(as_objects(view.visible_area for view in views), _SLACK),
    ).rounded()


def fused_shapes(table: EvidenceTable, config: EvidenceConfig) -> dict[str, BaseGeometry]:
    """Return what each fusion method makes of all observations of a table.

    Args:
        table: evidence for one object, at least one observation.
        config: settings of the methods; which of them made the map does not matter.

    Returns:
        A polygon per method, by its name, in the frame of the table [m].

    Raises:
        ValueError: If the table is empty.
    """
    if len(table) == 0:
        raise ValueError("there is no evidence to fuse")
    pile = Pile(len(table))
    centroids = shapely.get_coordinates(shapely.centroid(table.footprints))
    for row in np.argsort(table.stamps[table.views], kind="stable"):
        view = table.views[row]
        z_min, z_max = table.heights[row].tolist()
        pile.add(
            Evidence(
                stamp=float(table.stamps[view]),
                map_T_camera=table.poses[view],
                visible_area=table.areas[view],
                score=float(table.scores[row]),
                footprint=table.footprints[row],
                centroid_xy=centroids[row],
                z_min=z_min,
                z_max=z_max,
            )
        )
    return {method: fuse(pile, config).geometry for method, fuse in FUSIONS.items()}


def config_of(metadata: Mapping[str, Any]) -> EvidenceConfig:
    """Return the settings of the evidence map that made a map, as its metadata tell.

    Where they tell nothing, or what this program does not know, it is the profile "default".
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
