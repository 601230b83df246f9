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


@pytest.fixture
def window(browser: Any, url: str) -> Iterator[Any]:
    """A window that shows the small map at a module's `url`; nothing may go wrong in it."""
    from .page_tools import a_window
    from .small_map import METRES_PER_PIXEL

    with a_window(browser, url) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        yield window
        assert window.hosts() == {"127.0.0.1"}
        assert window.complaints == []


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
def edited(browser: Any, tmp_path: Path) -> Iterator[Any]:
    """A small map in a window, to be changed: an `Edited`."""
    from .editing_tools import Edited
    from .page_tools import a_server, a_window
    from .small_map import METRES_PER_PIXEL, saved_small_map

    path = saved_small_map(tmp_path)
    with a_server(path) as url, a_window(browser, url) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        yield Edited(path, url, window)
        assert window.hosts() == {"127.0.0.1"}


@pytest.fixture
def other(browser: Any, edited: Any) -> Iterator[Any]:
    """A second window that shows the map of `edited`."""
    from .page_tools import a_window
    from .small_map import METRES_PER_PIXEL

    with a_window(browser, edited.url) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        yield window
