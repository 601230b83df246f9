"""What the callbacks of all ports share: they end once, and no error of one ends the node."""

from __future__ import annotations

import traceback
from collections.abc import Callable

from hypermap.core.errors import HypermapError
from hypermap.ros.port import Level


class Closing:
    """Something that lasts until it is closed."""

    def __init__(self, close: Callable[[], object]) -> None:
        self._close: Callable[[], object] | None = close

    def close(self) -> None:
        """End it; closing twice does no harm."""
        close, self._close = self._close, None
        if close is not None:
            close()


def guarded(
    log: Callable[[Level, str], None],
    what: str,
    call: Callable[[], None],
    is_ending: Callable[[], bool] = bool,
) -> None:
    """Call; log an operator's error as a line and one of ours with its traceback.

    Args:
        log: where.
        what: was called, as the log names it.
        call: the callback.
        is_ending: whether the node ends: what was closed may be used a little longer, and fail.
    """
    try:
        call()
    except HypermapError as error:
        log("error", f"{what}: {error}")
    except Exception:
        if not is_ending():
            log("error", f"{what}: {traceback.format_exc()}")
