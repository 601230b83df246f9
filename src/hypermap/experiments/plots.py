"""Plots of results, as matplotlib figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hypermap.experiments.breakdown import KINDS
from hypermap.experiments.methods import OURS
from hypermap.experiments.results import Data
from hypermap.experiments.tables import Interval, Table
from hypermap.experiments.thesis_tables import NOT_MAPPED, NOTHING

_OURS = "#0b6e4f"
_OTHERS = ("#4a78c2", "#9dbbe6", "#d9822b", "#f0bd7f", "#8d5aa8", "#c2566a", "#6f7780")
_GAIN, _LOSS, _UNSURE = "#0b6e4f", "#b3123b", "#8a93a3"


def changes_plot(table: Table, titles: Sequence[str]) -> Figure:
    """Return the changes of some columns of a table, with their intervals: a forest plot.

    Args:
        table: the rows of its columns are intervals.
        titles: of the columns, for which higher is better.
    """
    names = [_plain(str(row[0])) for row in table.rows]
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
    panels[0].set_ylim(len(names) - 0.5, -0.5)
    return figure


def _interval(axes: Axes, y: float, cell: Interval) -> None:
    is_known = cell.low < cell.high  # of one drive, the interval has no width
    color = _UNSURE
    if is_known and not cell.low <= 0 <= cell.high:
        color = _GAIN if cell.low > 0 else _LOSS
    axes.plot([cell.low, cell.high], [y, y], color=color, linewidth=2, solid_capstyle="round")
    axes.plot([cell.mean], [y], "o", color=color, markersize=5)


def groups_plot(world: Data) -> Figure:
    """Return recall by size, distance and number of detections, a line for each method."""
    figure = Figure(figsize=(11, 3.4), layout="constrained")
    panels = figure.subplots(1, len(KINDS), sharey=True)
    for axes, (name, kind) in zip(panels, KINDS.items(), strict=True):
        first = next(iter(world["methods"].values()))["groups"][name]
        places = np.arange(len(first))
        counts = np.array([group["objects"] for group in first])
        axes.bar(places, counts / counts.max(), width=0.8, color="#eceff3", zorder=0)
        for method, style in _styles(world).items():
            groups = world["methods"][method]["groups"][name]
            axes.plot(places, [group["recall"] for group in groups], label=_plain(method), **style)
        words = [f"{group['words']}\n({group['objects']})" for group in first]
        axes.set_xticks(places, words, fontsize=7.5)
        axes.set_xlabel(f"{kind.title}, with the number of objects")
        _tidy(axes)
    panels[0].set_ylabel("recall, IoU of 0.25")
    panels[0].set_ylim(0, 1.03)
    _legend(figure, panels[0])
    return figure


def curves_plot(world: Data, limits: Sequence[float]) -> Figure:
    """Return the share of objects within a distance, and average precision over IoU."""
    figure = Figure(figsize=(11, 3.4), layout="constrained")
    near, precise = figure.subplots(1, 2)
    for method, style in _styles(world).items():
        figures = world["methods"][method]
        if figures["localization"] is not None:
            plain = {key: value for key, value in style.items() if key != "marker"}
            near.plot(limits, figures["localization"], label=_plain(method), **plain)
        precision = {
            float(at): value
            for at, value in figures["average_precision"].items()
            if value is not None
        }
        precise.plot(list(precision), list(precision.values()), label=_plain(method), **style)
    near.set_xlabel("distance between the centroids, up to [m]")
    near.set_ylabel("share of the true objects")
    near.set_xlim(0, limits[-1])
    precise.set_xlabel("IoU from which on an object is found")
    precise.set_ylabel("average precision")
    for axes in (near, precise):
        axes.set_ylim(0, 1.03)
        _tidy(axes)
    _legend(figure, near)
    return figure


def reliability_plot(method: Data) -> Figure:
    """Return the share of true objects over their confidence; larger dots are more objects."""
    figure = Figure(figsize=(4.6, 4.2), layout="constrained")
    axes = figure.subplots()
    bins = method["reliability"]
    axes.plot([0, 1], [0, 1], color="#8a93a3", linewidth=1, linestyle="--")
    total = sum(one["objects"] for one in bins) or 1
    means, right = ([one[key] for one in bins] for key in ("confidence", "right"))
    sizes = [20 + 600 * one["objects"] / total for one in bins]
    axes.scatter(means, right, s=sizes, color=_OURS, alpha=0.75, zorder=3)
    for one in bins:
        place = (one["confidence"], one["right"])
        axes.annotate(str(one["objects"]), place, (7, -11), textcoords="offset points", fontsize=8)
    axes.set_xlabel("confidence")
    axes.set_ylabel("share that is true, IoU of 0.25")
    axes.set_xlim(0, 1.05)
    axes.set_ylim(0, 1.05)
    _tidy(axes)
    return figure


def confusion_plot(method: Data) -> Figure:
    """Return the confusion matrix; colors are shares of a row."""
    classes = [_plain(name) for name in method["confusion"]["classes"]]
    counts = np.array(method["confusion"]["counts"])
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    side = 0.42 * len(counts) + 1.6
    figure = Figure(figsize=(side + 0.6, side), layout="constrained")
    axes = figure.subplots()
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1)
    for row, col in np.argwhere(counts):
        color = "white" if shares[row, col] > 0.55 else "#1d2129"
        axes.text(col, row, counts[row, col], ha="center", va="center", fontsize=8, color=color)
    places = range(len(counts))
    axes.set_xticks(places, [*classes, NOT_MAPPED], rotation=60, ha="right", fontsize=8)
    axes.set_yticks(places, [*classes, NOTHING], fontsize=8)
    axes.set_xlabel("mapped as")
    axes.set_ylabel("true class")
    axes.spines[:].set_visible(False)
    return figure


def _styles(world: Data) -> dict[str, dict[str, object]]:
    """Return how the line of each method looks; ours is the widest, and drawn last."""
    others = [name for name in world["methods"] if name != OURS]
    styles: dict[str, dict[str, object]] = {
        name: {"color": _OTHERS[k % len(_OTHERS)], "linewidth": 1.4, "marker": "o", "markersize": 3}
        for k, name in enumerate(others)
    }
    if OURS in world["methods"]:
        styles[OURS] = {"color": _OURS, "linewidth": 2.6, "marker": "o", "markersize": 4.5}
    return styles


def _plain(name: str) -> str:
    """Return a name as matplotlib shows it as it is: no formula, and not hidden in a legend."""
    return (" " if name.startswith("_") else "") + name.replace("$", r"\$")


def _tidy(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#e3e6eb", linewidth=0.7)
    axes.set_axisbelow(True)


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    columns = min(len(labels), 6)
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, frameon=False)
