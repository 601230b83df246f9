"""The browser, and maps to look at; tests of the page share the xdist group "page"."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

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
