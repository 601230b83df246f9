"""A map as a picture: occupancy, objects in a color per class, names, a scale bar and a legend."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.colors import Color, class_colors
from hypermap.core.arguments import check_kind
from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.layer import Layer, RasterPicture, ShapesPicture
from hypermap.core.shapes import as_area, valid_copies
from hypermap.core.value_layer import ValueLayer
from hypermap.formats.atomic import write_file
from hypermap.formats.limits import MAX_PLACE
from hypermap.text import counted
from hypermap.viewer.note_marks import Mark, marks_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from hypermap.exploration import Frontier

SUFFIXES = (".png", ".svg")
_NONE = np.empty((0, 2, 2))  # lines
_MOST_CONTOURED = 1_000_000  # cells; of a finer grid, every second or third of a row
_RAY = 2  # cells of a row through which a single ray of a sensor passes


@dataclass(frozen=True, eq=False)
class Raster:
    """A grid of colors in the picture's frame: `pose` is that of the grid's lower left corner."""

    layer: str
    picture: RasterPicture
    pose: Pose2D


@dataclass(frozen=True, eq=False)
class Shapes:
    """Named shapes in the picture's frame, the largest first, so that no one hides another.

    Attributes:
        layer: heading in the legend.
        names: by which they are colored and counted.
        shapes: polygons.
        labels: what is written at them; nothing where empty. None: their names.
        are_outlines: whether they are drawn as lines alone.
    """

    layer: str
    names: ObjectArray
    shapes: ObjectArray
    labels: ObjectArray | None = None
    are_outlines: bool = False


@dataclass(frozen=True, eq=False)
class Contours:
    """Lines of equal value in the picture's frame.

    Attributes:
        values: of the cells of a grid, shape (height, width); NaN for none.
        points_xy: the cells' centers, shape (height, width, 2) [m].
        unit: of the values.
    """

    values: NDArray[np.float32]
    points_xy: NDArray[np.float64]
    unit: str


@dataclass(frozen=True, eq=False)
class Drawing:
    """All that a picture shows.

    Attributes:
        rasters: in the order of the map's layers.
        shapes: in the order of the map's layers.
        view: xmin, ymin, xmax, ymax of what is shown [m].
        colors: of each class.
        title: in the first line; may be empty.
        subtitle: what the picture says about itself.
        labels: whether names are written at the shapes.
        doors: from x, y to x, y of the lines at which rooms meet [m], shape (N, 2, 2).
        links: from x, y to x, y of lines between what belongs together [m], shape (N, 2, 2).
        walls: what of the rasters is drawn once more, above the others.
        arrows: from x, y to x, y [m], shape (N, 2, 2).
        contours: of the value layers, if requested.
        marks: of notes.
    """

    rasters: tuple[Raster, ...]
    shapes: tuple[Shapes, ...]
    view: tuple[float, float, float, float]
    colors: Mapping[str, Color]
    title: str
    subtitle: str
    labels: bool
    doors: NDArray[np.float64] = field(default_factory=lambda: _NONE)
    links: NDArray[np.float64] = field(default_factory=lambda: _NONE)
    walls: tuple[Raster, ...] = ()
    arrows: NDArray[np.float64] = field(default_factory=lambda: _NONE)
    contours: tuple[Contours, ...] = ()
    marks: tuple[Mark, ...] = ()


def render(
    hypermap: Hypermap,
    path: str | Path,
    *,
    layers: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    area: BaseGeometry | None = None,
    frontiers: Sequence[Frontier] = (),
    contours: bool = False,
    full: bool = False,
    labels: bool = True,
    title: str = "",
    size: int = 1400,
) -> None:
    """Draw a map from above, in its base frame, and save it as PNG or SVG.

    The same map gives the same bytes. In an SVG the names are text that can be searched.

    Args:
        hypermap: the map.
        path: where to save; the suffix chooses the format.
        layers: names of the layers to draw, or one; None for all that can be drawn.
        names: classes of objects to draw, or one; None for all.
        area: what to show, in the base frame [m]; None for all that is known.
        frontiers: borders of the unknown, numbered as given, with where to stand.
        contours: whether to draw lines of equal value over measured values.
        full: whether to show the grids as far as they reach, not only where something is known.
        labels: whether to write names at the shapes.
        title: first line of the picture.
        size: pixels of the longer side of the map in a PNG.

    Raises:
        HypermapError: If the suffix is another, there is nothing to draw, the area is empty or far
            away, no value has contours, or a name is unknown.
        LayerNotFound: If there is no such layer.
        TypeError: If it is not a map, or the area is not a shapely geometry.
    """
    path = Path(path)
    check_suffix(path)
    drawing = compose(
        hypermap,
        layers=layers,
        names=names,
        area=area,
        frontiers=frontiers,
        contours=contours,
        full=full,
        labels=labels,
        title=title,
    )
    from hypermap.viewer.drawing import draw  # loads matplotlib

    write_file(path, draw(drawing, path.suffix[1:].lower(), size))


def check_suffix(path: Path) -> None:
    """Raise a HypermapError if a picture cannot be saved under that name."""
    if path.suffix.lower() not in SUFFIXES:
        raise HypermapError(f"{path}: a picture is saved as .png or .svg")


def compose(
    hypermap: Hypermap,
    *,
    layers: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    area: BaseGeometry | None = None,
    frontiers: Sequence[Frontier] = (),
    contours: bool = False,
    full: bool = False,
    labels: bool = True,
    title: str = "",
) -> Drawing:
    """Return what `render` draws: all layers brought into the base frame, and the view."""
    check_kind(hypermap, Hypermap)
    layers = [layers] if isinstance(layers, str) else layers
    names = [names] if isinstance(names, str) else names
    shown = hypermap.layers if layers is None else [hypermap[name] for name in layers]
    rasters, shapes = _parts(hypermap, shown)
    walls: list[Raster] = []
    if any(isinstance(layer, ValueLayer) for layer in shown):
        # Values have larger cells than walls, which they would cover, and rooms would cover them.
        walls = [_walls(raster) for raster in rasters if "Occupied" in raster.picture.legend]
        shapes = [replace(part, are_outlines=part.layer == ROOMS) for part in shapes]
    borders = _borders(frontiers)
    colors = class_colors(name for part in [*shapes, borders] for name in part.names)
    if names is not None:
        shapes = [_only(part, names, colors) for part in shapes]
    marks = marks_of(hypermap, shown) if names is None else ()
    if area is not None and not np.abs(as_area(area).bounds).max() <= MAX_PLACE:
        raise HypermapError(f"the area to draw is farther away than {MAX_PLACE:g} m, or empty")
    view = _view(rasters, shapes, marks, full or area is not None)
    is_empty = not (rasters or marks or any(len(s.names) for s in shapes))
    if not np.isfinite(view).all() or is_empty:
        raise HypermapError("there is nothing to draw: the layers are empty or have no picture")
    if area is not None:
        view = _within(area, view)
    subtitle = f"{_objects(shapes)}frame {hypermap.base_frame}"
    if frontiers:
        shapes.append(borders)
    return Drawing(
        tuple(rasters),
        tuple(shapes),
        _padded(view),
        colors,
        title,
        subtitle,
        labels,
        _doors(hypermap) if names is None and ROOMS in {part.layer for part in shapes} else _NONE,
        _links(frontiers),
        tuple(walls),
        contours=_contours(hypermap, shown) if contours else (),
        marks=marks,
    )


def _parts(hypermap: Hypermap, shown: Iterable[Layer]) -> tuple[list[Raster], list[Shapes]]:
    """Return the pictures of layers in the base frame; rooms come first, below all others."""
    rasters: list[Raster] = []
    shapes: list[Shapes] = []
    for layer in shown:
        picture = layer.picture()
        if picture is None:
            continue
        base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
        if isinstance(picture, RasterPicture):
            rasters.append(Raster(layer.name, picture, base_T_layer @ picture.grid.origin))
        else:
            shapes.append(_in_base_frame(layer.name, picture, base_T_layer))
    shapes.sort(key=lambda part: part.layer != ROOMS)
    return rasters, shapes


def _contours(hypermap: Hypermap, shown: Iterable[Layer]) -> tuple[Contours, ...]:
    """Return the value layers, to be drawn as lines."""
    found = []
    for layer in shown:
        if isinstance(layer, ValueLayer) and layer.grid is not None and layer.cells is not None:
            every = math.ceil(math.sqrt(layer.cells.size / _MOST_CONTOURED))
            height, width = layer.grid.shape
            rows, cols = np.mgrid[0:height:every, 0:width:every]
            base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
            points = base_T_layer.apply(layer.grid.centers(rows.ravel(), cols.ravel()))
            values = layer.cells[::every, ::every]
            found.append(Contours(values, points.reshape(*rows.shape, 2), layer.unit))
    if not found:
        raise HypermapError(
            "contours are lines of equal value, and none of these layers has measured values; "
            "make one with: hypermap values"
        )
    return tuple(found)


def _borders(frontiers: Sequence[Frontier]) -> Shapes:
    """Return frontiers as shapes with their numbers."""
    shapes = [
        shapely.buffer(shapely.multipoints(each.points_xy), each.size / len(each.points_xy))
        for each in frontiers
    ]
    numbers = [str(i) for i in range(1, len(shapes) + 1)]
    names = as_objects(["frontier"] * len(shapes))
    return Shapes("frontiers", names, as_objects(shapes), as_objects(numbers))


def _links(frontiers: Sequence[Frontier]) -> NDArray[np.float64]:
    """Return a line from each frontier to where a robot stands, shape (N, 2, 2)."""
    ends = [[each.place_xy, [each.pose.x, each.pose.y]] for each in frontiers]
    return np.array(ends, dtype=np.float64).reshape(-1, 2, 2)


def _doors(hypermap: Hypermap) -> NDArray[np.float64]:
    """Return the lines of the doors between rooms, in the base frame, shape (N, 2, 2)."""
    from hypermap.rooms.rooms import rooms_on

    rooms = rooms_on(hypermap)
    lines = [] if rooms is None else [door.line.coords for door in rooms.doors]
    return np.array([np.array(line)[[0, -1]] for line in lines]).reshape(-1, 2, 2)


def _walls(raster: Raster) -> Raster:
    """Return a grid whose occupied cells alone are drawn."""
    rgba = raster.picture.rgba.copy()
    is_wall = (rgba[:, :, :3] == raster.picture.legend["Occupied"]).all(axis=2)
    rgba[~is_wall, 3] = 0
    return replace(raster, picture=replace(raster.picture, rgba=rgba))


def _in_base_frame(layer: str, picture: ShapesPicture, base_T_layer: Pose2D) -> Shapes:
    shapes = valid_copies(picture.shapes)
    placed = as_objects(base_T_layer.apply_geometry(shape) for shape in shapes)
    order = np.argsort(-shapely.area(placed), kind="stable")
    return Shapes(layer, picture.names[order], placed[order])


def _only(part: Shapes, names: Sequence[str], known: Mapping[str, Any]) -> Shapes:
    for name in names:
        if name not in known:
            raise HypermapError(f"no object is called {name!r}; {did_you_mean(name, known)}")
    wanted = np.isin(part.names.astype(str), list(names))
    return replace(part, names=part.names[wanted], shapes=part.shapes[wanted])


def _objects(shapes: Sequence[Shapes]) -> str:
    """Return the words "28 objects of 12 classes, 3 rooms, "; nothing where no layer has shapes."""
    if not shapes:
        return ""
    counts = Counter(name for part in shapes for name in part.names if part.layer != ROOMS)
    kinds = counted(len(counts), "class", "classes")
    rooms = sum(len(part.names) for part in shapes if part.layer == ROOMS)
    said = f"{counted(counts.total(), 'object')} of {kinds}, "
    return said + (f"{counted(rooms, 'room')}, " if rooms else "")


def _view(
    rasters: Sequence[Raster], shapes: Sequence[Shapes], marks: Sequence[Mark], full: bool
) -> tuple[float, float, float, float]:
    """Return the box around everything known [m]; NaN if there is nothing."""
    corners = [raster.pose.apply(_known_corners(raster.picture, full)) for raster in rasters]
    boxes = [shapely.bounds(part.shapes).reshape(-1, 2) for part in shapes]
    areas = [np.reshape(mark.area.bounds, (2, 2)) for mark in marks if mark.area is not None]
    places = np.array([(mark.x, mark.y) for mark in marks]).reshape(-1, 2)
    points = np.concatenate([*corners, *boxes, *areas, places, np.empty((0, 2))])
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return (np.nan, np.nan, np.nan, np.nan)
    xmin, ymin = points.min(axis=0)
    xmax, ymax = points.max(axis=0)
    return (float(xmin), float(ymin), float(xmax), float(ymax))


def _within(
    area: BaseGeometry, known: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Return the box of an area to draw, in which something must lie."""
    if area.envelope.intersects(shapely.box(*known)):
        return area.bounds
    asked, drawn = (
        ",".join(f"{number:.10g}" for number in np.round(box, 2) + 0.0)
        for box in (area.bounds, known)
    )
    raise HypermapError(
        f"there is nothing to draw in {asked}: what is drawn lies in {drawn} (X0,Y0,X1,Y1)"
    )


def _known_corners(picture: RasterPicture, full: bool) -> NDArray[np.float64]:
    """Return corners of the part of a grid that is known, from the grid's corner, shape (N, 2)."""
    known = picture.rgba[:, :, 3] > 0
    unknown = picture.legend.get("Unknown")
    if unknown is not None:
        known &= (picture.rgba[:, :, :3] != unknown).any(axis=2)
    if full or not known.any():
        known = np.ones_like(known)
    (x0, x1), (y0, y1) = well_filled(known.sum(axis=0)), well_filled(known.sum(axis=1))
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) * picture.grid.resolution


def well_filled(counts: NDArray[np.int64]) -> tuple[int, int]:
    """Return where rows begin and end that hold more than what a stray ray leaves behind."""
    filled = np.flatnonzero(counts > min(_RAY, counts.max() - 1))
    return int(filled[0]), int(filled[-1]) + 1


def _padded(view: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return the view with a margin, and not narrower than a third of its length."""
    xmin, ymin, xmax, ymax = view
    width, height = xmax - xmin, ymax - ymin
    margin = max(0.03 * max(width, height), 0.2)
    width, height = width + 2 * margin, height + 2 * margin
    width, height = max(width, height / 3), max(height, width / 3)
    x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
    return (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
