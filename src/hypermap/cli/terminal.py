"""Output of the commands: answers on standard output, everything else on standard error."""

from __future__ import annotations

import errno
import functools
import io
import json
import logging
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from hypermap.core.errors import HypermapError
from hypermap.text import escaped, fit_for_json, visible

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

NO_MEMORY, BAD_INPUT, INTERRUPTED, NOBODY_READS = 1, 2, 130, 141  # exit codes
_NOT_ASCII = re.compile("[^\n -~]")
_PIPED_WIDTH = 160  # columns of a table that goes to a file or another program


@functools.cache
def out() -> Console:
    """Return the console for answers."""
    return _console(stderr=False)


@functools.cache
def err() -> Console:
    """Return the console for progress, notes and errors."""
    return _console(stderr=True)


def _console(stderr: bool) -> Console:
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _PIPED_WIDTH
    return Console(stderr=stderr, width=width, highlight=False, markup=False, emoji=False)


def say(text: str = "", style: str | None = None) -> None:
    """Print a line of an answer; names from files go through `printable`, which shortens them."""
    out().print(escaped(text), style=style, soft_wrap=True)


def note(text: str) -> None:
    """Print a line that is no answer, such as where something was saved."""
    err().print(visible(text), soft_wrap=True)


def complain(text: str) -> None:
    """Print what is wrong, in one line."""
    lines = (line.strip() for line in text.splitlines())
    message = visible("; ".join(filter(None, lines)))
    print("hypermap: error:", message, file=sys.stderr, flush=True)  # noqa: T201


def prepare_streams() -> None:
    """Make it safe to write: where a stream is closed, and where it does not know all letters."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # what Python makes of `>&-`
            setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115 - it stays open
    if sys.__stderr__ is not None and sys.stderr is sys.__stderr__:
        sys.stderr = _heard_or_not(sys.__stderr__)
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


class _Unfailing(io.FileIO):
    """A stream for notes and progress. If nobody can read them, the work goes on without."""

    def write(self, data: Any) -> int:
        """Write, or drop what cannot be written."""
        try:
            return super().write(data) or 0
        except OSError:
            return len(data)


def _heard_or_not(stream: TextIO) -> TextIO:
    """Return the same stream without its errors, as where `| head` has read enough."""
    raw = _Unfailing(stream.fileno(), "w", closefd=False)
    return io.TextIOWrapper(
        io.BufferedWriter(raw), encoding=stream.encoding, line_buffering=True, write_through=True
    )


def finish_writing() -> None:
    """Write what standard output still holds back, while it can be said that this has failed.

    Raises:
        OSError: if it cannot be written, as on a full disk.
    """
    try:
        sys.stdout.flush()
    except OSError:
        # Else Python tries again at its end, and complains in its own way.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        raise


def describe(error: HypermapError | OSError) -> str:
    """Return what an error says, without Python's decoration."""
    if isinstance(error, HypermapError) or error.strerror is None:
        return str(error)
    if error.errno == errno.ENOENT and error.filename is None:  # what `getcwd` raises
        return f"the current folder: {error.strerror}; was it deleted? change to another"
    from hypermap.formats.atomic import why_not_written

    return ": ".join(str(part) for part in (error.filename, why_not_written(error)) if part)


def say_json(value: Any) -> None:
    """Print JSON; a number that is not finite becomes null, and what JSON does not know, text.

    Characters that control a terminal are escaped, also those that JSON does not escape.
    """
    knows_all_letters = (getattr(sys.stdout, "encoding", None) or "").lower().startswith("utf")
    text = json.dumps(
        fit_for_json(value), indent=2, ensure_ascii=not knows_all_letters, default=str
    )
    sys.stdout.write(_NOT_ASCII.sub(_shown_in_json, text) + "\n")


def _shown_in_json(found: re.Match[str]) -> str:
    return found[0] if found[0].isprintable() else json.dumps(found[0])[1:-1]


@functools.cache
def _table_class() -> type[Table]:
    """Return a class of tables whose cells control no terminal."""
    from rich.table import Table

    class SafeTable(Table):
        def add_row(self, *cells: Any, **more: Any) -> None:
            safe = (escaped(cell) if isinstance(cell, str) else cell for cell in cells)
            super().add_row(*safe, **more)

    return SafeTable


def table(*columns: str, right: Sequence[str] = ()) -> Table:
    """Return an empty table; the columns named in `right` hold numbers."""
    from rich.box import SIMPLE

    grid = _table_class()(box=SIMPLE, pad_edge=False, show_edge=False, header_style="bold")
    for column in columns:
        grid.add_column(column, justify="right" if column in right else "left", overflow="fold")
    return grid


def facts(rows: Sequence[tuple[str, str]]) -> Table:
    """Return a table of names and what they are, without a head."""
    grid = _table_class().grid(padding=(0, 3))
    for name, value in rows:
        grid.add_row(name, value)
    return grid


class LineHandler(logging.Handler):
    """Shows what the library logs, one line each, above a progress bar if there is one."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record on standard error."""
        text = " ".join(record.getMessage().split())
        if _verbosity < 0:  # what is logged then is an error
            complain(text)
        else:
            note(f"hypermap: {record.levelname.lower()}: {text}")


_verbosity = 0


def set_verbosity(level: int) -> None:
    """Show what the library logs; what other libraries warn of is for its developers alone.

    Args:
        level: 0 as usual, 1 and 2 for more; below 0, no note and no progress is shown either.
    """
    global _verbosity
    _verbosity = level
    if level < 0 or err.cache_info().currsize:  # else rich need not be loaded
        err().quiet = level < 0
    logging.captureWarnings(True)  # of no use to someone who asks a map
    others = (logging.ERROR, logging.ERROR, logging.ERROR, logging.WARNING)
    levels = {"hypermap": (logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)}
    levels |= {"py.warnings": others, "matplotlib": others}
    for name, shown in levels.items():
        logger = logging.getLogger(name)
        logger.handlers = [LineHandler()]
        logger.setLevel(shown[min(max(level, -1), 2) + 1])
    # That loops are compiled is shown as progress.
    logging.getLogger("hypermap._loops").setLevel(logging.ERROR if level < 0 else logging.INFO)


def change_verbosity(by: int) -> None:
    """Change the verbosity."""
    if by:
        set_verbosity(_verbosity + by)
