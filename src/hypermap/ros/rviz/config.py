"""Configurations of rviz and rviz2 for a map: displays of its layers and masks, from above."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
import yaml
from shapely.geometry.base import BaseGeometry

from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.topic_names import FRONTIERS, ROOM_GRAPH, topic_name

DEFAULT_SERVER = "/hypermap_server"
_SUFFIX = {
    OccupancyLayer.class_name: "map",
    SemanticLayer.class_name: "markers",
    ValueLayer.class_name: "values",
}
GROUND = "Grid"
MASKS = {"Keepout zones": "keepout_mask", "Speed limits": "speed_mask"}
"""Displays of the server's masks, and their topics."""

_WINDOW = (1280, 860)  # pixels
_MAP_VIEW = (880, 700)  # what of the window is left for the map
_MARGIN = 0.9  # how much of it the map fills
_COARSE = 12  # pixels per meter, below which lines at whole meters are too many
_MASK_ALPHA, _VALUES_ALPHA = 0.4, 0.6
_BACKGROUND = "226; 229; 233"


@dataclass(frozen=True)
class RvizView:
    """What is seen from above, in the fixed frame.

    Attributes:
        x: of the middle [m].
        y: of the middle [m].
        scale: pixels per meter.
    """

    x: float = 0.0
    y: float = 0.0
    scale: float = 60.0

    @classmethod
    def of(cls, bounds: Sequence[float]) -> RvizView:
        """Return the view that shows xmin, ymin, xmax, ymax [m]; the default for NaN."""
        if not np.isfinite(bounds).all():
            return cls()
        xmin, ymin, xmax, ymax = bounds
        width, height = max(xmax - xmin, 1.0), max(ymax - ymin, 1.0)
        scale = _MARGIN * min(_MAP_VIEW[0] / width, _MAP_VIEW[1] / height)
        return cls((xmin + xmax) / 2, (ymin + ymax) / 2, scale)


def map_configuration(
    hypermap: Hypermap, server: str = DEFAULT_SERVER, *, ros2: bool = False
) -> str:
    """Return the `.rviz` file for a map that a server publishes.

    Args:
        hypermap: the map.
        server: full name of the map server's node.
        ros2: whether it is for rviz2, where classes have other names and topics a QoS.

    Raises:
        FrameError: If a layer's frame has no place in the map.
    """
    displays = []
    for layer in hypermap:
        if has_display(layer.class_name):
            shown = display(layer.class_name, layer.name, server, ros2=ros2)
            if isinstance(layer, SemanticLayer):
                shown["Namespaces"] = {str(name): True for name in sorted(set(layer.names))}
            displays.append(shown)
    if ROOMS in hypermap and isinstance(hypermap[ROOMS], SemanticLayer):
        displays.append(room_graph_display(server, ros2=ros2))
    # Switched off: rviz warns of what nobody publishes, and not every server has masks.
    displays += [mask_display(name, server, ros2=ros2, is_shown=False) for name in MASKS]
    displays.append(exploration_display(server, ros2=ros2))
    return configuration(displays, clean_frame(hypermap.base_frame), view_of(hypermap), ros2=ros2)


def has_display(class_name: str) -> bool:
    """Whether a layer of that class is published in a form that rviz draws."""
    return class_name in _SUFFIX


def display(
    class_name: str, name: str, server: str = DEFAULT_SERVER, *, ros2: bool = False
) -> dict[str, Any]:
    """Return the display of a layer for a `.rviz` file.

    Args:
        class_name: of the layer; `has_display` must be true.
        name: of the layer.
        server: full name of the map server's node.
        ros2: whether it is for rviz2.
    """
    topic = f"{server}/{topic_name(name, _SUFFIX[class_name])}"
    if class_name == OccupancyLayer.class_name:
        # Behind all else, as the floor is, also where markers lie on it.
        return _map(name, topic, ros2, {"Alpha": 1, "Color Scheme": "map", "Draw Behind": True})
    if class_name == ValueLayer.class_name:
        colors = {"Alpha": _VALUES_ALPHA, "Color Scheme": "costmap", "Draw Behind": False}
        return _map(name, topic, ros2, colors)
    return _markers(name, topic, ros2)


def room_graph_display(server: str = DEFAULT_SERVER, *, ros2: bool = False) -> dict[str, Any]:
    """Return the display of the doors and the graph of rooms for a `.rviz` file; as `display`."""
    return _markers("Doors and graph", f"{server}/{ROOM_GRAPH}", ros2)


def exploration_display(server: str = DEFAULT_SERVER, *, ros2: bool = False) -> dict[str, Any]:
    """Return the display of frontiers and next views for a `.rviz` file; as `display`.

    They come from the node `semantic_mapper` in the namespace of the map server.
    """
    mapper = f"{server.rpartition('/')[0]}/semantic_mapper"
    return _markers("Where to look next", f"{mapper}/{FRONTIERS}", ros2)


def mask_display(
    name: str, server: str = DEFAULT_SERVER, *, ros2: bool = False, is_shown: bool = True
) -> dict[str, Any]:
    """Return the display of a costmap mask for a `.rviz` file.

    Args:
        name: one of `MASKS`.
        server: full name of the map server's node.
        ros2: whether it is for rviz2.
        is_shown: whether it is switched on.
    """
    own = {"Alpha": _MASK_ALPHA, "Color Scheme": "costmap", "Draw Behind": False}
    shown = _map(name, f"{server}/{MASKS[name]}", ros2, own)
    return {**shown, "Enabled": is_shown, "Value": is_shown}


