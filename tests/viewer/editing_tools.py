"""What a user does to change a map in the browser, and what the file holds then."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from playwright.sync_api import expect

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map

from .page_tools import Window
from .small_map import PLACES


@dataclass
class Edited:
    """A saved map, the page's address, and a window that shows it."""

    path: Path
    url: str
    window: Window

    def objects(self) -> dict[int, SemanticObject]:
        """Return what the file holds, by id."""
        return objects_of(open_map(self.path))


def objects_of(hypermap: Hypermap) -> dict[int, SemanticObject]:
    layer = hypermap["semantic"]
    assert isinstance(layer, SemanticLayer)
    return {int(item.id or 0): item for item in layer.objects()}


def start_editing(window: Window) -> None:
    window.page.locator("#tool-edit").click()
    expect(window.page.locator("#editbar")).to_be_visible()


def take(window: Window, thing: int, name: str) -> None:
    """Click on an object in edit mode."""
    window.wait_until_nothing_is_drawn()
    window.click_at(*PLACES[thing])
    expect(window.page.locator("#object-name")).to_have_value(name)


def rename(window: Window, name: str) -> None:
    window.page.locator("#object-name").fill(name)
    apply(window)
    expect(window.page.locator("#panel h2")).to_have_text(name)


def apply(window: Window) -> None:
    """Change what an object is called or tagged, and wait until it is shown as it is then."""
    button = window.page.locator("#object-apply").element_handle()
    button.click()
    window.wait_for("(button) => !button.isConnected", button)


def save(window: Window) -> None:
    window.page.locator("#edit-save").click()
    expect(window.page.locator("#edit-save")).to_be_disabled()


def add_rectangle(window: Window, x0: float, y0: float, x1: float, y1: float, name: str) -> None:
    window.page.locator("#edit-rectangle").click()
    window.drag((x0, y0), (x1, y1))
    window.page.locator("#object-name").fill(name)
    window.page.locator("#object-layer").select_option("semantic")
    window.page.locator("#object-add").click()
    expect(window.page.locator(f'[data-class="{name}"]')).to_be_attached()


def draw(window: Window, tool: str, corners: list[tuple[float, float]]) -> None:
    """Draw a shape corner by corner, and end it."""
    window.page.locator(tool).click()
    for corner in corners:
        window.click_at(*corner)
        window.wait_until_no_double_click()  # which would end the shape
    window.page.keyboard.press("Enter")


def classes(window: Window) -> list[str]:
    return sorted(
        str(row.get_attribute("data-class"))
        for row in window.page.locator('[data-layer="semantic"] [data-class]').all()
    )
