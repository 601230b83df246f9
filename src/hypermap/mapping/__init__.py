"""Turns frames into maps. `Mapper` is one map in the making; `map_recording` maps a recording."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.mapping.config import MappingConfig, load_config, profile
    from hypermap.mapping.evidence import EvidenceMap
    from hypermap.mapping.mapper import Mapper
    from hypermap.mapping.occupancy import OccupancyMapper
    from hypermap.mapping.recording_to_map import Progress, map_recording

_HOMES = {
    "EvidenceMap": "hypermap.mapping.evidence",
    "Mapper": "hypermap.mapping.mapper",
    "MappingConfig": "hypermap.mapping.config",
    "OccupancyMapper": "hypermap.mapping.occupancy",
    "Progress": "hypermap.mapping.recording_to_map",
    "load_config": "hypermap.mapping.config",
    "map_recording": "hypermap.mapping.recording_to_map",
    "profile": "hypermap.mapping.config",
}

__all__ = [
    "EvidenceMap",
    "Mapper",
    "MappingConfig",
    "OccupancyMapper",
    "Progress",
    "load_config",
    "map_recording",
    "profile",
]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
