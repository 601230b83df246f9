"""Forwards the library's log to the log of the node."""

from __future__ import annotations

import io
import logging
import sys
from collections.abc import Callable

from hypermap.ros.port import Level
from hypermap.ros.ros1.libraries import paramserver, rosgraph, rospy

_TOPICS_OFF = "/rosout_disable_topics_generation"


def forward_logs(log: Callable[[Level, str], None]) -> None:
    """Write what the library logs to a node's log, and nowhere else.

    Args:
        log: the method `log` of a port.
    """
    logger = logging.getLogger("hypermap")
    logger.handlers = [_Forward(log)]
    logger.setLevel(logging.INFO)


def show_lines_at_once() -> None:
    """Have each line of the log, which rospy writes on standard output, leave the process at once.

    In a file or a journal, Python would keep the last 8 KiB until the node ends.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)


def show_lines_without_file() -> None:
    """Show the node's log where rospy can make no folder for its file, as in a read-only home.

    It sets up no log at all then, and the node would say nothing.
    """
    if rospy.core._log_filename is None:
        logger = logging.getLogger("rosout")
        logger.addHandler(rosgraph.roslogging.RosStreamHandler())
        logger.setLevel(logging.INFO)


def keep_rosout_settings() -> None:
    """Have rospy ask once how lines for /rosout are written, not with each line.

    Each question registers the node, also one that another has replaced; that one would end.
    """
    value = rospy.get_param_cached(_TOPICS_OFF, False)
    paramserver.get_param_server_cache().set(_TOPICS_OFF, value)


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
