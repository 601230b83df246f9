"""Where to look next: frontiers, and objects that are still uncertain."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.exploration.explorer import Explorer
    from hypermap.exploration.frontiers import Frontier
    from hypermap.exploration.next_views import NextView
    from hypermap.exploration.sensor import Sensor

_HOMES = {
    "Explorer": "hypermap.exploration.explorer",
    "Frontier": "hypermap.exploration.frontiers",
    "NextView": "hypermap.exploration.next_views",
    "Sensor": "hypermap.exploration.sensor",
}

__all__ = ["Explorer", "Frontier", "NextView", "Sensor"]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
