"""Pictures of how time and memory grow: one of each kind of work, with guides for n and n log n."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from hypermap.colors import class_colors
from hypermap.viewer.paper import DPI, FAINT, FONT, INK, NAME, PAPER, SMALL, TITLE, text_width
from suite.race import Growth, Kind
from suite.report import duration, storage

_WIDTH, _HEIGHT = 640, 420  # pixels of a panel's axes
_LEFT, _BOTTOM, _TOP, _RIGHT = 100, 76, 30, 24  # pixels around them
_HEAD = 70  # pixels above all panels
_ROW, _GAP = 22, 14  # pixels between two names, and from the axes to the names
_DARKER = 0.8  # than the colors of a map, for names to be read on white
_AMOUNTS: dict[Kind, str] = {
    "objects": "objects",
    "cells": "cells",
    "frames": "frames",
    "evidence": "pieces of evidence for each object",
}


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a panel: amounts against sizes."""

    name: str
    sizes: NDArray[np.float64]
    amounts: NDArray[np.float64]
    color: str | tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Panel:
    """Times or memory of all work of a kind, with the name and the exponent of each."""

    title: str
    curves: Sequence[Curve]
    written: Callable[[float], str]  # an amount as a text


def save(growths: Sequence[Growth], folder: Path) -> list[Path]:
    """Draw all growths, one picture per kind of work, as `growth-KIND.png`.

    Args:
        growths: of whatever kinds.
        folder: where to; it is made if it is not there.

    Returns:
        The files written, none for kinds without growths.
    """
    folder.mkdir(exist_ok=True)
    files = []
    for kind in get_args(Kind):
        some = [growth for growth in growths if growth.of == kind]
        if some:
            files.append(folder / f"growth-{kind}.png")
            _draw(kind, some, files[-1])
    return files


def _draw(kind: Kind, growths: Sequence[Growth], file: Path) -> None:
    """Draw the times of some work, and below them the memory, if any of it was measured."""
    panels = list(_panels(growths))
    names_width = max(text_width(curve.name, NAME) for panel in panels for curve in panel.curves)
    width = _LEFT + _WIDTH + _GAP + names_width + _RIGHT
    height = _HEAD + len(panels) * (_TOP + _HEIGHT + _BOTTOM)
    with matplotlib.rc_context({"font.family": [FONT], "text.parse_math": False}):
        figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=PAPER)
        FigureCanvasAgg(figure)
        bottom = height - _HEAD
        for panel in panels:
            bottom -= _TOP + _HEIGHT
            box = (_LEFT, bottom, _WIDTH, _HEIGHT)
            axes = figure.add_axes(
                tuple(np.divide(box, (width, height, width, height))), xscale="log", yscale="log"
            )
            _style(axes, panel, _AMOUNTS[kind])
            _draw_panel(axes, panel)
            bottom -= _BOTTOM
        title = f"How time and memory grow with {_AMOUNTS[kind]}"
        place = (_LEFT / width, 1 - 42 / height)
        figure.text(*place, title, fontsize=TITLE, weight="bold", color=INK)
        figure.savefig(file, format="png", metadata={"Software": None})


def _panels(growths: Sequence[Growth]) -> list[Panel]:
    colors = {
        work: tuple(_DARKER * part for part in color)
        for work, color in class_colors([growth.work for growth in growths]).items()
    }
    times: list[Curve] = []
    memory: list[Curve] = []
    for growth in growths:
        for what, curves, amounts in (
            ("time", times, growth.seconds),
            ("memory", memory, growth.bytes),
        ):
            if amounts:
                name = f"{growth.work}: n^{growth.exponents[what]:.2f}"
                line = np.array(growth.sizes, float), np.array(amounts, float)
                curves.append(Curve(name, *line, colors[growth.work]))
    panels = [Panel("time", _with_guides(times), duration)]
    return panels + ([Panel("memory", _with_guides(memory), storage)] if memory else [])


def _with_guides(curves: Sequence[Curve]) -> list[Curve]:
    """Return the curves after n and n log n, which start in the middle of the first amounts."""
    first = min(curve.sizes[0] for curve in curves)
    last = max(curve.sizes[-1] for curve in curves)
    sizes = np.geomspace(first, last, 50)
    start = np.exp(np.mean([np.log(curve.amounts[0]) for curve in curves]))
    guides = [
        Curve(name, sizes, start * law / law[0], FAINT)
        for name, law in (("n", sizes), ("n log n", sizes * np.log1p(sizes)))
    ]
    return [*guides, *curves]


def _style(axes: Axes, panel: Panel, sizes: str) -> None:
    axes.set_title(panel.title, fontsize=SMALL, color=FAINT, loc="left")
    axes.set_xlabel(sizes, fontsize=SMALL, color=FAINT)
    axes.tick_params(which="both", labelsize=SMALL, colors=FAINT, width=0.6, length=3)
    formats: tuple[Callable[[float], str], ...] = (lambda size: f"{size:,.0f}", panel.written)
    for axis, form in zip((axes.xaxis, axes.yaxis), formats, strict=True):
        axis.set_major_locator(LogLocator(numticks=12))
        axis.set_major_formatter(FuncFormatter(lambda value, _, form=form: form(value)))
        axis.set_minor_formatter(NullFormatter())
    axes.grid(color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color("#b0b0b0")
        spine.set_linewidth(0.6)


def _draw_panel(axes: Axes, panel: Panel) -> None:
    """Draw the lines, and right of them the names, each as high as its line's end if it can be."""
    for curve in panel.curves:
        is_guide = curve.color == FAINT
        look = {"linestyle": (0, (4, 3)), "linewidth": 0.9} if is_guide else {"marker": "o"}
        axes.plot(curve.sizes, curve.amounts, color=curve.color, markersize=3.5, **look)
    axes.margins(0.03, 0.04)
    axes.autoscale_view()  # now, as the places of the names depend on it
    axes.autoscale(False)
    ends = [(curve.sizes[-1], curve.amounts[-1]) for curve in panel.curves]
    points = axes.transAxes.inverted().transform(axes.transData.transform(ends))
    heights = _spread(points[:, 1] * _HEIGHT, _ROW)
    beside = 1 + _GAP / _WIDTH
    for curve, (x, y), high in zip(panel.curves, points, heights / _HEIGHT, strict=True):
        leader = ([x, beside - 0.004], [y, high])
        axes.plot(
            *leader, transform=axes.transAxes, color=curve.color, linewidth=0.5, alpha=0.6,
            clip_on=False,
        )  # fmt: skip
        axes.text(
            beside, high, curve.name, transform=axes.transAxes, fontsize=NAME, color=curve.color,
            va="center",
        )  # fmt: skip


def _spread(wanted: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Return heights in the same order that keep a distance and lie near the wanted ones."""
    order = np.argsort(wanted, kind="stable")
    steps = np.arange(len(wanted)) * least
    rest = wanted[order] - steps  # may not descend any more: neighbors that do share their mean
    blocks: list[list[float]] = []
    for value in rest:
        blocks.append([value])
        while len(blocks) > 1 and np.mean(blocks[-2]) > np.mean(blocks[-1]):
            blocks[-2:] = [blocks[-2] + blocks[-1]]
    heights = np.empty(len(wanted))
    heights[order] = steps + np.concatenate([[np.mean(block)] * len(block) for block in blocks])
    return heights
