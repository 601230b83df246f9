"""Merges two maps of one place by the evidence in both."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.mapping.merging.maps import Merged, merge_maps
    from hypermap.mapping.merging.settings import CannotMerge

_HOMES = {
    "CannotMerge": "hypermap.mapping.merging.settings",
    "Merged": "hypermap.mapping.merging.maps",
    "merge_maps": "hypermap.mapping.merging.maps",
}

__all__ = ["CannotMerge", "Merged", "merge_maps"]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
