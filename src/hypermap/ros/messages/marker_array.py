"""A semantic layer as markers, which rviz and others draw: `visualization_msgs/MarkerArray`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.colors import Color
from hypermap.core.arrays import IntArray
from hypermap.core.hypermap import ROOMS
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.geometry_messages import Types
from hypermap.ros.messages.label_places import places_apart
from hypermap.ros.messages.markers import (
    INK,
    LINE_LIST,
    TEXT_VIEW_FACING,
    TRIANGLE_LIST,
    MarkerMaker,
    label_text,
)
from hypermap.ros.port import Message
from hypermap.triangles import Corners, label_points, ring_segments, triangles

_FILL, _OUTLINE, _FIRST_LABEL = 0, 1, 2  # ids within a class
_STEP = 0.004  # m between fill and outline
_ABOVE_ROOMS = 0.01  # m from the fills of rooms to those of what stands in them
_SPREAD = 0.05  # m from the same to the smallest object, which lies on top
_MOST_OF_ROOMS = 0.3  # opacity of the fills of rooms, below which grids, values and zones lie
_TINT = 0.62  # of a class's color in its fill; the rest is white, so that names can be read


@dataclass(frozen=True)
class MarkerStyle:
    """What of a layer is shown, and how; see `LayerMarkers.PARAMETERS`."""

    show_fill: bool = True
    show_outlines: bool = True
    show_labels: bool = True
    fill_opacity: float = 1.0
    outline_width: float = 0.02
    label_height: float = 0.15
    max_labels: int = 1000
    marker_height: float = 0.02
    shown_classes: Sequence[str] = ()
    hidden_classes: Sequence[str] = ()

    def shows(self, name: str) -> bool:
        """Whether objects of a class are shown."""
        return name not in self.hidden_classes and (
            not self.shown_classes or name in self.shown_classes
        )


def marker_array(
    layer: SemanticLayer, colors: Mapping[str, Color], types: Types, style: MarkerStyle
) -> Message:
    """Return a layer as a `visualization_msgs/MarkerArray`.

    The first marker deletes all earlier ones. Each class has a namespace of its own, in which one
    marker holds all fills, one all outlines, and one each label. Markers are in the layer's frame
    and carry no time, so they move with it.

    Args:
        layer: the layer.
        colors: of each class in it.
        types: the classes of messages.
        style: what is shown.
    """
    table = layer.table
    make = MarkerMaker(types, layer.frame_id)
    markers = [make.delete_all()]
    shown = np.array([style.shows(str(name)) for name in table.vocabulary], dtype=bool)
    table = table.take(np.flatnonzero(shown[table.codes]))
    # Rooms, which do not overlap, lie below all else.
    heights = style.marker_height + (0.0 if layer.name == ROOMS else _lifts(table))
    heights = np.broadcast_to(heights, len(table))
    opacity = min(style.fill_opacity, _MOST_OF_ROOMS if layer.name == ROOMS else 1.0)
    fills = outlined = None
    if style.show_fill:
        fills = _Drawn(triangles(table.shapes), table, heights)
    if style.show_outlines:
        outlined = _Drawn(ring_segments(table.footprints), table, heights + _STEP)
    labels = _labels(table, style)
    places = _label_places(table, labels, style.label_height)
    for name, code in sorted(table.vocabulary.items()):
        color = colors.get(name, (0.0, 0.0, 0.0))
        if fills is not None and len(points := fills.of(code)):
            fill = make.marker(name, _FILL, TRIANGLE_LIST, color=(*tint(color), opacity))
            make.draw(fill, points)
            make.unshade(fill)
            markers.append(fill)
        if outlined is not None and len(points := outlined.of(code)):
            outline = make.marker(name, _OUTLINE, LINE_LIST, color=(*color, 1.0))
            make.draw(outline, points, scale=style.outline_width)
            markers.append(outline)
        for number, (x, y) in enumerate(places[table.codes[labels] == code].tolist()):
            text = make.marker(name, _FIRST_LABEL + number, TEXT_VIEW_FACING, color=INK)
            z = style.marker_height + _SPREAD + 2 * _STEP + style.label_height
            make.write(text, name, (x, y, z), style.label_height)
            markers.append(text)
    return make.array(markers)


def tint(color: Color) -> Color:
    """Return the lighter color in which objects of a class with that color are filled.

    It looks much as in the pictures of `hypermap render`.
    """
    red, green, blue = (_TINT * part + 1 - _TINT for part in color)
    return red, green, blue


def empty_marker_array(frame_id: str, types: Types) -> Message:
    """Return a `visualization_msgs/MarkerArray` that deletes all markers of its topic."""
    make = MarkerMaker(types, frame_id)
    return make.array([make.delete_all()])


def _lifts(table: ObjectTable) -> NDArray[np.float64]:
    """Return how much higher each object is drawn [m], so that a small one is not hidden."""
    lifts = np.empty(len(table))
    lifts[np.argsort(-table.areas, kind="stable")] = np.linspace(_ABOVE_ROOMS, _SPREAD, len(table))
    return lifts


def _labels(table: ObjectTable, style: MarkerStyle) -> IntArray:
    """Return the rows of the objects that get a label; to rviz, one without text is an error."""
    if not style.show_labels:
        return np.empty(0, dtype=np.int64)
    has_text = np.array([bool(label_text(name)) for name in table.vocabulary], dtype=bool)
    named = np.flatnonzero(has_text[table.codes])
    largest = np.argsort(-table.areas[named], kind="stable")[: style.max_labels]
    return np.sort(named[largest])


def _label_places(table: ObjectTable, rows: IntArray, height: float) -> NDArray[np.float64]:
    """Return where the labels of some objects stand; that of a larger one has the first choice."""
    rank = np.argsort(-table.areas[rows], kind="stable")
    lengths = np.array([len(label_text(name)) for name in table.vocabulary], dtype=int)
    places = np.empty((len(rows), 2))
    belong = label_points(table.shapes[rows], table.centroids[rows])
    places[rank] = places_apart(belong[rank], lengths[table.codes[rows[rank]]], height)
    return places


class _Drawn:
    """Corners of the objects of a table, sorted by class."""

    def __init__(self, corners: Corners, table: ObjectTable, heights: NDArray[np.float64]) -> None:
        codes = table.codes[corners.owners]
        order = np.argsort(codes, kind="stable")
        z = heights[corners.owners]
        self._points = np.column_stack([corners.points_xy, z])[order]
        self._codes = codes[order]

    def of(self, code: int) -> NDArray[np.float64]:
        """Return the corners of a class, shape (N, 3)."""
        begin, end = np.searchsorted(self._codes, [code, code + 1])
        return self._points[begin:end]
