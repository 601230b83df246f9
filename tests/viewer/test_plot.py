from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import matplotlib as mpl
import numpy as np
import pytest
import shapely
from matplotlib import pyplot
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

import hypermap as package
from hypermap.core.errors import HypermapError, LayerNotFound
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.testing import occupancy_from_text, square
from hypermap.viewer.plot import plot

WHITE, WALL, UNKNOWN = (255, 255, 255), (104, 112, 126), (229, 232, 236)


def room() -> Hypermap:
    """Six by three meters: a wall at the left, the unknown at the right, a chair in between."""
    things = [square("chair", 2.5, 1.5), square("$\\frac", 4.5, 0.5, 0.2)]
    return Hypermap(
        [occupancy_from_text("#....?\n#....?\n#....?"), SemanticLayer("things", "map", things)]
    )


@pytest.fixture(autouse=True)
def _no_window() -> Iterator[None]:
    with mpl.rc_context({"backend": "agg"}):
        yield
    pyplot.close("all")


def colors_at(axes: mpl.axes.Axes, points: list[tuple[float, float]]) -> list[tuple[int, ...]]:
    canvas = FigureCanvasAgg(axes.figure)
    canvas.draw()
    pixels: NDArray[np.uint8] = np.asarray(canvas.buffer_rgba())[::-1, :, :3]
    cols, rows = axes.transData.transform(points).astype(int).T
    return [tuple(color) for color in pixels[rows, cols].tolist()]


def test_a_map_is_drawn_into_axes_in_its_own_metres() -> None:
    figure = Figure(figsize=(8, 5))
    left, right = figure.subplots(1, 2)
    assert plot(room(), right, labels=False) is right
    places = [(0.5, 1.5), (1.5, 0.5), (5.1, 0.5)]
    assert colors_at(right, places) == [WALL, WHITE, UNKNOWN]
    (chair,) = colors_at(right, [(2.5, 1.5)])
    assert chair not in (WHITE, WALL, UNKNOWN)
    assert right.get_aspect() == 1
    assert not left.has_data()


def test_what_is_drawn_afterwards_lies_above() -> None:
    axes = plot(room(), Figure().add_subplot(), labels=False)
    axes.plot([2, 3], [1.5, 1.5], color="#ff0000", linewidth=6)
    assert colors_at(axes, [(2.5, 1.5)]) == [(255, 0, 0)]


def test_a_map_has_a_figure_of_its_own_where_no_axes_are_given() -> None:
    first, second = room().plot(), room().plot()
    assert first.figure is not second.figure
    assert first.figure.number in pyplot.get_fignums()


def test_the_options_choose_what_is_seen() -> None:
    def texts(**options: object) -> list[str]:
        axes = plot(room(), Figure().add_subplot(), **options)
        colors_at(axes, [(1, 1)])  # draws, which text in TeX's spelling would not survive
        return [text.get_text() for text in axes.texts]

    assert texts() == ["chair", "$\\frac"]
    assert texts(labels=False) == []
    assert texts(names=["chair"]) == texts(names="chair") == ["chair"]
    assert texts(layers=["occupancy"]) == texts(layers="occupancy") == []
    axes = plot(room(), Figure().add_subplot(), area=shapely.box(1, 0, 4, 3), legend=True)
    assert axes.get_xlim()[0] < 1 < 4 < axes.get_xlim()[1] < 5
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["$\\frac", "chair"]


def test_what_cannot_be_drawn_is_an_error() -> None:
    figures = pyplot.get_fignums()
    with pytest.raises(HypermapError, match="nothing to draw"):
        plot(Hypermap())
    with pytest.raises(HypermapError, match="did you mean 'chair'"):
        plot(room(), names=["char"])
    with pytest.raises(LayerNotFound):
        plot(room(), layers=["attic"])
    assert pyplot.get_fignums() == figures  # and leaves none behind


def test_pictures_are_offered_by_the_package() -> None:
    assert package.plot is plot
    assert package.render.__module__ == "hypermap.viewer.picture"


def test_asking_a_map_loads_no_matplotlib() -> None:
    code = (
        "import sys, hypermap; hypermap.Hypermap().objects(); "
        "print({'matplotlib', 'PIL', 'yaml'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
