"""Queries of the page: at a point, in an area, for an object."""

from __future__ import annotations

import base64
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray
from hypermap.core.errors import HypermapError, ObjectNotFound
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.layer import Layer
from hypermap.core.objects import ObjectTable
from hypermap.core.occupancy import FREE, LABELS, OCCUPIED, OccupancyLayer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.questions.frames import pose_of_frame
from hypermap.viewer.live.layers import LayerViews
from hypermap.viewer.live.object_search import find, search_in
from hypermap.viewer.live.room_names import doors_of_room, names_of_rooms
from hypermap.viewer.live.snippets import AskedMap, snippets_at, snippets_in_area

MOST_ROWS = 5000
"""How many rows an answer has at most; downloads have all."""


class Questions:
    """Questions about one version of a map, each answered as the page shows it.

    Points and areas are in the asked frame, None is the base frame; answers are in the base frame.

    Attributes:
        hypermap: that version.
    """

    def __init__(self, hypermap: Hypermap, views: LayerViews, asked: AskedMap) -> None:
        self.hypermap = hypermap
        self._views = views
        self._asked = asked

    def at(self, point: Sequence[float], frame: str | None) -> dict[str, Any]:
        """Return what every layer says at a point, and the objects there, the smallest first.

        Raises:
            FrameError: If the frame is unknown.
        """
        x, y = self._pose_of(frame).apply(point)[0].tolist()
        answered = [layer for layer in self.hypermap if self._can_answer(layer)]
        snippets = snippets_at(self._asked, point, frame, [layer.name for layer in answered])
        return {
            "point": [x, y],
            "frame": self.hypermap.base_frame,
            "layers": [self._layer_at(layer, point, frame) for layer in answered],
            **snippets,
        }

    def area(self, corners: Sequence[Sequence[float]], frame: str | None) -> dict[str, Any]:
        """Return the objects that meet a polygon, and how many cells of each label are in it.

        Raises:
            FrameError: If the frame is unknown.
        """
        rows = self.rows_in(corners, frame)
        area = shapely.Polygon(corners)
        grids = [
            layer
            for layer in self.hypermap
            if self._can_answer(layer) and not isinstance(layer, SemanticLayer)
        ]
        snippets = snippets_in_area(self._asked, corners, frame, [layer.name for layer in grids])
        return {
            "rows": rows[:MOST_ROWS],
            "total": len(rows),
            "cells": [cell for layer in grids for cell in self._cells_in(layer, area, frame)],
            **snippets,
        }

    def rows_in(
        self, corners: Sequence[Sequence[float]], frame: str | None
    ) -> list[dict[str, Any]]:
        """Return a row for each object that meets a polygon, in the order of the layers.

        Raises:
            FrameError: If the frame is unknown.
        """
        area = shapely.Polygon(corners)
        rows = []
        for layer in self._semantic():
            base_T_layer = self._pose_of(layer.frame_id)
            in_layer = (base_T_layer.inverse() @ self._pose_of(frame)).apply_geometry(area)
            found = self._rows_of(layer, in_layer)
            rows += _object_rows(layer.name, layer.table, found, base_T_layer)
        return rows

    def find(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the objects that a request looks for, as `finding.find` does.

        Raises:
            Refused: If the request says nothing of that, or something wrong.
            FrameError: If the frame is unknown.
        """
        return find(self.hypermap, self._asked, search_in(values, self.hypermap))

    def details(self, layer_name: str, number: int) -> dict[str, Any]:
        """Return all that is known of an object; its shape exactly, in the base frame.

        Raises:
            LayerNotFound, ObjectNotFound: If there is none.
            HypermapError: If the layer is not drawn as shapes.
        """
        layer = self.hypermap[layer_name]
        view = self._views.of(self.hypermap, layer)
        if view.shapes is None:
            raise HypermapError(f"layer {layer_name!r} has no objects")
        rows = np.flatnonzero(view.shapes.ids == number)
        if len(rows) == 0:
            raise ObjectNotFound(f"layer {layer_name!r} has no object with id {number}")
        row, pose = int(rows[0]), view.base_T_layer
        values: dict[str, Any] = {
            "layer": layer.name,
            "id": number,
            "name": str(view.shapes.names[row]),
            "area": float(view.shapes.areas[row]),
            "at": view.shapes.label_points(rows, pose)[0].tolist(),
            "centroid": pose.apply(view.shapes.centroids[row])[0].tolist(),
            "polygons": view.shapes.polygons(row, pose),
            "wkt": shapely.to_wkt(pose.apply_geometry(view.shapes.shapes[row]), -1),
            "tags": [],
            "attributes": {},
        }
        (room,) = names_of_rooms(self.hypermap, [np.array(values["centroid"])])
        if layer.name == ROOMS:
            values["doors"] = doors_of_room(self.hypermap, number)
        elif room is not None:
            values["room"] = room
        if isinstance(layer, SemanticLayer):
            item = layer.get(number)
            values["wkt"] = shapely.to_wkt(pose.apply_geometry(item.footprint), -1)
            for key in ("tags", "confidence", "existence", "first_seen", "last_seen"):
                values[key] = getattr(item, key)
            values["attributes"] = dict(item.attributes)
            values["pictures"] = [
                f"data:image/jpeg;base64,{base64.b64encode(picture.jpeg).decode()}"
                for picture in layer.pictures(number)
            ]
        return values

    def _layer_at(self, layer: Layer, point: Sequence[float], frame: str | None) -> dict[str, Any]:
        value = self.hypermap.value_at(layer.name, point, frame)[0]
        objects = []
        if isinstance(layer, SemanticLayer):
            now = layer.snapshot
            in_layer = (self._pose_of(layer.frame_id).inverse() @ self._pose_of(frame)).apply(point)
            rows = now.all_at(in_layer[0])
            for item, area in zip(map(now.object, rows), now.column("areas", rows), strict=True):
                shown: dict[str, Any] = {"id": item.id, "name": item.name, "area": float(area)}
                objects.append({**shown, "existence": item.existence, "tags": list(item.tags)})
        return {
            "name": layer.name,
            "label": self._label_at(layer, point, frame),
            "value": _plain(value),
            "objects": objects,
        }

    def _label_at(self, layer: Layer, point: Sequence[float], frame: str | None) -> str:
        if not isinstance(layer, ValueLayer):
            return str(self.hypermap.label_at(layer.name, point, frame)[0])
        in_layer = (self._pose_of(layer.frame_id).inverse() @ self._pose_of(frame)).apply(point)
        return layer.text(layer.value_at(in_layer)[0], layer.deviation_at(in_layer)[0])

    def _cells_in(
        self, layer: Layer, area: BaseGeometry, frame: str | None
    ) -> list[dict[str, Any]]:
        """Return how many cells of a layer have each label in an area."""
        layer_T_asked = self._pose_of(layer.frame_id).inverse() @ self._pose_of(frame)
        if isinstance(layer, OccupancyLayer):
            counts = _count_cells(layer, layer_T_asked.apply_geometry(area))
        elif isinstance(layer, ValueLayer):
            counts = _mean_and_range(layer, layer_T_asked.apply_geometry(area))
        else:
            counts = Counter(map(str, self.hypermap.labels_in(layer.name, area, frame).values))
        return [
            {"layer": layer.name, "label": label, "count": count}
            for label, count in counts.items()
            if count
        ]

    def _rows_of(self, layer: SemanticLayer, area: BaseGeometry) -> IntArray:
        view = self._views.of(self.hypermap, layer)
        assert view.shapes is not None  # semantic layers are drawn as shapes
        return view.shapes.rows_in(area)

    def _semantic(self) -> list[SemanticLayer]:
        return [
            layer
            for layer in self.hypermap
            if isinstance(layer, SemanticLayer) and self._can_answer(layer)
        ]

    def _can_answer(self, layer: Layer) -> bool:
        has_place = not self._views.of(self.hypermap, layer).problem
        return has_place and not isinstance(layer, OpaqueLayer)

    def _pose_of(self, frame: str | None) -> Pose2D:
        """Return the pose of a frame in the base frame.

        Raises:
            FrameError: If the map does not know it.
        """
        return pose_of_frame(self.hypermap, frame)


def _object_rows(
    layer: str, table: ObjectTable, rows: IntArray, base_T_layer: Pose2D
) -> list[dict[str, Any]]:
    places = base_T_layer.apply(table.centroids[rows])
    return [
        {
            "layer": layer,
            "id": int(table.ids[row]),
            "name": str(table.names[row]),
            "x": x,
            "y": y,
            "area": float(table.areas[row]),
            "existence": _known(float(table.existence[row])),
            "first_seen": _known(float(table.first_seen[row])),
            "last_seen": _known(float(table.last_seen[row])),
            "tags": list(table.tags[row]),
        }
        for row, (x, y) in zip(rows.tolist(), places.tolist(), strict=True)
    ]


def _count_cells(layer: OccupancyLayer, area: BaseGeometry) -> dict[str, int]:
    """Return how many cells in an area have each label, without a list of the cells."""
    if layer.grid is None or layer.cells is None:
        return {}
    window = layer.grid.window_in(area)
    inside = layer.cells[window.slices][window.inside]
    if not len(inside):
        return {}
    free = int(np.count_nonzero(inside == FREE))
    occupied = int(np.count_nonzero(inside == OCCUPIED))
    return dict(zip(LABELS, (free, occupied, len(inside) - free - occupied), strict=True))


def _mean_and_range(layer: ValueLayer, area: BaseGeometry) -> dict[str, int]:
    found = layer.summary_in(area)
    mean, least = (f"{value:.{layer.decimals}f}" for value in (found.mean, found.least))
    return {f"mean {mean}, {least} to {layer.text(found.most)}": found.count}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _plain(value: Any) -> Any:
    """Return a layer's value as JSON can hold it."""
    number = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(number, float) and not math.isfinite(number) else number
