"""A status line for live nodes at a terminal."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from hypermap.cli.terminal import err
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.ros.mapper.statistics import Report

_EVERY = 0.5  # s


@contextmanager
def status_line(report: Callable[[], Report | None], objects: Callable[[], int]) -> Iterator[None]:
    """Show how a node fares while the caller runs it; nothing where there is no terminal.

    Args:
        report: how it fares; None while it does not run.
        objects: how many objects it has found.
    """
    if not err().is_terminal:
        yield
        return
    from rich.status import Status

    ends = threading.Event()
    with Status("starting", console=err()) as status:

        def show() -> None:
            while not ends.wait(_EVERY):
                now = report()
                if now is not None:
                    status.update(describe(now, objects()))

        thread = threading.Thread(target=show, name="status", daemon=True)
        thread.start()
        try:
            yield
        finally:
            ends.set()
            thread.join()


def describe(report: Report, objects: int) -> str:
    """Return how a node fares, in one line."""
    rate = f"{report.frame_rate:.1f} frames/s, {report.map_rate:.1f}/s mapped"
    late = report.latency[1]
    latency = f", {1000 * late:.0f} ms behind" if late == late else ""
    return f"{counted(objects, 'object')}, {rate}{latency}; {report.message}"
