"""Draws a picture with matplotlib."""

from __future__ import annotations

import io
import math
import warnings
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, PathPatch, Rectangle
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D

from hypermap.text import printable
from hypermap.viewer.labels import Spot, place_labels
from hypermap.viewer.legend import ROW, draw_legend, legend_columns
from hypermap.viewer.paper import (
    DPI,
    FAINT,
    FONT,
    INK,
    MARK,
    NAME,
    NOTE,
    PAPER,
    SHAPE_ALPHA,
    SMALL,
    TITLE,
    fill_style,
    line_style,
    text_width,
)

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from hypermap.viewer.picture import Drawing

_LEFT, _BOTTOM, _TOP, _RIGHT, _GAP = 84, 78, 92, 20, 32  # pixels around the map
_CONTOURS = MaxNLocator(nbins=8, steps=[1, 2, 2.5, 5, 10])
_VEIL = 0.75  # how much a shape hides of the ground
_STYLE: dict[Any, Any] = {
    "font.family": [FONT],
    "text.parse_math": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "hypermap",
    "axes.linewidth": 0.6,
}
# Names in an SVG stay text, so their halo has to come from a style.
_HALO = (
    b'<style type="text/css">g[id^="name-"] text {paint-order: stroke; stroke: #ffffff; '
    b"stroke-width: 2.2px; stroke-linejoin: round}</style>\n</svg>"
)


def draw(drawing: Drawing, suffix: str, size: int) -> bytes:
    """Return a drawing as "png" or "svg"; the longer side of the map has `size` pixels."""
    content = io.BytesIO()
    with warnings.catch_warnings(), matplotlib.rc_context():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = _figure(drawing, size, vector=suffix == "svg")
        if suffix == "png":
            figure.savefig(content, format="png", metadata={"Software": None})
            return content.getvalue()
        metadata = {"Date": None, "Creator": "Hypermap"}
        figure.savefig(content, format="svg", metadata=metadata)
        return content.getvalue().replace(b"</svg>", _HALO)


def draw_into(axes: Axes, drawing: Drawing) -> None:
    """Draw all but title, legend and scale bar into axes, whose limits become the view."""
    xmin, ymin, xmax, ymax = drawing.view
    _draw_map(axes, drawing, vector=False)
    axes.set(aspect="equal", xlim=(xmin, xmax), ylim=(ymin, ymax))
    if not drawing.labels:
        return
    axes.apply_aspect()
    inches = axes.get_window_extent().width / axes.figure.dpi
    _write_names(axes, drawing, inches * DPI / (xmax - xmin), vector=False)


def _figure(drawing: Drawing, size: int, vector: bool) -> Figure:
    xmin, ymin, xmax, ymax = drawing.view
    scale = size / max(xmax - xmin, ymax - ymin)  # pixels per meter
    width, height = (xmax - xmin) * scale, (ymax - ymin) * scale
    columns = legend_columns(drawing, height)
    legend_width = sum(column.width for column in columns)
    legend_height = max((len(column.rows) for column in columns), default=0) * ROW
    total_width = _LEFT + width + _GAP + legend_width + _RIGHT
    total_height = _TOP + max(height, legend_height - _BOTTOM) + _BOTTOM

    figure = Figure(figsize=(total_width / DPI, total_height / DPI), dpi=DPI, facecolor=PAPER)
    FigureCanvasAgg(figure)
    page = figure.add_axes((0, 0, 1, 1), xlim=(0, total_width), ylim=(0, total_height))
    page.set_axis_off()
    top = total_height - _TOP
    _write_titles(page, drawing, top)
    draw_legend(page, columns, left=_LEFT + width + _GAP, top=top)
    _draw_scale_bar(page, xmax - xmin, scale, right=_LEFT + width, y=top - height - 56)

    box = (_LEFT, top - height, width, height)
    per_page = (total_width, total_height, total_width, total_height)
    axes = figure.add_axes(tuple(np.divide(box, per_page)), xlim=(xmin, xmax), ylim=(ymin, ymax))
    _draw_map(axes, drawing, vector)
    if drawing.labels:
        _write_names(axes, drawing, scale, vector)
    return figure


