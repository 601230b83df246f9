"""Plots of results, as matplotlib figures."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hypermap.experiments.tables import Interval, Table

_GAIN, _LOSS, _UNSURE = "#0b6e4f", "#b3123b", "#8a93a3"


def changes_plot(table: Table, titles: Sequence[str]) -> Figure:
    """Return the changes of some columns of a table, with their intervals: a forest plot.

    Args:
        table: the rows of its columns are intervals.
        titles: of the columns, for which higher is better.
    """
    names = [str(row[0]) for row in table.rows]
    size = (3.0 * len(titles) + 2.2, 0.28 * len(names) + 0.9)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(1, len(titles), sharey=True, squeeze=False)[0]
    heads = [column.title for column in table.columns]
    for axes, title in zip(panels, titles, strict=True):
        place = heads.index(title)
        axes.axvline(0, color="#444", linewidth=0.8)
        for y, row in enumerate(table.rows):
            cell = row[place]
            if isinstance(cell, Interval):
                _interval(axes, y, cell)
        axes.set_title(title, fontsize=10)
        axes.set_yticks(range(len(names)), names, fontsize=9)
        axes.grid(axis="x", color="#e3e6eb", linewidth=0.7)
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
    panels[0].invert_yaxis()
    return figure


def _interval(axes: Axes, y: float, cell: Interval) -> None:
    color = _LOSS if cell.high < 0 else _GAIN if cell.low > 0 else _UNSURE
    axes.plot([cell.low, cell.high], [y, y], color=color, linewidth=2, solid_capstyle="round")
    axes.plot([cell.mean], [y], "o", color=color, markersize=5)
