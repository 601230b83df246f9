"""Two maps over each other: what the picture holds, and where."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.evaluation import evaluate, map_objects
from hypermap.testing import occupancy_from_text, square
from hypermap.viewer.comparison import COLORS, compose_comparison, render_comparison
from hypermap.viewer.picture import Drawing

# A table found with a piece of it mapped twice, a chair missed, and a train made up.
TRUE = [square("table", 2, 2, side=2), square("chair", 6, 2)]
SEEN = [square("table", 2.5, 2, side=2), square("table", 2.5, 2.5, side=0.5), square("train", 4, 5)]
GROUND = occupancy_from_text("\n".join(["########"] * 2 + ["........"] * 6))


def arguments(seen: list[SemanticObject] = SEEN) -> tuple[object, ...]:
    true_map = Hypermap([GROUND, SemanticLayer("semantic", "map", TRUE)])
    truth = map_objects(true_map, "truth")
    seen_map = Hypermap([SemanticLayer("semantic", "map", seen)])
    estimate = map_objects(seen_map, "estimate", true_map, "truth")
    return true_map, truth, estimate, evaluate(estimate.objects, truth.objects)


def compose(seen: list[SemanticObject] = SEEN) -> Drawing:
    return compose_comparison(*arguments(seen))


def test_each_object_is_shown_as_what_became_of_it() -> None:
    estimate, truth = compose().shapes
    assert list(zip(estimate.names, estimate.labels, strict=True)) == [
        ("right", ""),
        ("false", "train false"),
        ("duplicate", "table twice"),
    ]
    assert list(zip(truth.names, truth.labels, strict=True)) == [
        ("found", "table 0.60"),
        ("missed", "chair missed"),
    ]
    assert (estimate.are_outlines, truth.are_outlines) == (False, True)


def test_a_line_joins_the_centroids_of_what_matches() -> None:
    assert compose().links == pytest.approx(np.array([[[2, 2], [2.5, 2]]]))


def test_the_view_holds_all_objects_and_the_subtitle_counts_them() -> None:
    drawing = compose()
    xmin, ymin, xmax, ymax = drawing.view
    assert xmin < 1 < 6.5 < xmax
    assert ymin < 1 < 5.5 < ymax
    assert len(drawing.rasters) == 1
    assert drawing.subtitle == (
        "1 of 2 found, 1 of 3 right (same class, IoU ≥ 0.25, one to one), frame map"
    )


def test_a_map_without_objects_shows_what_was_missed() -> None:
    drawing = compose([])
    estimate, truth = drawing.shapes
    assert len(estimate.names) == 0
    assert list(truth.names) == ["missed", "missed"]
    assert drawing.links.shape == (0, 2, 2)


def pixels_of(image: np.ndarray, name: str, alpha: float) -> np.ndarray:
    """Return rows and columns of the pixels that have a color over white, shape (2, N)."""
    color = 255 * (alpha * np.array(COLORS[name]) + 1 - alpha)
    return np.array(np.nonzero((np.abs(image.astype(float) - color) <= 3).all(axis=2)))


def test_the_picture_shows_each_kind_in_its_color(tmp_path: Path) -> None:
    render_comparison(*arguments(), tmp_path / "x.png", title="", size=700)
    with Image.open(tmp_path / "x.png") as image:
        pixels = np.asarray(image.convert("RGB"))[:, :780]  # without the legend
    counts = {name: pixels_of(pixels, name, 0.55).shape[1] for name in ("right", "false")}
    assert counts["right"] > counts["false"] > 1000
    rows, cols = pixels_of(pixels, "missed", 1)
    scale = 700 / 5.9  # pixels per meter: 5.5 m and a margin of 0.2 m on each side
    assert np.ptp(cols) == pytest.approx(1 * scale, abs=4)
    assert np.ptp(rows) == pytest.approx(1 * scale, abs=4)


def test_an_svg_names_all_kinds(tmp_path: Path) -> None:
    render_comparison(*arguments(), tmp_path / "x.svg", title="room against truth")
    texts = ["".join(t.itertext()) for t in ET.parse(tmp_path / "x.svg").iter()]
    kinds = ("right", "duplicate", "false", "found", "missed")
    for text in (*kinds, "table 0.60", "chair missed", "train false", "room against truth"):
        assert text in texts


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(HypermapError, match=r"a picture is saved as \.png"):
        render_comparison(*arguments(), tmp_path / "x.gif")
