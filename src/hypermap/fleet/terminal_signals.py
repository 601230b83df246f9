"""The signals that a terminal sends to all of its processes, of which the first one takes care."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

_OF_A_TERMINAL = (signal.SIGINT, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))


@contextmanager
def left_to_this_process() -> Iterator[None]:
    """Start processes meanwhile that Ctrl-C does not interrupt, not even while they start.

    They inherit from this thread that the signals wait, and call `ignore` in the end.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its start would let the signals through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _OF_A_TERMINAL)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def ignore() -> None:
    """Leave the signals to the process that has started this one."""
    for number in _OF_A_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