def _markers(name: str, topic: str, ros2: bool) -> dict[str, Any]:
    shown = {
        "Class": _class("MarkerArray", ros2),
        "Name": name,
        "Enabled": True,
        "Value": True,
        "Namespaces": {},
    }
    if ros2:
        return {**shown, "Topic": _latched(topic)}
    return {**shown, "Marker Topic": topic}


def _map(name: str, topic: str, ros2: bool, own: dict[str, Any]) -> dict[str, Any]:
    shown = {"Class": _class("Map", ros2), "Name": name, "Enabled": True, "Value": True, **own}
    if not ros2:
        return {**shown, "Topic": topic}
    updates = _latched(f"{topic}_updates") | {"Durability Policy": "Volatile"}
    return {**shown, "Topic": _latched(topic), "Update Topic": updates}


def configuration(
    displays: Sequence[dict[str, Any]], fixed_frame: str, view: RvizView, *, ros2: bool = False
) -> str:
    """Return a `.rviz` file with a grid, the frames and these displays.

    Args:
        displays: as `display` returns them.
        fixed_frame: frame of the view, which is that of the map's first layer.
        view: what is seen.
        ros2: whether it is for rviz2.
    """
    panel = "rviz_common" if ros2 else "rviz"
    # rviz2 may take its transforms from elsewhere than tf.
    transforms = {"Transformation": {"Current": {"Class": _class("TF", ros2)}}} if ros2 else {}
    tools = ("MoveCamera", "Interact", "Select", "Measure", "PublishPoint")
    content = {
        "Panels": [
            {
                "Class": f"{panel}/Displays",
                "Name": "Displays",
                "Help Height": 0,
                "Property Tree Widget": {"Expanded": list(_open_rows(displays))},
            },
        ],
        "Visualization Manager": {
            "Class": "",
            "Name": "root",
            "Enabled": True,
            "Value": True,
            "Displays": [ground(view, ros2=ros2), *displays, _frames(ros2)],
            "Global Options": {
                "Background Color": _BACKGROUND,
                "Fixed Frame": fixed_frame,
                "Frame Rate": 30,
            },
            "Tools": [{"Class": _class(name, ros2)} for name in tools],
            **transforms,
            "Views": views(view, ros2=ros2),
        },
        "Window Geometry": {
            "Displays": {"collapsed": False},
            "Hide Left Dock": False,
            "Hide Right Dock": True,
            "Width": _WINDOW[0],
            "Height": _WINDOW[1],
        },
    }
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def _frames(ros2: bool) -> dict[str, Any]:
    return {
        "Class": _class("TF", ros2),
        "Name": "Frames",
        "Enabled": True,
        "Value": True,
        "Marker Scale": 1,
        "Show Arrows": False,
        "Show Axes": True,
        "Show Names": True,
    }


def views(view: RvizView, *, ros2: bool = False) -> dict[str, Any]:
    """Return the part of a configuration that says what is seen."""
    current = {
        "Class": _class("TopDownOrtho", ros2),
        "Name": "Current View",
        "Target Frame": "<Fixed Frame>",
        "Angle": 0,
        "Scale": round(view.scale, 3),
        "X": round(view.x, 3),
        "Y": round(view.y, 3),
        "Near Clip Distance": 0.01,
    }
    return {"Current": current, "Saved": None}


def ground(view: RvizView, *, ros2: bool = False) -> dict[str, Any]:
    """Return the display of lines at whole or each ten meters, wherever the view may soon go."""
    cell = 1 if view.scale > _COARSE else 10
    lines = 2 * math.ceil(max(_WINDOW) / view.scale / cell)
    return {
        "Class": _class("Grid", ros2),
        "Name": GROUND,
        "Enabled": True,
        "Value": True,
        "Alpha": 0.2,
        "Cell Size": cell,
        "Color": "120; 120; 120",
        "Plane Cell Count": lines,
        "Reference Frame": "<Fixed Frame>",
        "Offset": {"X": cell * round(view.x / cell), "Y": cell * round(view.y / cell), "Z": -0.02},
    }


def view_of(hypermap: Hypermap) -> RvizView:
    """Return the view of everything that a map knows; raises as `map_configuration`."""
    shapes = [
        hypermap.frames.lookup(hypermap.base_frame, layer.frame_id).apply_geometry(_known(layer))
        for layer in hypermap
        if has_display(layer.class_name)
    ]
    return RvizView.of(shapely.total_bounds([shapely.Polygon(), *shapes]).tolist())


def _known(layer: Layer) -> BaseGeometry:
    """Return an area around what a layer knows."""
    if not isinstance(layer, OccupancyLayer) or layer.grid is None or layer.cells is None:
        return layer.extent()
    known = layer.cells != UNKNOWN
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if len(rows) == 0:
        return layer.extent()
    edges = np.array([cols[0], rows[0], cols[-1] + 1, rows[-1] + 1]) * layer.grid.resolution
    return layer.grid.origin.apply_geometry(shapely.box(*edges))


def opened(shown: dict[str, Any]) -> list[str]:
    """Return the properties of a display that are open in the panel: a switch for each class."""
    return ["Namespaces"] if "Namespaces" in shown else []


def _open_rows(displays: Sequence[dict[str, Any]]) -> Iterator[str]:
    for shown in displays:
        for name in opened(shown):
            yield f"/{shown['Name']}1"
            yield f"/{shown['Name']}1/{name}1"


def _class(name: str, ros2: bool) -> str:
    return f"rviz_default_plugins/{name}" if ros2 else f"rviz/{name}"


def _latched(topic: str) -> dict[str, Any]:
    """Return a topic that rviz2 receives also when it was published before."""
    return {
        "Value": topic,
        "Depth": 5,
        "History Policy": "Keep Last",
        "Reliability Policy": "Reliable",
        "Durability Policy": "Transient Local",
    }
