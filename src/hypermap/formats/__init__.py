"""Reads and writes maps: `open_map` and `save_map`, in `hmap`, and one module per file format."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.formats.hmap import open_map, save_map

_LAZY = {"open_map": "hypermap.formats.hmap", "save_map": "hypermap.formats.hmap"}

__all__ = ["open_map", "save_map"]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _LAZY)
