"""What Ctrl-C (SIGINT) and SIGTERM mean to a command.

Either ends it in order, with exit code 130 or 143. A work that has a result takes the first one as
a wish to end early, and saves what there is. What the shell has switched off stays so: a script
starts its jobs in the background without Ctrl-C, and it is SIGTERM that ends them.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

TERMINATED = 128 + signal.SIGTERM  # the exit code


class Stop:
    """Whether the user wants the work to end.

    Attributes:
        number: the signal that said so; None while there was none.
    """

    def __init__(self) -> None:
        self.number: signal.Signals | None = None

    @property
    def is_wanted(self) -> bool:
        """Whether there was one."""
        return self.number is not None

    @property
    def name(self) -> str:
        """What users call it."""
        return "SIGTERM" if self.number == signal.SIGTERM else "Ctrl-C"

    @property
    def exit_code(self) -> int:
        """The exit code of a command that it has ended early; 0 if there was none."""
        return 0 if self.number is None else 128 + self.number


@contextmanager
def stop_on_signal() -> Iterator[Stop]:
    """Turn the first Ctrl-C and every SIGTERM into a wish; the next Ctrl-C interrupts.

    SIGTERM may come twice at once, as from `timeout`, and so never means more than a wish.
    """
    stop = Stop()

    def wish(number: int, _frame: FrameType | None) -> None:
        stop.number = stop.number or signal.Signals(number)
        if signal.getsignal(signal.SIGINT) is wish:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    with _handled(wish, signal.SIGINT, signal.SIGTERM):
        yield stop


@contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """Let SIGTERM end the program as an exception does, so that nothing half done is left."""

    def end(_number: int, _frame: FrameType | None) -> NoReturn:
        raise SystemExit(TERMINATED)

    with _handled(end, signal.SIGTERM):
        yield


@contextmanager
def _handled(
    handler: Callable[[int, FrameType | None], None], *numbers: signal.Signals
) -> Iterator[None]:
    """Let a handler take signals, but for those that are switched off."""
    before = {}
    try:
        if threading.current_thread() is threading.main_thread():  # to which they come
            for number in numbers:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    before[number] = signal.signal(number, handler)
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)
