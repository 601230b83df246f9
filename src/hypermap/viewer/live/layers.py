"""How each layer of the open map is drawn, computed once and cached."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import shapely

from hypermap.core.errors import FrameError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer, RasterPicture
from hypermap.core.notes_layer import NotesLayer
from hypermap.core.occupancy import COLORS, OccupancyLayer
from hypermap.viewer.live.pyramid import Pyramid
from hypermap.viewer.live.shapes import LayerShapes


@dataclass(frozen=True, eq=False)
class LayerView:
    """A layer, ready to be drawn: as a grid, as shapes, or not at all.

    Attributes:
        base_T_layer: pose of its frame in the base frame.
        notes: the layer, if it holds notes.
        pyramid: of a layer that is drawn as a grid.
        shapes: of a layer that is drawn as shapes.
        legend: text for single colors of a grid: label -> (r, g, b), 0..255.
        problem: why the layer cannot be drawn; empty where it can.
    """

    base_T_layer: Pose2D
    pyramid: Pyramid | None = None
    shapes: LayerShapes | None = None
    legend: Mapping[str, tuple[int, int, int]] = field(default_factory=dict)
    problem: str = ""
    notes: NotesLayer | None = None

    @property
    def bounds(self) -> tuple[float, float, float, float] | None:
        """The box around the layer in the base frame [m]; None if it is empty."""
        if self.pyramid is not None:
            points = self.base_T_layer.apply(self.pyramid.grid.corners())
        elif self.shapes is not None and len(self.shapes.ids):
            box = shapely.box(*self.shapes.bounds)
            points = self.base_T_layer.apply(shapely.get_coordinates(box))
        elif self.notes is not None and len(self.notes):
            points = self.base_T_layer.apply(shapely.get_coordinates(self.notes.extent()))
        else:
            return None
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


class LayerViews:
    """A cache of the views of all layers in use; a changed layer is a new object."""

    def __init__(self) -> None:
        self._kept: weakref.WeakKeyDictionary[Layer, LayerView] = weakref.WeakKeyDictionary()
        self._making = threading.Lock()

    def of(self, hypermap: Hypermap, layer: Layer) -> LayerView:
        """Return how a layer of a map is drawn."""
        with self._making:
            view = self._kept.get(layer)
            if view is None:
                view = self._kept[layer] = _view(hypermap, layer)
            return view


def _view(hypermap: Hypermap, layer: Layer) -> LayerView:
    try:
        base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    except FrameError as error:
        return LayerView(Pose2D(), problem=str(error))
    if isinstance(layer, OccupancyLayer):
        return LayerView(base_T_layer, pyramid=Pyramid.of(layer), legend=COLORS)
    if isinstance(layer, NotesLayer):
        return LayerView(base_T_layer, notes=layer)
    picture = layer.picture()
    if isinstance(picture, RasterPicture):
        return LayerView(base_T_layer, Pyramid.of_picture(picture), legend=picture.legend)
    return LayerView(base_T_layer, shapes=LayerShapes.of(layer))
