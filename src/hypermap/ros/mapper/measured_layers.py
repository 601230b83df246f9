"""The layers of what other sensors measure while a live node maps."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.samples import Samples

# What estimates values takes a third of a second to import, so only those who measure any do.
if TYPE_CHECKING:
    from hypermap.values.growing import GrowingLayer

_OF_MAPPING = ("occupancy", "semantic")


class MeasuredLayers:
    """Layers of measured values, which grow as samples come.

    Attributes:
        layers: in the order in which they were begun.

    Args:
        frame_id: of the map.
        onto: the map whose layers are continued; None for none.
    """

    def __init__(self, frame_id: str, onto: Hypermap | None) -> None:
        self._frame_id, self._onto = frame_id, onto
        self.layers: list[GrowingLayer] = []
        self._grow: set[str] = set()  # names of those that samples come for now

    def begin(self, name: str, quantity: str, unit: str) -> GrowingLayer:
        """Return a layer of measured values: that of before a pause, or a new one.

        A new one continues that of the map to go on with.

        Args:
            name: of the layer.
            quantity: what is measured.
            unit: of it; empty for that of the layer that is continued.

        Raises:
            HypermapError: If another layer has the name.
        """
        from hypermap.values.growing import GrowingLayer
        from hypermap.values.on_map import known_layer, method_of, samples_of

        if name in (*_OF_MAPPING, *self._grow):
            raise HypermapError(
                f"there is a layer {name!r} already; give the quantity another name"
            )
        self._grow.add(name)
        for before in self.layers:
            if before.name == name:
                return before
        known = None if self._onto is None else known_layer(self._onto, name)
        if known is None or known.samples is None or self._onto is None:
            layer = GrowingLayer(name, self._frame_id, quantity, unit)
        else:
            method, half_life = method_of(known)
            layer = GrowingLayer(
                name,
                self._frame_id,
                known.quantity,
                known.unit or unit,
                samples_of(self._onto, known, self._onto.base_frame),
                method=method,
                half_life=half_life,
            )
        self.layers.append(layer)
        return layer

    def end(self, name: str) -> None:
        """Let a layer of measured values be begun again, as once the node is active again."""
        self._grow.discard(name)

    def unit_of(self, name: str) -> str:
        """Return the unit of a layer of the map to go on with; empty where there is none."""
        from hypermap.values.on_map import known_layer

        known = None if self._onto is None else known_layer(self._onto, name)
        return "" if known is None else known.unit

    @property
    def revisions(self) -> list[int]:
        """What differs after every sample, for each layer."""
        return [layer.revision for layer in self.layers]

    @property
    def are_new(self) -> bool:
        """Whether samples have come, beyond those of earlier runs."""
        return any(layer.is_new for layer in self.layers)

    def move(self, moved: Callable[[Samples], Samples]) -> None:
        """Move all samples to where they were really taken."""
        for layer in self.layers:
            layer.move(moved)

    def clear(self) -> None:
        """Forget all samples, and the map that was continued."""
        self._onto = None
        for layer in self.layers:
            layer.clear()

    def added_to(self, hypermap: Hypermap) -> Hypermap:
        """Return a map with these layers."""
        if not self.layers:
            return hypermap
        from hypermap.values.on_map import with_value_layer

        for growing in self.layers:
            if (layer := growing.layer()) is not None:
                hypermap = with_value_layer(hypermap, layer)
        return hypermap
