"""Measured values on the page: sent as numbers, answered with deviation, chosen on a card."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from playwright.sync_api import Browser, expect

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.value_layer import ValueLayer
from hypermap.viewer.live.english import answer_in_words
from hypermap.viewer.live.export import export_page
from hypermap.viewer.live.layers import LayerViews
from hypermap.viewer.live.measured_values import describe_values
from hypermap.viewer.live.questions import Questions
from hypermap.viewer.live.snippets import AskedMap

from .live_tools import Window, saved, serving
from .page_tools import a_window
from .small_map import FLOOR, small_map

GRID = GridGeometry(40, 32, 0.25)


def warmth() -> ValueLayer:
    """Return 18 to 25.8 °C, warmer along x, unknown in the first row, and surer along y."""
    cells = np.tile(18 + 0.2 * np.arange(40), (32, 1))
    cells[0] = np.nan
    deviations = np.tile(np.linspace(0.2, 2, 32)[::-1, None], (1, 40))
    return ValueLayer("warmth", "map", GRID, cells, "°C", 1, deviations=deviations)


def with_values() -> Hypermap:
    hypermap = small_map()
    hypermap.add(warmth())
    level = ValueLayer("wifi", "map", GRID, np.full((32, 40), -60.0), "dBm", 0)
    hypermap.add(level)
    return hypermap


def unpacked(packed: dict[str, Any]) -> NDArray[np.float64]:
    whole = np.frombuffer(base64.b64decode(packed["numbers"]), "<u2").astype(float)
    whole[whole == 65535] = np.nan
    return np.asarray(packed["low"] + packed["step"] * whole)


def test_numbers_arrive_as_they_are_and_where_they_are() -> None:
    layer = warmth()
    sent = describe_values(layer, Pose2D(1, 2, 0.5))
    assert sent is not None
    assert layer.cells is not None
    assert layer.deviations is not None
    np.testing.assert_allclose(unpacked(sent["values"]), layer.cells.ravel(), atol=1e-4)
    np.testing.assert_allclose(unpacked(sent["deviations"]), layer.deviations.ravel(), atol=1e-4)
    assert sent["grid"] == {
        "x": 1.0,
        "y": 2.0,
        "yaw": 0.5,
        "resolution": 0.25,
        "width": 40,
        "height": 32,
    }


def test_a_large_grid_is_thinned_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hypermap.viewer.live.measured_values.MOST_CELLS", 400)
    layer = warmth()
    sent = describe_values(layer, Pose2D())
    assert sent is not None
    assert (sent["grid"]["resolution"], sent["grid"]["width"]) == (0.5, 20)
    assert layer.cells is not None
    np.testing.assert_allclose(unpacked(sent["values"]), layer.cells[::2, ::2].ravel(), atol=1e-4)


def test_a_point_has_its_deviation_and_an_area_its_mean_and_range() -> None:
    questions = Questions(with_values(), LayerViews(), AskedMap("room.hmap"))
    said = {layer["name"]: layer for layer in questions.at((5.1, 6.3), None)["layers"]}
    assert said["warmth"]["label"] == "22.0 ± 0.5 °C"
    assert said["wifi"]["label"] == "-60 dBm"
    corners = shapely.get_coordinates(shapely.box(5, 5, 6, 6)).tolist()
    cells = {each["layer"]: each for each in questions.area(corners, None)["cells"]}
    assert cells["warmth"]["label"] == "mean 22.3, 22.0 to 22.6 °C"
    assert cells["warmth"]["count"] == 16


def test_the_server_sends_what_a_page_holds_and_refuses_other_layers(tmp_path: Path) -> None:
    with serving(saved(tmp_path, with_values())) as client:
        window = Window(client)
        sent = window.get("/api/values/warmth")
        assert sent == describe_values(warmth(), Pose2D())
        assert "no measured values" in window.get("/api/values/semantic", expected=404)["error"]


def test_questions_about_values_are_answered_in_words(tmp_path: Path) -> None:
    def said(question: str) -> list[str]:
        words = answer_in_words(with_values(), AskedMap("room.hmap"), {"question": question})[
            "words"
        ]
        return [str(line) for line in words]

    assert said("what is the warmth at 5.1, 6.3") == ["warmth at (5.10, 6.30): 22.0 °C ± 0.55"]
    (warm,) = said("where is it warmer than 25 degrees?")
    assert warm.startswith("above 25 °C around (9.5")
    (warmest,) = said("which is the warmest chair?")
    assert warmest.endswith("23.5 °C")


@pytest.mark.xdist_group("page")
def test_the_card_shows_one_quantity_and_the_value_under_the_pointer(
    browser: Browser, tmp_path: Path
) -> None:
    html = tmp_path / "room.html"
    export_page(with_values(), "room.hmap", html)
    with a_window(browser, html.as_uri(), offline=True) as window:
        card = window.page.locator("#values")
        value = card.get_by_label("Value under the pointer")
        window.page.mouse.move(*window.pixel_of(*FLOOR))
        expect(value).to_have_text("22.0 ± 0.5 °C")
        expect(card.locator(".ticks")).to_contain_text("25.8 °C")
        drawn = """() => {
            const layers = window.hypermapPage.map.getLayers().getArray();
            const contours = layers.find((layer) => layer.getZIndex() === 18).getSource();
            return contours.getFeatures().map((line) => line.get("text")).sort();
        }"""
        assert window.page.evaluate(drawn) == []
        card.get_by_label("Contours").check()
        assert window.page.evaluate(drawn) == [f"{n} °C" for n in range(19, 26)]
        card.get_by_label("Measured quantity").select_option("wifi")
        window.page.mouse.move(*window.pixel_of(FLOOR[0] + 1, FLOOR[1]))
        expect(value).to_have_text("-60 dBm")
        assert not window.page.get_by_label("Show layer warmth").is_checked()
        window.page.get_by_label("Show layer wifi").uncheck()
        expect(card.get_by_label("Measured quantity")).to_have_value("")
        assert window.complaints == []