def _draw_map(axes: Axes, drawing: Drawing, vector: bool) -> None:
    _style_axes(axes, drawing)
    _draw_rasters(axes, drawing, vector)
    _draw_contours(axes, drawing, vector)
    _draw_shapes(axes, drawing)
    _draw_doors(axes, drawing)
    _draw_links(axes, drawing)
    _draw_marks(axes, drawing)


def _style_axes(axes: Axes, drawing: Drawing) -> None:
    legends = [raster.picture.legend for raster in drawing.rasters]
    unknown = [legend["Unknown"] for legend in legends if "Unknown" in legend]
    red, green, blue = unknown[0] if unknown else (255, 255, 255)
    axes.set_facecolor((red / 255, green / 255, blue / 255))
    axes.set_xlabel("x [m]", fontsize=SMALL, color=FAINT)
    axes.set_ylabel("y [m]", fontsize=SMALL, color=FAINT)
    axes.tick_params(labelsize=SMALL, colors=FAINT, width=0.6, length=3)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=9, steps=[1, 2, 5, 10]))
    for spine in axes.spines.values():
        spine.set_color("#b0b0b0")


def _write_titles(page: Axes, drawing: Drawing, top: float) -> None:
    y = top + 22
    if drawing.subtitle:
        page.text(_LEFT, y, drawing.subtitle, fontsize=SMALL, color=FAINT)
        y += 28
    if drawing.title:
        page.text(_LEFT, y, printable(drawing.title), fontsize=TITLE, weight="bold", color=INK)


def _draw_rasters(axes: Axes, drawing: Drawing, vector: bool) -> None:
    for raster in (*drawing.rasters, *drawing.walls):
        grid = raster.picture.grid
        width, height = grid.width * grid.resolution, grid.height * grid.resolution
        axes.imshow(
            raster.picture.rgba,
            origin="lower",
            extent=(0, width, 0, height),
            aspect="auto",
            # Cells larger than pixels stay sharp; where they are smaller, thin walls survive.
            interpolation="none" if vector else "antialiased",
            transform=Affine2D(raster.pose.matrix()) + axes.transData,
        )


def _draw_contours(axes: Axes, drawing: Drawing, vector: bool) -> None:
    """Draw lines at round values, with the value on them."""
    number = 0
    for each in drawing.contours:
        known = np.ma.masked_invalid(each.values)
        if known.count() == 0 or min(known.shape) < 2:
            continue
        low, high = float(known.min()), float(known.max())
        levels = [level for level in _CONTOURS.tick_values(low, high) if low < level < high]
        if not levels:
            continue
        x, y = np.moveaxis(each.points_xy, 2, 0)
        lines = axes.contour(x, y, known, levels, colors=[INK], linewidths=0.7)
        for text in axes.clabel(
            lines, fontsize=NAME, fmt=lambda v, u=each.unit: f"{v:g} {u}".rstrip()
        ):
            text.set_gid(f"name-contour-{number}")
            number += 1
            if not vector:
                text.set_path_effects([withStroke(linewidth=2.2, foreground=PAPER)])


def _draw_shapes(axes: Axes, drawing: Drawing) -> None:
    for part in drawing.shapes:
        for name, shape in zip(part.names, part.shapes, strict=True):
            rings, color = _rings(shape), drawing.colors[name]
            if part.are_outlines:
                axes.add_patch(PathPatch(rings, **line_style(color)))
                continue
            # White in between keeps the color that of the legend where the ground is black.
            axes.add_patch(PathPatch(rings, facecolor=PAPER, alpha=_VEIL, linewidth=0))
            axes.add_patch(PathPatch(rings, **fill_style(color, SHAPE_ALPHA)))


def _draw_doors(axes: Axes, drawing: Drawing) -> None:
    """Draw each door as a white line with dark borders."""
    for width, color in ((3.2, INK), (1.6, PAPER)):
        for ends in drawing.doors:
            axes.plot(*ends.T, color=color, linewidth=width, solid_capstyle="butt")


