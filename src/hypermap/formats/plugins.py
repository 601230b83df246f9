"""Which kinds of layers there are: ours, and those that other packages bring."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from hypermap.core.layer import Layer, Store

ENTRY_POINT_GROUP = "hypermap.layers"


class LayerPlugin(Protocol):
    """One kind of layer and how it is kept in files.

    A package offers one by an entry point in the group `hypermap.layers`, whose name is the
    class name in configuration files and whose value is an object (or module) with these members.
    """

    def empty(self, name: str, frame_id: str, settings: Mapping[str, Any]) -> Layer:
        """Return a layer that holds nothing yet."""
        ...

    def load(
        self, store: Store, file: str, name: str, frame_id: str, settings: Mapping[str, Any]
    ) -> Layer:
        """Return the layer kept under `file`, the value of that key in the configuration.

        Raises:
            FormatError: If the files do not hold such a layer.
        """
        ...

    def save(self, layer: Any, store: Store, file: str) -> None:
        """Write what `load` reads; the same layer gives the same bytes each time."""
        ...
