"""Draws a map into your own figure: matplotlib's axes in, axes out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hypermap.core.arguments import check_kind
from hypermap.text import printable
from hypermap.viewer.picture import compose

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shapely.geometry.base import BaseGeometry

    from hypermap.core.hypermap import Hypermap
    from hypermap.exploration import Frontier


def plot(
    hypermap: Hypermap,
    axes: Axes | None = None,
    *,
    layers: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    area: BaseGeometry | None = None,
    frontiers: Sequence[Frontier] = (),
    contours: bool = False,
    full: bool = False,
    labels: bool = True,
    legend: bool = False,
) -> Axes:
    """Draw a map from above into matplotlib's axes, in its base frame, and return them.

    What is drawn afterwards lies above the map, as `axes.plot(xs, ys)`; the axes are in meters.

    Args:
        hypermap: the map.
        axes: where to draw; their limits become those of the map. None for a figure of its own,
            made by `matplotlib.pyplot`.
        layers: names of the layers to draw, or one; None for all that can be drawn.
        names: classes of objects to draw, or one; None for all.
        area: what to show, in the base frame [m]; None for all that is known.
        frontiers: borders of the unknown, numbered as given, with where to stand.
        contours: whether to draw lines of equal value over measured values.
        full: whether to show the grids as far as they reach, not only where something is known.
        labels: whether to write names at the shapes.
        legend: whether to add a legend of the classes, to the right of the map.

    Raises:
        HypermapError: If there is nothing to draw, the area is empty or far away, no value has
            contours, or a name is unknown.
        LayerNotFound: If there is no such layer.
        TypeError: If it is not a map, the area is not a shapely geometry, or the axes are none.
    """
    drawing = compose(
        hypermap,
        layers=layers,
        names=names,
        area=area,
        frontiers=frontiers,
        contours=contours,
        full=full,
        labels=labels,
    )
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from hypermap.viewer.drawing import draw_into
    from hypermap.viewer.paper import SHAPE_ALPHA, SMALL, fill_style

    if axes is None:
        from matplotlib import pyplot

        axes = pyplot.figure(layout="constrained").add_subplot()
    check_kind(axes, Axes)
    draw_into(axes, drawing)
    if legend:
        shown = sorted({str(name) for part in drawing.shapes for name in part.names})
        fills = {name: fill_style(drawing.colors[name], SHAPE_ALPHA) for name in shown}
        patches = [Patch(label=printable(name), **fills[name]) for name in shown]
        axes.legend(handles=patches, loc="upper left", bbox_to_anchor=(1, 1), fontsize=SMALL)
    return axes
