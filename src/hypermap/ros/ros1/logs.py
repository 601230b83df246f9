"""What the library logs, in the log of the node."""

from __future__ import annotations

import logging
from collections.abc import Callable

from hypermap.ros.port import Level


def forward_logs(log: Callable[[Level, str], None]) -> None:
    """Write what the library logs to a node's log, and nowhere else.

    Args:
        log: the method `log` of a port.
    """
    logger = logging.getLogger("hypermap")
    logger.handlers = [_Forward(log)]
    logger.setLevel(logging.INFO)


class _Forward(logging.Handler):
    def __init__(self, log: Callable[[Level, str], None]) -> None:
        super().__init__()
        self._log = log

    def emit(self, record: logging.LogRecord) -> None:
        level: Level = "debug"
        if record.levelno >= logging.ERROR:
            level = "error"
        elif record.levelno >= logging.WARNING:
            level = "warning"
        elif record.levelno >= logging.INFO:
            level = "info"
        self._log(level, self.format(record))
