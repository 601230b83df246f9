"""Watching a map grow: `--view` of `hypermap map` and `hypermap demo`."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import typer

from hypermap.cli.options import PAGE_PORT, port_option
from hypermap.cli.signals import stop_on_signal
from hypermap.cli.terminal import note, say
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.cli.progress import Report
    from hypermap.mapping.mapper import MappedFrame, Mapper
    from hypermap.mapping.recording_to_map import Progress
    from hypermap.viewer.watch.run import WatchedRun

PANEL = "Watch it in the browser"
_LOOK_PERIOD = 0.2  # s

View = Annotated[
    bool,
    typer.Option(
        "--view",
        rich_help_panel=PANEL,
        help="Watch the map in the browser: how it grows, frame by frame.",
    ),
]
Port = Annotated[int | None, port_option(PAGE_PORT, panel=PANEL)]
Browser = Annotated[
    bool,
    typer.Option(
        "--browser/--no-browser", rich_help_panel=PANEL, help="Open the page in the browser."
    ),
]


class Watched(Protocol):
    """An observer of a run.

    Attributes:
        frame: callback for `map_recording`, called with each mapped frame; None if nobody watches.
    """

    @property
    def frame(self) -> Callable[[MappedFrame, Mapper], None] | None:
        """Return the callback."""

    def with_progress(self, report: Report) -> Report:
        """Return a callback that passes progress on to `report` and to the observer."""

    def finish(self, message: str) -> None:
        """Say that the map is saved, and serve the run and the map until Ctrl-C."""


class _Nobody:
    frame = None

    def with_progress(self, report: Report) -> Report:
        return report

    def finish(self, message: str) -> None:
        pass


class _Page:
    """The page in the browser."""

    def __init__(self, run: WatchedRun, url: str, output: Path) -> None:
        self._run = run
        self._url = url
        self._output = output
        self.frame: Callable[[MappedFrame, Mapper], None] = run.watch

    def with_progress(self, report: Report) -> Report:
        def both(progress: Progress) -> None:
            report(progress)
            self._run.progress(progress)

        return both

    def finish(self, message: str) -> None:
        from hypermap.viewer.live.app import MapApp
        from hypermap.viewer.live.document import MapDocument
        from hypermap.viewer.live.serving import listen, serving, url_of

        document = MapDocument(self._output)
        app = MapApp(document)
        with listen("127.0.0.1", None) as listening, serving(app, listening):
            url = url_of(app, listening)
            self._run.finish(message, url)
            with stop_on_signal() as stop:
                note(f"\nthe run stays at {self._url}\nand the map at {url} until Ctrl-C")
                while not stop.is_wanted:
                    time.sleep(_LOOK_PERIOD)
            note("")  # below the ^C
        if document.is_unsaved:
            note(f"{document.file.path}: unsaved changes made in the browser are lost")


@contextmanager
def watching(
    view: bool, recording: str, output: Path, total: int, port: int | None, browser: bool
) -> Iterator[Watched]:
    """Serve the page that shows a run while the caller maps, if the user wants it.

    Args:
        view: whether the user wants to watch.
        recording: name of what is mapped.
        output: where the map will be saved.
        total: frames of the recording, at most.
        port: where to listen; 0 for any, None for the first that is free.
        browser: whether the page is opened.

    Raises:
        HypermapError: If the port is in use, the page is not built, or the other options are given
            without `view`.
    """
    if not view:
        if port is not None or not browser:
            raise HypermapError("--port and --no-browser need --view")
        yield _Nobody()
        return
    from hypermap.viewer.live.page import require_page
    from hypermap.viewer.live.serving import listen, open_browser, serving, url_of
    from hypermap.viewer.watch.app import RunApp
    from hypermap.viewer.watch.run import WatchedRun

    require_page()
    with (
        tempfile.TemporaryDirectory(prefix="hypermap-run-") as folder,
        listen("127.0.0.1", port) as listening,
    ):
        run = WatchedRun(Path(folder), recording, output.name, total)
        app = RunApp(run)
        with closing(run), serving(app, listening):
            url = url_of(app, listening)
            say(url)
            if browser:
                open_browser(app, listening)
            try:
                yield _Page(run, url, output)
            except HypermapError as error:
                run.fail(str(error))
                raise
