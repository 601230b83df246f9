"""The browser, and maps to look at; tests of the page share the xdist group "page"."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hypermap.formats import save_map
from hypermap.simulation import demo_world, ground_truth

CALM: Any = {"reduced_motion": "reduce"}


class Shared:
    """One browser and its windows for tests of the page that follow each other.

    A browser takes a second to start. It ends with the last of these tests, as no event loop may
    run where others need one; and with a test that has failed, which may have left anything.
    """

    def __init__(self) -> None:
        self.has_failed = False
        self._open = ExitStack()
        self._browser: Any = None
        self._windows: dict[str, Any] = {}

    def browser(self) -> Any:
        """Return the browser, started when it is first asked for."""
        from .page_tools import a_browser

        if self.has_failed:
            self.close()
        if self._browser is None:
            self._browser = self._open.enter_context(a_browser())
        return self._browser

    @contextmanager
    def window(
        self, name: str, make: Callable[[Any], AbstractContextManager[Any]]
    ) -> Iterator[Any]:
        """Lend an empty window, which is made when it is first asked for."""
        from .page_tools import leave

        browser = self.browser()
        if name not in self._windows:
            self._windows[name] = self._open.enter_context(make(browser))
        yield self._windows[name]
        leave(self._windows[name].page)

    def close(self) -> None:
        """End the browser."""
        self.has_failed, self._browser = False, None
        self._windows.clear()
        self._open.close()


_shared = Shared()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Remember that a test has failed."""
    report = yield
    _shared.has_failed |= report.failed
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Generator[None, None, None]:
    """End the browser unless another test of the page follows."""
    try:
        return (yield)
    finally:
        group = nextitem.get_closest_marker("xdist_group") if nextitem else None
        if group is None or group.args != ("page",):
            _shared.close()


def pytest_sessionfinish() -> None:
    """End the browser, also where Ctrl-C has ended the tests."""
    _shared.close()


@pytest.fixture
def shared() -> Shared:
    """What tests of the page share."""
    return _shared


@pytest.fixture
def browser(shared: Shared) -> object:
    """A browser."""
    return shared.browser()


@pytest.fixture
def empty_window(shared: Shared) -> Iterator[Any]:
    """The window that tests load the page in, each anew.

    Its user prefers reduced motion, as each step of a flight is drawn by the processor here; the
    windows that tests open themselves show the motion.
    """
    from .page_tools import a_window

    with shared.window("first", partial(a_window, url=None, **CALM)) as window:
        yield window


@pytest.fixture
def second_window(shared: Shared) -> Iterator[Any]:
    """Another one that shares nothing with the first."""
    from .page_tools import a_window

    with shared.window("second", partial(a_window, url=None, **CALM)) as window:
        yield window


@pytest.fixture
def window(empty_window: Any, url: str) -> Iterator[Any]:
    """A window that shows the small map at a module's `url`; nothing may go wrong in it."""
    from .small_map import METRES_PER_PIXEL

    empty_window.load(url, (5, 4, METRES_PER_PIXEL))
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
        empty_window.load(url, (5, 4, METRES_PER_PIXEL))
        yield Edited(path, url, empty_window)
        assert empty_window.hosts() == {"127.0.0.1"}


@pytest.fixture
def other(second_window: Any, edited: Any) -> Any:
    """A second window that shows the map of `edited`."""
    from .small_map import METRES_PER_PIXEL

    second_window.load(edited.url, (5, 4, METRES_PER_PIXEL))
    return second_window
