"""Progress of long tasks: a bar at a terminal, otherwise a line now and then."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

from hypermap.cli.terminal import err, note
from hypermap.text import counted, noun, visible

if TYPE_CHECKING:
    from hypermap.mapping.recording_to_map import Progress

_EVERY = 5.0  # seconds between two plain lines

Report: TypeAlias = "Callable[[Progress], None]"


class Pace:
    """Frames per second from the end of the first frame on, which also loads compiled code."""

    def __init__(self) -> None:
        self._first: tuple[float, int] | None = None

    def after(self, done: int) -> float:
        """Return the rate, now that so many frames are done; 0 after the first one."""
        now = time.monotonic()
        if self._first is None:
            self._first = now, done
        began, before = self._first
        return (done - before) / (now - began) if done > before else 0.0


@contextmanager
def mapping_progress(total: int) -> Iterator[Report]:
    """Show the progress of mapping `total` frames while the caller reports it."""
    if err().is_terminal:
        with _bar(total) as report:
            yield report
    else:
        yield _lines(total)


@contextmanager
def counting(what: str, total: int, unit: str, units: str = "") -> Iterator[Callable[[], None]]:
    """Show how far a work on a number of units is while the caller counts them."""
    if not err().is_terminal:
        note(f"{what}: {counted(total, unit, units)} ...")
        yield _count_lines(what, total, counted(total, unit, units))
        return
    from rich import progress as rich

    with rich.Progress(
        rich.TextColumn(what),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn(f"{noun(total, unit, units)},"),
        rich.TimeRemainingColumn(),
        rich.TextColumn("left"),
        console=err(),
    ) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show that a work goes on of which nobody knows how long: a clock, or a line after 5 s."""
    if err().is_terminal:
        from rich import progress as rich

        columns = rich.TextColumn("{task.description}", markup=False), rich.TimeElapsedColumn()
        with rich.Progress(rich.SpinnerColumn(), *columns, console=err(), transient=True) as bar:
            bar.add_task(visible(what), total=None)
            yield
        return
    timer = threading.Timer(_EVERY, note, (f"{what} ...",))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _count_lines(what: str, total: int, all_units: str) -> Callable[[], None]:
    """Return what says now and then how many units are done."""
    done, last_shown = 0, time.monotonic()

    def count() -> None:
        nonlocal done, last_shown
        done += 1
        now = time.monotonic()
        if now - last_shown >= _EVERY and done < total:
            last_shown = now
            note(f"{what}: {done} of {all_units}")

    return count


@contextmanager
def downloading(what: str, size: int) -> Iterator[Callable[[int], None]]:
    """Show how many of a file's bytes are here while the caller reports them."""
    if not err().is_terminal:
        note(f"{what}: {size / 1e6:.1f} MB ...")
        yield _byte_lines(what, size)
        return
    from rich import progress as rich

    with rich.Progress(
        rich.TextColumn(what),
        rich.BarColumn(),
        rich.DownloadColumn(),
        rich.TransferSpeedColumn(),
        rich.TimeRemainingColumn(),
        console=err(),
    ) as bar:
        task = bar.add_task(what, total=size)
        yield lambda have: bar.update(task, completed=have)


def _byte_lines(what: str, size: int) -> Callable[[int], None]:
    """Return what says now and then how many bytes are here."""
    last_shown = time.monotonic()

    def report(have: int) -> None:
        nonlocal last_shown
        now = time.monotonic()
        if now - last_shown >= _EVERY and have < size:
            last_shown = now
            note(f"{what}: {have / 1e6:.1f} of {size / 1e6:.1f} MB")

    return report


@contextmanager
def _bar(total: int) -> Iterator[Report]:
    from rich import progress as rich

    pace = Pace()
    with rich.Progress(
        rich.TextColumn("mapping"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn(
            noun(total, "frame") + ", {task.fields[rate]:.1f}/s, {task.fields[objects]},"
        ),
        rich.TimeRemainingColumn(),
        rich.TextColumn("left"),
        console=err(),
    ) as bar:
        task = bar.add_task("mapping", total=total, rate=0.0, objects="0 objects")

        def report(progress: Progress) -> None:
            rate = pace.after(progress.done)
            objects = counted(progress.objects, "object")
            bar.update(task, completed=progress.done, rate=rate, objects=objects)

        yield report


def _lines(total: int) -> Report:
    pace, last_shown = Pace(), 0.0

    def report(progress: Progress) -> None:
        nonlocal last_shown
        now = time.monotonic()
        rate = pace.after(progress.done)
        text = f"mapping: {progress.done} of {counted(total, 'frame')}, "
        text += counted(progress.objects, "object")
        if rate and now - last_shown < _EVERY:
            return
        if rate:
            text += f", {rate:.1f}/s, {(total - progress.done) / rate:.0f} s left"
        last_shown = now
        note(text)

    return report
