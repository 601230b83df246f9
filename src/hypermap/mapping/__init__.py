"""Observations become layers."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.mapping.config import MappingConfig, load_config, profile
    from hypermap.mapping.evidence import EvidenceMap
    from hypermap.mapping.mapper import Mapper, Progress, map_recording
    from hypermap.mapping.occupancy import OccupancyMapper

_HOMES = {
    "EvidenceMap": "hypermap.mapping.evidence",
    "Mapper": "hypermap.mapping.mapper",
    "MappingConfig": "hypermap.mapping.config",
    "OccupancyMapper": "hypermap.mapping.occupancy",
    "Progress": "hypermap.mapping.mapper",
    "load_config": "hypermap.mapping.config",
    "map_recording": "hypermap.mapping.mapper",
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
