"""The signals that end a node in order."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


def end_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end a node: Ctrl-C, SIGTERM, and the end of its terminal.

    The last one is not among them where it is ignored: `nohup` wants the node to go on.
    """
    signals = [signal.SIGINT, signal.SIGTERM]
    hang_up = getattr(signal, "SIGHUP", None)  # Windows has none
    if hang_up is not None and signal.getsignal(hang_up) != signal.SIG_IGN:
        signals.append(hang_up)
    return tuple(signals)


@contextmanager
def on_end_signals(handler: Callable[..., object]) -> Iterator[None]:
    """Hand the signals that end a node to a function meanwhile.

    Python takes signals in its main thread alone, so in others nothing changes.
    """
    in_main = threading.current_thread() is threading.main_thread()
    numbers = end_signals() if in_main else ()
    before = [signal.signal(number, handler) for number in numbers]
    try:
        yield
    finally:
        for number, handler_before in zip(numbers, before, strict=True):
            signal.signal(number, handler_before)
