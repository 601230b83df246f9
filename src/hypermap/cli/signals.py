"""What Ctrl-C (SIGINT), SIGTERM and the end of the terminal (SIGHUP) mean to a command.

Each ends it in order, with exit code 130, 143 or 129. A work that has a result takes the first one
as a wish to end early, and saves what there is. What the shell has switched off stays so: a script
starts its jobs in the background without Ctrl-C, and `nohup` its command without SIGHUP. A server
is different: a signal is how it usually ends, so its exit code is 0.
"""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import CodeType, FrameType
from typing import NoReturn

from hypermap.ros.signals import on_end_signals

_SOON = 0.01  # s
_ENDING = (signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))

_log = logging.getLogger(__name__)


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
        return "Ctrl-C" if self.number in (None, signal.SIGINT) else self.number.name

    @property
    def exit_code(self) -> int:
        """The exit code of a command that it has ended early; 0 if there was none."""
        return 0 if self.number is None else 128 + self.number


@contextmanager
def stop_on_signal() -> Iterator[Stop]:
    """Turn the first Ctrl-C and all other signals into a wish; the next Ctrl-C interrupts.

    SIGTERM may come twice at once, as from `timeout`, and so never means more than a wish.
    """
    stop = Stop()
    interrupt = signal.getsignal(signal.SIGINT)

    def wish(number: int, _frame: FrameType | None) -> None:
        stop.number = stop.number or signal.Signals(number)
        if signal.getsignal(signal.SIGINT) is wish:
            signal.signal(signal.SIGINT, interrupt)

    with _handled(wish):
        yield stop


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let signals end the program as exceptions do, so that nothing half done is left.

    A signal may come while a library, or a finalizer, runs that turns the exception into another
    one or drops it. The program ends in order then, too.

    Raises:
        KeyboardInterrupt: On Ctrl-C.
        SystemExit: On SIGTERM and SIGHUP, and where a signal's exception has become another.
    """
    came: list[int] = []

    def end(number: int, _frame: FrameType | None) -> NoReturn:
        came.append(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)

    def send_again(lost: sys.UnraisableHookArgs) -> None:
        if not issubclass(lost.exc_type, (KeyboardInterrupt, SystemExit)):
            before(lost)
        elif came:
            # From a thread, as Python would handle it right here otherwise, and drop it again.
            arguments = send_again.__code__, came[-1]
            threading.Thread(target=_send_after, args=arguments, daemon=True).start()
        # Otherwise it is of a node that handles signals itself, and has noted that it is to end.

    before, sys.unraisablehook = sys.unraisablehook, send_again
    try:
        with _handled(end):
            yield
    except (Exception, SystemExit) as error:
        if not came or (isinstance(error, SystemExit) and not error.code):
            raise  # as does a command that has taken Ctrl-C for its usual end
        _log.debug("signal %d ended what was under way: %r", came[-1], error)
        raise SystemExit(128 + came[-1]) from error
    finally:
        sys.unraisablehook = before


def _send_after(code: CodeType, number: int) -> None:
    """Send a signal once the main thread has left a function, however long that takes."""
    while any(frame.f_code is code for frame in _frames(threading.main_thread())):
        time.sleep(_SOON)
    signal.raise_signal(number)


def _frames(thread: threading.Thread) -> Iterator[FrameType]:
    """Yield where a thread is, the innermost function first."""
    frame = sys._current_frames().get(thread.ident or 0)
    while frame is not None:
        yield frame
        frame = frame.f_back


@contextmanager
def until_signal() -> Iterator[None]:
    """Let a server run until a signal ends it, and return as if it had ended by itself.

    systemd, Docker and others send SIGTERM to stop a service, and take 143 for a failure. Ctrl-C
    counts here even where the shell has switched it off; SIGHUP does not.
    """
    with suppress(KeyboardInterrupt), on_end_signals(_as_ctrl_c):
        yield


def _as_ctrl_c(number: int, _frame: FrameType | None) -> None:
    """Do for any signal what Ctrl-C does at the moment: a library may handle Ctrl-C alone."""
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    signal.raise_signal(signal.SIGINT)


@contextmanager
def _handled(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Let a handler take the signals that end a command, but for those that are switched off."""
    before = {}
    try:
        if threading.current_thread() is threading.main_thread():  # to which they come
            for number in _ENDING:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    before[number] = signal.signal(number, handler)
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)
