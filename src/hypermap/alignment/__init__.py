"""Aligns the map of another day or another robot to this one."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.alignment.bending import Bend, bend_of
    from hypermap.alignment.frames import in_frame_of
    from hypermap.alignment.matching import Alignment, NotAligned, align

_HOMES = {
    "Bend": "hypermap.alignment.bending",
    "bend_of": "hypermap.alignment.bending",
    "Alignment": "hypermap.alignment.matching",
    "NotAligned": "hypermap.alignment.matching",
    "align": "hypermap.alignment.matching",
    "in_frame_of": "hypermap.alignment.frames",
}

__all__ = ["Alignment", "Bend", "NotAligned", "align", "bend_of", "in_frame_of"]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
