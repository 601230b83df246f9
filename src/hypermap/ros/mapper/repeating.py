"""Work that a part of a live node does again and again."""

from __future__ import annotations

import threading
from collections.abc import Callable

from hypermap.core.errors import HypermapError
from hypermap.ros.throttle import Throttle


class Repeating:
    """Does some work again and again, in a thread of its own; what fails is logged.

    It goes by the wall's clock, as that of a simulator or a bag may stand still.

    Args:
        name: of the thread, and of its messages to the log.
        work: what to do.
        every: seconds between two times.
        log: of the node.
        failed: what a message of failed work begins with, as "no frontiers".
    """

    def __init__(
        self, name: str, work: Callable[[], None], every: float, log: Throttle, failed: str
    ) -> None:
        self._name, self._every = name, every
        self._log, self._failed = log, failed
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, args=[work], name=name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End, after the work that is being done."""
        self._ends.set()
        self._thread.join()

    def _run(self, work: Callable[[], None]) -> None:
        while not self._ends.wait(self._every):
            self._try(work)

    def _try(self, work: Callable[[], None]) -> None:
        try:
            work()
        except HypermapError as error:
            self._log.log("warning", self._name, f"{self._failed}: {error}")
        except Exception as error:  # the next time may succeed
            kind = type(error).__name__
            self._log.log("error", self._name, f"{self._failed}: {kind}: {error}")