def _draw_links(axes: Axes, drawing: Drawing) -> None:
    """Draw lines with a dot at their second end, and arrows."""
    for ends in drawing.links:
        axes.plot(*ends.T, color=INK, linewidth=0.9, solid_capstyle="round")
        axes.plot(*ends[1], color=INK, marker="o", markersize=2.4, markeredgewidth=0)
    for begin, end in drawing.arrows:
        axes.add_patch(
            FancyArrowPatch(
                begin,
                end,
                arrowstyle="-|>",
                mutation_scale=9,
                linewidth=1.1,
                color=INK,
                shrinkA=0,
                shrinkB=0,
            )
        )


def _draw_marks(axes: Axes, drawing: Drawing) -> None:
    """Draw the number of each note in a dot at its place, and the outline of its area."""
    for mark in drawing.marks:
        if mark.area is not None:
            axes.add_patch(PathPatch(_rings(mark.area), **line_style(NOTE), linestyle=(0, (4, 3))))
    for mark in drawing.marks:
        # Text in a box would not be round, and a circle in meters would not keep its size.
        axes.plot(
            mark.x,
            mark.y,
            marker="o",
            markersize=MARK,
            color=NOTE,
            markeredgecolor=PAPER,
            markeredgewidth=0.9,
            zorder=5,
        )
        axes.annotate(
            str(mark.number),
            (mark.x, mark.y),
            fontsize=NAME,
            color=PAPER,
            weight="bold",
            ha="center",
            va="center_baseline",
            zorder=6,
            annotation_clip=True,
        )


def _rings(shape: BaseGeometry) -> Outline:
    """Return the rings of a polygon, holes too; what has no area is drawn as a small blot."""
    if shape.area == 0:
        shape = shape.buffer(0.05)
    polygons = shapely.get_parts(shapely.normalize(shape))
    rings = [ring for polygon in polygons for ring in shapely.get_rings(polygon)]
    paths = [Outline(shapely.get_coordinates(ring), closed=True) for ring in rings]
    return Outline.make_compound_path(*paths)


def _write_names(axes: Axes, drawing: Drawing, scale: float, vector: bool) -> None:
    origin = np.array(drawing.view[:2])
    height = NAME * DPI / 72
    names, spots = [], []
    for part in drawing.shapes:
        texts = part.names if part.labels is None else part.labels
        for name, shape in zip(texts, part.shapes, strict=True):
            if not name:
                continue
            text = printable(name)
            names.append(text)
            in_pixels = shapely.transform(shape, lambda points: (points - origin) * scale)
            spots.append(Spot(in_pixels, (text_width(text, NAME), height)))
    width, length = (np.array(drawing.view[2:]) - origin) * scale
    places = place_labels(spots, (4, 4, width - 4, length - 4))
    for i, (text, place) in enumerate(zip(names, places, strict=True)):
        if place is None:
            continue
        x, y = origin + np.array([place[0], place[1] - 0.36 * height]) / scale
        written = axes.text(x, y, text, fontsize=NAME, color=INK, ha="center", parse_math=False)
        written.set_gid(f"name-{i}")
        if not vector:
            written.set_path_effects([withStroke(linewidth=2.2, foreground=PAPER)])


def _draw_scale_bar(page: Axes, meters_wide: float, scale: float, right: float, y: float) -> None:
    """Draw a bar of a round length below the map, at its right end."""
    meters = round_length(0.2 * meters_wide)
    text = f"{meters:g} m" if meters >= 1 else f"{100 * meters:g} cm"
    long = meters * scale
    left = right - long
    page.add_patch(Rectangle((left, y), long, 7, facecolor=INK, linewidth=0))
    page.add_patch(
        Rectangle((left + long / 2, y + 1), long / 2 - 1, 5, facecolor=PAPER, linewidth=0)
    )
    page.text(left - 10, y - 3, text, fontsize=SMALL, color=INK, ha="right")


def round_length(limit: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not above the limit.

    >>> [round_length(x) for x in (0.3, 1.0, 4.9, 70)]
    [0.2, 1.0, 2.0, 50.0]
    """
    power = 10.0 ** math.floor(math.log10(limit))
    return max(step * power for step in (1, 2, 5) if step * power <= limit * (1 + 1e-9))
