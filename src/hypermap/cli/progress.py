"""How far a long work is: a bar at a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

from hypermap.cli.terminal import err, note

if TYPE_CHECKING:
    from hypermap.mapping.mapper import Progress

_EVERY = 5.0  # seconds between two plain lines

Report: TypeAlias = "Callable[[Progress], None]"


@contextmanager
def mapping_progress(total: int) -> Iterator[Report]:
    """Show the progress of mapping `total` frames while the caller reports it."""
    if err().is_terminal:
        with _bar(total) as report:
            yield report
    else:
        yield _lines(total)


@contextmanager
def counting(what: str, total: int, units: str) -> Iterator[Callable[[], None]]:
    """Show how far a work on a number of units is while the caller counts them."""
    if not err().is_terminal:
        note(f"{what}: {total} {units} ...")
        yield _count_lines(what, total, units)
        return
    from rich import progress as rich

    with rich.Progress(
        rich.TextColumn(what),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn(f"{units},"),
        rich.TimeRemainingColumn(),
        rich.TextColumn("left"),
        console=err(),
    ) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)


def _count_lines(what: str, total: int, units: str) -> Callable[[], None]:
    """Return what says now and then how many units are done."""
    done, told = 0, time.monotonic()

    def count() -> None:
        nonlocal done, told
        done += 1
        now = time.monotonic()
        if now - told >= _EVERY and done < total:
            told = now
            note(f"{what}: {done} of {total} {units}")

    return count


@contextmanager
def _bar(total: int) -> Iterator[Report]:
    from rich import progress as rich

    started = time.monotonic()
    with rich.Progress(
        rich.TextColumn("mapping"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn("frames, {task.fields[rate]:.1f}/s, {task.fields[objects]} objects,"),
        rich.TimeRemainingColumn(),
        rich.TextColumn("left"),
        console=err(),
    ) as bar:
        task = bar.add_task("mapping", total=total, rate=0.0, objects=0)

        def report(progress: Progress) -> None:
            rate = progress.done / (time.monotonic() - started)
            bar.update(task, completed=progress.done, rate=rate, objects=progress.objects)

        yield report


def _lines(total: int) -> Report:
    started = last = 0.0
    before = 0  # frames; the first one is slow, as what it needs is loaded

    def report(progress: Progress) -> None:
        nonlocal started, last, before
        now = time.monotonic()
        text = f"mapping: {progress.done} of {total} frames, {progress.objects} objects"
        if before == 0:
            started, before = now, progress.done
        elif now - last < _EVERY:
            return
        else:
            rate = (progress.done - before) / (now - started)
            text += f", {rate:.1f}/s, {(total - progress.done) / rate:.0f} s left"
        last = now
        note(text)

    return report
