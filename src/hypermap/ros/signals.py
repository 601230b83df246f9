"""The signals that end a node in order."""

from __future__ import annotations

import signal


def end_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end a node: Ctrl-C, SIGTERM, and the end of its terminal.

    The last one is not among them where it is ignored: `nohup` wants the node to go on.
    """
    signals = [signal.SIGINT, signal.SIGTERM]
    hang_up = getattr(signal, "SIGHUP", None)  # Windows has none
    if hang_up is not None and signal.getsignal(hang_up) != signal.SIG_IGN:
        signals.append(hang_up)
    return tuple(signals)
