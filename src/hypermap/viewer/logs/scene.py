"""A map as what 3D programs draw: colored grids, triangles, lines and names, in one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.colors import class_colors
from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import RasterPicture
from hypermap.core.shapes import valid_copies
from hypermap.perception.observation import Observation
from hypermap.triangles import label_points, ring_segments, triangles

_STEP = 0.01  # meters between layers, for display
_HIGH = 0.05  # meters above the floor at which a frame's own shapes are drawn
_TINT = 140  # opacity of fills, 0..255


@dataclass(frozen=True, eq=False)
class Surface:
    """The part of a layer that is a grid of colors in which something is known.

    Attributes:
        layer: its name.
        rgba: uint8, shape (height, width, 4); row 0 is the lowest.
        pose: of the lower left corner in the base frame.
        resolution: side of a cell [m].
        z: height at which it is drawn [m].
    """

    layer: str
    rgba: NDArray[np.uint8]
    pose: Pose2D
    resolution: float
    z: float

    def outline(self) -> NDArray[np.float64]:
        """Return the four corners in the base frame [m], shape (4, 2)."""
        height, width = self.rgba.shape[:2]
        cells = np.array([[0, 0], [width, 0], [width, height], [0, height]])
        return self.pose.apply(cells * self.resolution)


@dataclass(frozen=True, eq=False)
class SceneShapes:
    """Named shapes on the floor, in the base frame.

    Attributes:
        layer: the layer's name.
        corners: of triangles that fill all shapes [m], float32, shape (3 T, 3).
        corner_colors: RGBA, uint8, shape (3 T, 4).
        segments: begin and end of the outlines' lines [m], float32, shape (L, 2, 3).
        segment_colors: RGB, uint8, shape (L, 3).
        names: of the shapes, shape (N,).
        places: a point in each shape for its name [m], float32, shape (N, 3).
        colors: of each shape, RGB, uint8, shape (N, 3).
    """

    layer: str
    corners: NDArray[np.float32]
    corner_colors: NDArray[np.uint8]
    segments: NDArray[np.float32]
    segment_colors: NDArray[np.uint8]
    names: ObjectArray
    places: NDArray[np.float32]
    colors: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class MapScene:
    """All that is drawn of a map, in its base frame.

    Attributes:
        base_frame: the frame's name; "map" for a map without layers.
        surfaces: layers that are grids.
        shapes: layers that are shapes.
        frames: the other frames of the map, and their poses in the base frame.
    """

    base_frame: str
    surfaces: tuple[Surface, ...]
    shapes: tuple[SceneShapes, ...]
    frames: dict[str, Pose2D]

    def bounds(self) -> tuple[float, float, float, float] | None:
        """Return xmin, ymin, xmax, ymax of what is worth looking at [m]; None if that is nothing.

        These are the shapes, or without shapes the grids.
        """
        corners = [shapes.corners[:, :2].astype(float) for shapes in self.shapes]
        if not any(map(len, corners)):
            corners = [surface.outline() for surface in self.surfaces]
        points = np.concatenate([*corners, np.empty((0, 2))])
        if len(points) == 0:
            return None
        (xmin, ymin), (xmax, ymax) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return xmin, ymin, xmax, ymax

    @classmethod
    def of(cls, hypermap: Hypermap) -> MapScene:
        """Return what there is to draw of a map; layers without a picture are left out."""
        if not hypermap.layers:
            return cls("map", (), (), {})
        base = hypermap.base_frame
        surfaces, shapes = [], []
        for number, layer in enumerate(hypermap.layers):
            picture, z = layer.picture(), number * _STEP
            if picture is None:
                continue
            pose = hypermap.frames.lookup(base, layer.frame_id)
            if isinstance(picture, RasterPicture):
                surfaces += _surface(layer.name, picture, pose, z)
            else:
                shapes.append(named_shapes(layer.name, picture.names, picture.shapes, pose, z))
        frames = {
            frame: hypermap.frames.lookup(base, frame)
            for frame in hypermap.frames.frames
            if frame != base
        }
        return cls(base, tuple(surfaces), tuple(shapes), frames)


def _surface(layer: str, picture: RasterPicture, pose: Pose2D, z: float) -> list[Surface]:
    """Return a grid without the unknown cells around it; nothing if all are unknown."""
    is_known, grid = picture.rgba[..., 3] > 0, picture.grid
    rows, columns = np.flatnonzero(is_known.any(axis=1)), np.flatnonzero(is_known.any(axis=0))
    if len(rows) == 0:
        return []
    rgba = picture.rgba[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    corner = Pose2D(columns[0] * grid.resolution, rows[0] * grid.resolution, 0.0)
    return [Surface(layer, rgba, pose @ grid.origin @ corner, grid.resolution, z)]


def named_shapes(
    layer: str,
    names: ObjectArray,
    shapes: ObjectArray,
    pose: Pose2D | None = None,
    z: float = 0.0,
) -> SceneShapes:
    """Return shapes as triangles, lines and names, each class in its color.

    Args:
        layer: a name for all of them.
        names: shape (N,).
        shapes: shapely geometries [m], shape (N,).
        pose: of their frame in the base frame; None if they are in it.
        z: height at which they are drawn [m].
    """
    placed = valid_copies(shapes)
    if pose is not None:
        placed = pose.apply_geometries(placed)
    colors = class_rgb(names)
    fills, lines = triangles(placed), ring_segments(placed)
    tint = np.full((len(fills.owners), 1), _TINT, dtype=np.uint8)
    centroids = shapely.get_coordinates(shapely.centroid(placed)).reshape(-1, 2)
    return SceneShapes(
        layer,
        corners=_raised(fills.points_xy, z),
        corner_colors=np.hstack([colors[fills.owners], tint]),
        segments=_raised(lines.points_xy, z).reshape(-1, 2, 3),
        segment_colors=colors[lines.owners[::2]],
        names=names,
        places=_raised(label_points(placed, centroids), z),
        colors=colors,
    )


def seen_shapes(observation: Observation) -> SceneShapes:
    """Return the footprints that a frame shows."""
    names = as_objects(seen.name for seen in observation.objects)
    return named_shapes(
        "seen", names, as_objects(o.footprint for o in observation.objects), z=_HIGH
    )


def seen_area(observation: Observation) -> NDArray[np.float32]:
    """Return the closed outline of what a frame could see [m], shape (N, 3); N may be 0."""
    area = observation.visible_area
    if not isinstance(area, shapely.Polygon):
        return np.empty((0, 3), np.float32)
    return _raised(shapely.get_coordinates(area.exterior), _HIGH)


def class_rgb(names: ObjectArray) -> NDArray[np.uint8]:
    """Return the color of each name's class, RGB, shape (N, 3)."""
    by_name = class_colors(str(name) for name in names)
    colors = np.array([by_name[str(name)] for name in names]).reshape(-1, 3)
    return np.round(255 * colors).astype(np.uint8)


def _raised(points_xy: NDArray[np.float64], z: float) -> NDArray[np.float32]:
    return np.column_stack([points_xy, np.full(len(points_xy), z)]).astype(np.float32)
