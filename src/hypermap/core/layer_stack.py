"""Ordered layers with unique names, and the transforms between their frames."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from typing import TypeVar

from shapely.geometry.base import BaseGeometry

from hypermap.core.arguments import check_kind
from hypermap.core.arrays import PointsLike
from hypermap.core.errors import FrameError, HypermapError, LayerNotFound, did_you_mean
from hypermap.core.frames import FrameTree, Pose2D
from hypermap.core.layer import Hits, Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import as_area

_log = logging.getLogger(__name__)

DEFAULT_FRAME = "map"  # REP 105
ROOMS = "rooms"
"""Name of the layer whose objects are rooms."""

AnyLayer = TypeVar("AnyLayer", bound=Layer)


class LayerStack:
    """Ordered layers and the tree of their frames.

    Attributes:
        frames: the transforms between the frames of the layers.

    Raises:
        HypermapError: If two layers have the same name.
    """

    def __init__(self, layers: Iterable[Layer] = (), frames: FrameTree | None = None) -> None:
        self.frames = FrameTree() if frames is None else frames
        self._layers: dict[str, Layer] = {}
        self._warned: set[str] = set()
        for layer in layers:
            self.add(layer)

    @property
    def layers(self) -> list[Layer]:
        """The layers in order; use `add` and `remove` to change them."""
        return list(self._layers.values())

    @property
    def base_frame(self) -> str:
        """The frame of the first layer; "map" if there is no layer."""
        return next((layer.frame_id for layer in self._layers.values()), DEFAULT_FRAME)

    def __contains__(self, name: object) -> bool:
        return name in self._layers

    def __iter__(self) -> Iterator[Layer]:
        return iter(self.layers)

    def __getitem__(self, name: str) -> Layer:
        """Return a layer by its name.

        Raises:
            LayerNotFound: If there is none.
            TypeError: If the name is no text.
        """
        if name not in self._layers:
            check_kind(name, str)
            raise LayerNotFound(name, self._layers)
        return self._layers[name]

    def layer(self, name: str, kind: type[AnyLayer]) -> AnyLayer:
        """Return a layer by its name, typed for type checkers.

        Raises:
            LayerNotFound: If there is none of that name.
            HypermapError: If it is of a different kind.
        """
        layer = self[name]
        if not isinstance(layer, kind):
            is_one = f"is of the kind {type(layer).__name__}"
            raise HypermapError(f"layer {name!r} {is_one}, not {kind.__name__}")
        return layer

    def semantic(self, name: str | None = None) -> SemanticLayer:
        """Return the semantic layer with this name, or the only one; raises like `layer`.

        The layer of rooms is returned without its name only if there is no other one.
        """
        return self.layer(self._only(SemanticLayer) if name is None else name, SemanticLayer)

    def occupancy(self, name: str | None = None) -> OccupancyLayer:
        """Return the occupancy layer with this name, or the only one; raises like `layer`."""
        return self.layer(self._only(OccupancyLayer) if name is None else name, OccupancyLayer)

    def _only(self, kind: type[Layer]) -> str:
        names = [layer.name for layer in self if isinstance(layer, kind)]
        if len(names) > 1:
            names = [name for name in names if name != ROOMS]
        if len(names) != 1:
            what = f"{kind.__name__.removesuffix('Layer').lower()} layer"
            if not names:
                raise HypermapError(f"the map has no {what}")
            raise HypermapError(f"the map has {len(names)} {what}s; name one of {', '.join(names)}")
        return names[0]

    def add(self, layer: Layer) -> None:
        """Add a layer after the others.

        Raises:
            HypermapError: If there is one of that name.
            TypeError: If it is not a layer.
        """
        if not isinstance(layer, Layer):
            raise TypeError(f"a map consists of layers, got {type(layer).__name__}")
        if layer.name in self._layers:
            raise HypermapError(
                f"there are two layers with the name {layer.name!r}; names must be unique"
            )
        self._layers[layer.name] = layer

    def remove(self, name: str) -> None:
        """Remove a layer from the map.

        Raises:
            LayerNotFound: If there is none of that name.
        """
        del self._layers[self[name].name]

    def rename(self, name: str, new_name: str) -> None:
        """Give a layer another name; it keeps its place.

        Raises:
            LayerNotFound: If there is none of that name.
            HypermapError: If there is another one with the new name.
            ValueError: If the new name is empty.
        """
        layer = self[name]
        if new_name != name and new_name in self:
            raise HypermapError(f"there is a layer {new_name!r} already; names must be unique")
        if not new_name:
            raise ValueError("a layer needs a name")
        layer.name = new_name
        self._layers = {layer.name: layer for layer in self.layers}

    # Frames

    def placed_layers(self) -> list[Layer]:
        """Return the layers whose frames are connected to the base frame; others are logged."""
        return [layer for layer in self._layers.values() if self._has_place(layer)]

    def _has_place(self, layer: Layer) -> bool:
        try:
            self._pose_of(layer)
        except FrameError as error:
            if layer.name not in self._warned:
                self._warned.add(layer.name)
                _log.warning("layer %r is left out: %s", layer.name, error)
            return False
        return True

    def _pose_of(self, layer: Layer) -> Pose2D:
        """Return `base_T_layer`."""
        return self._lookup(self.base_frame, layer.frame_id)

    def _area(self, area: BaseGeometry, layer: Layer, frame_id: str | None) -> BaseGeometry:
        """Transform an area from a frame into the layer's frame."""
        return self._lookup(layer.frame_id, frame_id).apply_geometry(as_area(area))

    def _points(self, points_xy: PointsLike, layer: Layer, frame_id: str | None) -> PointsLike:
        """Transform points from a frame into the layer's frame."""
        if frame_id is None and layer.frame_id == self.base_frame:
            return points_xy
        return self._lookup(layer.frame_id, frame_id).apply(points_xy)

    def _in_base_frame(self, layer: Layer, hits: Hits) -> Hits:
        return Hits(hits.values, self._pose_of(layer).apply(hits.points_xy))

    def _lookup(self, target: str, source: str | None) -> Pose2D:
        """Return `target_T_source`, where None is the base frame."""
        if source is None:
            return self.frames.lookup(target, self.base_frame)
        known = dict.fromkeys([*(layer.frame_id for layer in self), *self.frames.frames])
        if source not in known:
            raise FrameError(
                f"frame {source!r} is unknown to the map; {did_you_mean(source, known)}"
            )
        return self.frames.lookup(target, source)
