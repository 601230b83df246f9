"""Signals that come at the worst moment: while this thread holds a lock of Python's library."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def signals_amid_locks() -> Iterator[None]:
    """Send SIGINT to this thread at each line but the first of an event's methods.

    The first takes the lock. A handler that sets the event wants it, too, and waits forever.
    """

    def on_call(frame: FrameType, _event: str, _argument: Any) -> Any:
        is_of_event = isinstance(frame.f_locals.get("self"), threading.Event)
        return on_first_line if is_of_event else None

    def on_first_line(_frame: FrameType, _event: str, _argument: Any) -> Any:
        return on_line

    def on_line(_frame: FrameType, event: str, _argument: Any) -> Any:
        if event == "line":
            signal.raise_signal(signal.SIGINT)
        return on_line

    before = sys.gettrace()
    sys.settrace(on_call)
    try:
        yield
    finally:
        sys.settrace(before)
