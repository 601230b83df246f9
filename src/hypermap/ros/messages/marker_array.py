"""A semantic layer as markers, which rviz and others draw: `visualization_msgs/MarkerArray`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.colors import Color
from hypermap.core.arrays import IntArray
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import SemanticLayer
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.messages.geometry_messages import Types
from hypermap.ros.messages.label_places import places_apart
from hypermap.ros.messages.points import is_ros1, many_points
from hypermap.ros.port import Message
from hypermap.ros.ros1.arrays import writing_arrays
from hypermap.triangles import Corners, label_points, ring_segments, triangles

# visualization_msgs/Marker
_LINE_LIST, _TEXT_VIEW_FACING, _TRIANGLE_LIST = 5, 9, 11
_DELETE_ALL = 3

_FILL, _OUTLINE, _FIRST_LABEL = 0, 1, 2  # ids within a class
_STEP = 0.004  # m between fill and outline
_SPREAD = 0.05  # m within which fills lie, the smallest object on top
_INK = (0.08, 0.08, 0.08, 1.0)  # of labels
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
    make = _Maker(types, layer.frame_id)
    markers = [make.delete_all()]
    shown = np.array([style.shows(str(name)) for name in table.vocabulary], dtype=bool)
    table = table.take(np.flatnonzero(shown[table.codes]))
    heights = style.marker_height + _lifts(table)
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
            fill = make.marker(
                name, _FILL, _TRIANGLE_LIST, color=(*tint(color), style.fill_opacity)
            )
            make.draw(fill, points)
            make.unshade(fill)
            markers.append(fill)
        if outlined is not None and len(points := outlined.of(code)):
            outline = make.marker(name, _OUTLINE, _LINE_LIST, color=(*color, 1.0))
            make.draw(outline, points, scale=style.outline_width)
            markers.append(outline)
        for number, (x, y) in enumerate(places[table.codes[labels] == code].tolist()):
            text = make.marker(name, _FIRST_LABEL + number, _TEXT_VIEW_FACING, color=_INK)
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
    make = _Maker(types, frame_id)
    return make.array([make.delete_all()])


def _lifts(table: ObjectTable) -> NDArray[np.float64]:
    """Return how much higher each object is drawn [m], so that a small one is not hidden."""
    lifts = np.empty(len(table))
    lifts[np.argsort(-table.areas, kind="stable")] = np.linspace(0, _SPREAD, len(table))
    return lifts


def _labels(table: ObjectTable, style: MarkerStyle) -> IntArray:
    """Return the rows of the objects that get a label; to rviz, one without text is an error."""
    if not style.show_labels:
        return np.empty(0, dtype=np.int64)
    has_text = np.array([bool(name.strip()) for name in table.vocabulary], dtype=bool)
    named = np.flatnonzero(has_text[table.codes])
    largest = np.argsort(-table.areas[named], kind="stable")[: style.max_labels]
    return np.sort(named[largest])


def _label_places(table: ObjectTable, rows: IntArray, height: float) -> NDArray[np.float64]:
    """Return where the labels of some objects stand; that of a larger one has the first choice."""
    rank = np.argsort(-table.areas[rows], kind="stable")
    lengths = np.array([len(name) for name in table.vocabulary], dtype=int)
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


class _Maker:
    """Makes markers in one frame."""

    def __init__(self, types: Types, frame_id: str) -> None:
        self._types = types
        self._marker = writing_arrays(types.message("visualization_msgs/Marker"))
        self._stamp = types.stamp(0)  # the latest transform
        self._frame_id = frame_id

    def marker(
        self,
        namespace: str,
        number: int,
        kind: int,
        *,
        color: tuple[float, float, float, float],
    ) -> Message:
        """Return a marker without content."""
        marker = self._marker()
        marker.header.frame_id = clean_frame(self._frame_id)
        marker.header.stamp = self._stamp
        marker.ns, marker.id, marker.type = namespace, number, kind
        marker.pose.orientation.w = 1.0
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = color
        marker.frame_locked = True
        return marker

    def delete_all(self) -> Message:
        """Return the marker that deletes all others."""
        marker = self.marker("", 0, _TRIANGLE_LIST, color=_INK)
        marker.action = _DELETE_ALL
        return marker

    def array(self, markers: list[Message]) -> Message:
        """Return markers as one message."""
        array = writing_arrays(self._types.message("visualization_msgs/MarkerArray"))()
        array.markers = markers
        return array

    def draw(self, marker: Message, points: NDArray[np.float64], scale: float = 1.0) -> None:
        """Give a marker corners; in a list of lines, the scale is their width [m]."""
        marker.scale.x = marker.scale.y = marker.scale.z = float(scale)
        marker.points = many_points(points, self._types)

    def unshade(self, marker: Message) -> None:
        """Give each triangle the marker's color, which rviz then draws as it is, without light."""
        count = len(marker.points) // 3
        color = marker.color
        if is_ros1(self._marker):
            marker.colors = np.tile((color.r, color.g, color.b, color.a), (count, 1))
        else:
            marker.colors = [color] * count

    def write(
        self, marker: Message, text: str, at: tuple[float, float, float], height: float
    ) -> None:
        """Give a marker text, its place and the height of its letters [m]."""
        marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = at
        marker.scale.z = float(height)
        marker.text = text
