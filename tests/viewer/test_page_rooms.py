"""Rooms, doors and paths on the page, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import shapely
from playwright.sync_api import Browser, Locator, expect

from hypermap.colors import class_colors
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map
from hypermap.paths import PathSettings, Planner
from hypermap.rooms import Door, Room, Rooms, rooms_of_map, with_rooms
from hypermap.viewer.live.export import export_page

from .editing_tools import rename, save, start_editing
from .page_tools import Window, a_server, a_window

pytestmark = pytest.mark.xdist_group("page")

METRES_PER_PIXEL = 0.015
START, GOAL = (2.0, 1.0), (7.5, 1.0)


def flat() -> Hypermap:
    """Return two rooms with a door of 0.9 m at the upper end of the wall, and a cup."""
    cells = np.full((100, 180), 100, dtype=np.int8)
    cells[10:90, 8:88] = cells[10:90, 92:172] = cells[70:88, 88:92] = 0
    grid = OccupancyLayer("occupancy", "map", GridGeometry(180, 100, 0.05), cells)
    cup = SemanticObject("cup", shapely.box(2.4, 2.4, 2.8, 2.8))
    boxes = {"kitchen": (0.4, 0.5, 4.5, 4.5), "office": (4.5, 0.5, 8.6, 4.5)}
    rooms = [Room(i, name, shapely.box(*boxes[name]), name) for i, name in enumerate(boxes)]
    door = Door((0, 1), shapely.LineString([(4.5, 3.5), (4.5, 4.4)]), 0.9)
    hypermap = Hypermap([grid, SemanticLayer("things", "map", [cup])])
    return with_rooms(hypermap, Rooms("map", tuple(rooms), (door,)))


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rooms") / "flat.hmap"
    save_map(flat(), path)
    return path


@pytest.fixture(scope="module")
def url(path: Path) -> Iterator[str]:
    with a_server(path) as url:
        yield url


@pytest.fixture
def window(empty_window: Window, url: str) -> Iterator[Window]:
    empty_window.load(url, (4.5, 2.5, METRES_PER_PIXEL))
    yield empty_window
    # Chromium complains of refused questions, which some tests ask.
    assert all("400 (Bad Request)" in text for text in empty_window.complaints)


def find_path(window: Window, start: tuple[float, float], goal: tuple[float, float]) -> None:
    """Choose the tool, if it is not chosen yet, and click start and goal."""
    page = window.page
    if page.locator("#tool-path").get_attribute("aria-pressed") != "true":
        page.locator("#tool-path").click()
    window.click_at(*start)
    expect(page.locator("#hint")).to_have_text("Click the goal of the path")
    window.wait_until_no_double_click()
    window.click_at(*goal)
    page.locator("#robot-radius").wait_for()


def accent_near(window: Window, x: float, y: float) -> bool:
    """Whether a line in the color of marks passes near a point."""
    around = np.mgrid[-4:5, -4:5].reshape(2, -1).T * METRES_PER_PIXEL
    colors = window.colors_at(around + np.array([x, y])).astype(int)
    return bool((np.abs(colors - [36, 86, 214]).max(axis=1) < 12).any())


def length_shown(window: Window) -> float:
    title = window.page.locator("#panel h2").inner_text()
    assert title.endswith(" m")
    return float(title.removesuffix(" m"))


def test_a_path_between_two_clicks_is_drawn_with_its_length(window: Window, path: Path) -> None:
    page = window.page
    find_path(window, START, GOAL)
    shortest = Planner(open_map(path)).path(START, GOAL).length
    assert length_shown(window) == pytest.approx(shortest, abs=3 * METRES_PER_PIXEL)
    assert page.locator("#panel ol.passed").all_inner_texts() == [
        "kitchen\noffice",
        "4.50, 3.95: 0.90 m wide",
    ]
    expect(page.locator("#panel pre code")).to_contain_text("planner.path(")
    assert accent_near(window, 4.5, 3.5)
    assert not accent_near(window, 4.75, 1.0)

    page.locator("#robot-radius").fill("0.6")
    page.locator("#robot-radius").press("Enter")
    expect(page.locator("#panel h2")).to_have_text("No path")
    expect(page.locator("#panel")).to_contain_text("for a radius of 0.6 m")
    assert not accent_near(window, 4.5, 3.5)
    page.locator("#robot-radius").fill("0.2")
    page.locator("#robot-radius").press("Enter")
    expect(page.locator("#panel h2")).not_to_have_text("No path")
    wider = Planner(open_map(path), PathSettings(0.2)).path(START, GOAL).length
    assert length_shown(window) == pytest.approx(wider, abs=3 * METRES_PER_PIXEL)
    assert wider > shortest + 0.1

    find_path(window, START, (4.5, 1.0))  # the tool is still in the hand
    expect(page.locator("#panel")).to_contain_text("The goal (4.50, 1.00) is in a wall")
    page.keyboard.press("Escape")
    expect(page.locator("#panel")).to_be_hidden()
    page.keyboard.press("Escape")
    expect(page.locator("#tool-point")).to_have_attribute("aria-pressed", "true")
    window.ask_at(7.0, 1.5)
    assert window.said("rooms") == "office"


def test_the_page_tells_in_which_room_an_object_is(window: Window) -> None:
    window.page.locator("#search").fill("cup")
    window.page.keyboard.press("Enter")
    expect(window.page.locator("#panel ol.found button")).to_contain_text("kitchen · ")
    room = window.page.locator("#panel dt", has_text="Room").locator("+ dd")
    expect(room).to_have_text("kitchen")
    expect(window.page.locator("#subtitle")).to_contain_text("1 object, 2 rooms · ")


@pytest.mark.parametrize("question", ["which room is the cup in?", "where is the kitchen?"])
def test_a_room_that_is_the_answer_is_marked_on_the_map(window: Window, question: str) -> None:
    assert not accent_near(window, 0.4, 1.0)
    window.page.locator("#search").fill(question)
    window.page.keyboard.press("Enter")
    expect(window.page.locator("#panel h2")).to_have_text(question)
    window.wait_until_drawn()
    assert accent_near(window, 0.4, 1.0)  # the border of the kitchen
    assert not accent_near(window, 8.6, 1.0)  # that of the office


def test_a_click_on_a_room_tells_what_is_behind_its_doors(window: Window) -> None:
    window.ask_at(7.0, 1.5)
    assert window.said("rooms") == "office"
    panel = window.page.locator("#panel")
    expect(panel.locator("dt", has_text="Door").locator("+ dd")).to_have_text("0.90 m to kitchen")
    expect(panel).not_to_contain_text("Evidence")


def test_rooms_lie_below_things_and_doors_come_and_go_with_them(window: Window) -> None:
    colors = class_colors(["cup", "kitchen", "office"])
    floor = tuple(1 - 0.45 * (1 - part) for part in colors["kitchen"])  # white shows through
    page = window.page
    page.locator("#show-labels").uncheck()
    window.wait_until_drawn()

    def shows(x: float, y: float, color: tuple[float, float, float]) -> bool:
        seen = window.colors_at([[x, y]]).astype(int)[0]
        return bool(np.abs(seen - 255 * np.array(color)).max() <= 3)

    assert shows(2.6, 2.6, colors["cup"])
    assert shows(1.5, 1.5, floor)
    assert shows(4.5, 3.95, (1, 1, 1))  # the door
    page.get_by_label("Show layer things").uncheck()
    window.wait_until_drawn()
    assert shows(2.6, 2.6, floor)
    borders = [[4.5 + 4 * side * METRES_PER_PIXEL, 3.95] for side in (-1, 1)]
    assert shows(1.5, 1.5, floor)
    page.get_by_label("Show layer rooms").uncheck()
    window.wait_until_drawn()
    assert shows(1.5, 1.5, (1, 1, 1))
    assert (window.colors_at(borders) > 240).all()  # no border of a door


def test_a_room_is_renamed_by_hand_keeps_its_doors_and_that_is_undone(
    window: Window, path: Path
) -> None:
    page = window.page
    start_editing(window)
    window.click_at(7.0, 1.5)
    expect(page.locator("#object-name")).to_have_value("office")
    rename(window, "laboratory")
    save(window)
    rooms = Rooms.of_layer(open_map(path).semantic("rooms"))
    assert (rooms[1].name, rooms[1].is_named, len(rooms.doors)) == ("laboratory", True, 1)
    page.locator("#edit-undo").click()
    expect(page.locator('[data-class="office"]')).to_be_attached()


def draw_across(window: Window, start: tuple[float, float], goal: tuple[float, float]) -> None:
    window.page.get_by_role("button", name="Split…").click()
    expect(window.page.locator("#hint")).to_contain_text("Click both ends of a line across")
    window.click_at(*start)
    window.wait_until_no_double_click()
    window.click_at(*goal)


def class_of(window: Window, name: str) -> Locator:
    return window.page.locator(f'[data-layer="rooms"] [data-class="{name}"]')


def test_a_room_is_split_by_a_line_and_that_is_undone(empty_window: Window, tmp_path: Path) -> None:
    path = tmp_path / "split.hmap"
    save_map(flat(), path)
    with a_server(path) as url:
        window = empty_window
        window.load(url, (4.5, 2.5, METRES_PER_PIXEL))
        page = window.page
        start_editing(window)
        window.click_at(7.0, 1.5)
        expect(page.locator("#object-name")).to_have_value("office")
        rename(window, "Emma's place")

        draw_across(window, (7.0, 1.0), (7.5, 1.0))  # ends in the middle of the room
        expect(page.get_by_role("alert")).to_contain_text("the line does not divide")
        assert class_of(window, "Emma's place 2").count() == 0

        draw_across(window, (6.55, 0.55), (6.55, 4.45))  # where a press drags the edge otherwise
        expect(class_of(window, "Emma's place 2")).to_be_attached()
        expect(page.locator("#panel h2")).to_have_text("Emma's place")
        page.locator("#edit-undo").click()
        expect(class_of(window, "Emma's place 2")).not_to_be_attached()
        page.locator("#edit-redo").click()
        expect(class_of(window, "Emma's place 2")).to_be_attached()
        expect(page.get_by_role("status").filter(has_text="Reshaped")).to_have_count(0)
        save(window)
        rooms = Rooms.of_layer(open_map(path).semantic("rooms"))
        assert [(room.name, room.is_named) for room in rooms] == [
            ("kitchen", False),
            ("Emma's place", True),
            ("Emma's place 2", True),
        ]
        areas = [room.area for room in rooms]
        assert areas == pytest.approx([16.4, 8.2, 8.2], abs=8 * METRES_PER_PIXEL)
        assert areas[1] + areas[2] == pytest.approx(16.4)
        assert sorted(door.rooms for door in rooms.doors) in (
            [(0, 1), (1, 2)],
            [(0, 2), (1, 2)],
        )
        page.keyboard.press("Escape")
        window.click_at(2.5, 2.6)  # the cup, which is no room
        expect(page.locator("#object-name")).to_have_value("cup")
        expect(page.get_by_role("button", name="Split…")).to_have_count(0)


def test_rooms_are_found_by_a_button_where_there_are_none(
    empty_window: Window, tmp_path: Path
) -> None:
    path = tmp_path / "none.hmap"
    hypermap = flat()
    hypermap.remove("rooms")
    save_map(hypermap, path)
    with a_server(path) as url:
        window = empty_window
        window.load(url, (4.5, 2.5, METRES_PER_PIXEL))
        start_editing(window)
        button = window.page.locator("#edit-find-rooms")
        button.click()
        expect(class_of(window, "room 2")).to_be_attached()
        expect(button).to_be_hidden()
        (door,) = rooms_of_map(hypermap).doors
        window.wait_until_drawn()
        assert (window.colors_at([door.place_xy]) > 240).all()
        window.page.locator("#edit-undo").click()
        expect(button).to_be_visible()
        expect(class_of(window, "room 2")).not_to_be_attached()
        window.page.locator("#edit-redo").click()
        expect(button).to_be_hidden()
        save(window)
        found, expected = Rooms.of_layer(open_map(path).semantic("rooms")), rooms_of_map(hypermap)
        assert [room.name for room in found] == [room.name for room in expected]
        assert [door.rooms for door in found.doors] == [(0, 1)]
        assert window.complaints == []


def test_a_page_in_a_file_shows_doors_and_offers_no_paths(browser: Browser, path: Path) -> None:
    html = path.with_name("page.html")
    export_page(flat(), path, html)
    with a_window(browser, html.as_uri()) as window:
        window.look_at(4.5, 2.5, METRES_PER_PIXEL)
        expect(window.page.locator("#tool-path")).to_be_hidden()
        assert (window.colors_at([[4.5, 3.95]]) > 240).all()
        assert window.complaints == []
