"""Plots of results."""

from __future__ import annotations

from base64 import b64decode

from hypermap.experiments.page import plot_of
from hypermap.experiments.plots import changes_plot
from hypermap.experiments.tables import Column, Interval, Table


def test_only_intervals_of_several_drives_say_that_a_part_matters() -> None:
    cells = {
        "gain": Interval(0.2, 0.1, 0.3),
        "loss": Interval(-0.2, -0.3, -0.1),
        "unsure": Interval(0.1, -0.1, 0.2),
        "one drive": Interval(0.2, 0.2, 0.2),
    }
    table = Table("t", "t", (Column("part"), Column("IoU")), tuple(cells.items()))
    (axes,) = changes_plot(table, ["IoU"]).axes
    gain, loss, unsure, one = (line.get_color() for line in axes.lines[1::2])
    assert len({gain, loss, unsure}) == 3
    assert one == unsure


def test_names_are_no_formulas() -> None:
    rows = ((r"$\foo$ &", Interval(0.2, 0.1, 0.3)),)
    figure = changes_plot(Table("t", "t", (Column("part"), Column("IoU")), rows), ["IoU"])
    svg = b64decode(plot_of(figure, "").split("base64,")[1].split('"')[0]).decode()
    assert r">$\foo$ &amp;</text>" in svg
