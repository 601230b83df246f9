"""The browser, and maps to look at; tests of the page share the xdist group "page"."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hypermap.formats import save_map
from hypermap.simulation import demo_world, ground_truth


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    """A browser that ends with its module: no event loop may run here while others need one."""
    from .page_tools import a_browser

    with a_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def empty_window(browser: Any) -> Iterator[Any]:
    """The window that tests of a module load the page in, each anew."""
    from .page_tools import a_window

    with a_window(browser, None) as window:
        yield window


@pytest.fixture(scope="module")
def second_window(browser: Any) -> Iterator[Any]:
    """Another one that shares nothing with the first."""
    from .page_tools import a_window

    with a_window(browser, None) as window:
        yield window


@pytest.fixture
def window(empty_window: Any, url: str) -> Iterator[Any]:
    """A window that shows the small map at a module's `url`; nothing may go wrong in it."""
    from .small_map import METRES_PER_PIXEL

    empty_window.load(url)
    empty_window.look_at(5, 4, METRES_PER_PIXEL)
    yield empty_window
    assert empty_window.hosts() == {"127.0.0.1"}
    assert empty_window.complaints == []


@pytest.fixture
def map_named(tmp_path: Path, request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """Return a function that copies a map of that name into a folder of the test."""

    def find(name: str) -> Path:
        path = tmp_path / f"{name}.hmap"
        if name == "simulated":
            save_map(ground_truth(demo_world()), path)
            return path
        shared: Path = request.getfixturevalue("shared_data")
        path.write_bytes((shared / "maps" / path.name).read_bytes())
        return path

    return find


@pytest.fixture
def edited(empty_window: Any, tmp_path: Path) -> Iterator[Any]:
    """A small map in a window, to be changed: an `Edited`."""
    from .editing_tools import Edited
    from .page_tools import a_server
    from .small_map import METRES_PER_PIXEL, saved_small_map

    path = saved_small_map(tmp_path)
    with a_server(path) as url:
        empty_window.load(url)
        empty_window.look_at(5, 4, METRES_PER_PIXEL)
        yield Edited(path, url, empty_window)
        assert empty_window.hosts() == {"127.0.0.1"}


@pytest.fixture
def other(second_window: Any, edited: Any) -> Any:
    """A second window that shows the map of `edited`."""
    from .small_map import METRES_PER_PIXEL

    second_window.load(edited.url)
    second_window.look_at(5, 4, METRES_PER_PIXEL)
    return second_window
