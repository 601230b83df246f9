"""The description of a map that the page loads first: layers, frames, classes and colors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely

from hypermap.colors import class_colors
from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.rooms.rooms import rooms_on
from hypermap.text import natural
from hypermap.viewer.live.layers import LayerView, LayerViews
from hypermap.viewer.picture import well_filled

_COARSE = 1024  # cells along a side that are enough to find the known part of a grid


def describe_map(hypermap: Hypermap, views: LayerViews, is_editable: bool) -> dict[str, Any]:
    """Return the layers, frames and classes of a map, as documented in docs/view.md.

    Coordinates are in the base frame [m]. A layer that cannot be drawn has the kind "none", and a
    `problem` where that is an error.
    """
    shown = {layer.name: views.of(hypermap, layer) for layer in hypermap}
    counts = {name: Counter(view.shapes.names) for name, view in shown.items() if view.shapes}
    colors = class_colors({str(name) for part in counts.values() for name in part})
    layers = []
    for layer in hypermap:
        view = shown[layer.name]
        described = {
            "name": layer.name,
            "class_name": layer.class_name,
            "frame_id": layer.frame_id,
            "extent": _box(view.bounds),
            "editable": is_editable and isinstance(layer, SemanticLayer) and not view.problem,
            "legend": [],
            "classes": [],
            **_kind(view),
        }
        if layer.name in counts:
            by_count = sorted(
                counts[layer.name].items(), key=lambda item: (-item[1], natural(str(item[0])))
            )
            described["classes"] = [
                {"name": str(name), "color": hex_color(colors[str(name)]), "count": count}
                for name, count in by_count
            ]
        layers.append(described)
    return {
        "base_frame": hypermap.base_frame,
        "extent": _box(_around(_known(layer, shown[layer.name]) for layer in hypermap)),
        "editable": any(layer["editable"] for layer in layers),
        "frames": _frames(hypermap),
        "layers": layers,
        **_doors(hypermap),
    }


def hex_color(color: Iterable[float]) -> str:
    """Return a color of parts in 0..1 as the page writes it.

    >>> hex_color((1.0, 0.5, 0.0))
    '#ff8000'
    """
    return "#" + "".join(f"{round(255 * part):02x}" for part in color)


def _doors(hypermap: Hypermap) -> dict[str, Any]:
    """Return the doors of a map with rooms, in the base frame, or a note why there are none."""
    try:
        rooms = rooms_on(hypermap)
    except HypermapError as error:
        return {"doors": [], "notes": [str(error)]}
    doors = [] if rooms is None else rooms.doors
    return {
        "doors": [
            {
                "rooms": list(door.rooms),
                "line": [list(map(float, point)) for point in door.line.coords],
                "width": door.width,
            }
            for door in doors
        ]
    }


def _kind(view: LayerView) -> dict[str, Any]:
    if view.problem:
        return {"kind": "none", "count": 0, "problem": view.problem}
    if view.pyramid is not None:
        grid = view.pyramid.grid
        return {
            "kind": "raster",
            "count": grid.width * grid.height,
            "resolution": grid.resolution,
            "legend": [
                {"label": label, "color": hex_color(part / 255 for part in color)}
                for label, color in view.legend.items()
            ],
        }
    if view.shapes is not None:
        return {"kind": "shapes", "count": len(view.shapes.ids)}
    if view.notes is not None:
        return {"kind": "notes", "count": len(view.notes)}
    return {"kind": "none", "count": 0}


def _frames(hypermap: Hypermap) -> list[dict[str, Any]]:
    """Return the pose of each frame in the base frame, the base frame first."""
    base = hypermap.base_frame
    named = dict.fromkeys([base, *(layer.frame_id for layer in hypermap), *hypermap.frames.frames])
    frames = []
    for frame_id in named:
        try:
            pose = hypermap.frames.lookup(base, frame_id)
        except FrameError:
            continue  # its layers say so
        frames.append({"frame_id": frame_id, "x": pose.x, "y": pose.y, "yaw": pose.yaw})
    return frames


def _known(layer: Layer, view: LayerView) -> tuple[float, float, float, float] | None:
    """Return the box around what is known of a layer: of a grid, without unknown borders."""
    if not isinstance(layer, OccupancyLayer) or view.pyramid is None or view.problem:
        return view.bounds
    grid = view.pyramid.grid
    number = max(0, int(np.ceil(np.log2(max(grid.width, grid.height) / _COARSE))))
    known = view.pyramid.level(number) != UNKNOWN
    if not known.any():
        return view.bounds
    cols, rows = well_filled(known.sum(axis=0)), well_filled(known.sum(axis=1))
    side = grid.resolution * 2**number
    x0, x1 = cols[0] * side, min(cols[1] * side, grid.width * grid.resolution)
    y0, y1 = rows[0] * side, min(rows[1] * side, grid.height * grid.resolution)
    pose: Pose2D = view.base_T_layer @ grid.origin
    return _around_points(pose.apply([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))


def _around_points(points: Any) -> tuple[float, float, float, float]:
    xmin, ymin, xmax, ymax = shapely.total_bounds(shapely.points(points))
    return float(xmin), float(ymin), float(xmax), float(ymax)


def _around(
    boxes: Iterable[tuple[float, float, float, float] | None],
) -> tuple[float, float, float, float] | None:
    """Return the box around boxes; None if there are none."""
    given = [box for box in boxes if box is not None]
    if not given:
        return None
    low, high = np.array(given)[:, :2].min(axis=0), np.array(given)[:, 2:].max(axis=0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _box(box: tuple[float, float, float, float] | None) -> list[float] | None:
    return None if box is None else list(box)
