"""The ways to correct the poses of a recording: by a known map, by a graph, or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from hypermap.mapping.config import MappingConfig

if TYPE_CHECKING:
    from hypermap.mapping.pose_graph.correction import CorrectedPoses

WAYS = ("none", "map", "graph", "auto")
"""As `--correct-poses` names them; "auto" is by the map, or else by a graph."""


def is_by_graph(way: str | None, has_map: bool) -> bool:
    """Return whether poses are corrected without a map.

    Args:
        way: one of `WAYS`; None for that of the configuration.
        has_map: whether an occupancy map is known from the start.
    """
    return way == "graph" or (way == "auto" and not has_map)


def with_way(config: MappingConfig, way: str | None, has_map: bool) -> MappingConfig:
    """Return a configuration that says whether poses are corrected by the map.

    The arguments are those of `is_by_graph`.
    """
    if way is None or (way != "none" and not has_map):
        return config
    alignment = replace(config.alignment, enabled=way in ("map", "auto"))
    return replace(config, alignment=alignment)


def described(metadata: Mapping[str, Any], corrected: CorrectedPoses | None) -> dict[str, Any]:
    """Return a map's metadata with what became of poses that were corrected without a map.

    What was said of an earlier drive is left out where this one's poses are as recorded.
    """
    if corrected is None:
        is_stale = metadata["poses"] == "as recorded"
        return {k: v for k, v in metadata.items() if not (is_stale and k == "pose_corrections")}
    summary = corrected.summary()
    by = "corrected by a pose graph" if summary["corrected"] else "as recorded"
    return {**metadata, "poses": by, "pose_corrections": summary}
