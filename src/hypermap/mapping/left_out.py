"""Frames that mapping leaves out, and what it logs about them."""

from __future__ import annotations

import logging
import re
from collections import Counter

from hypermap.text import counted

_log = logging.getLogger(__name__)


class LeftOutFrames:
    """Logs why frames are left out: once for each kind of reason.

    Attributes:
        first_reason: why the first frame was left out; empty if none was.
    """

    def __init__(self) -> None:
        self.first_reason = ""
        self._counts: Counter[str] = Counter()  # by what the reasons have in common

    def add(self, stamp: float, reason: str) -> None:
        """Log a frame that is left out.

        Args:
            stamp: of the frame [s].
            reason: why; reasons that differ only in their numbers are of one kind.
        """
        kind = re.sub(r"\d+", "#", reason)
        level = logging.INFO if kind in self._counts else logging.WARNING
        _log.log(level, "frame %.6f left out: %s", stamp, reason)
        self._counts[kind] += 1
        self.first_reason = self.first_reason or reason

    def log_rest(self) -> None:
        """Log how many more frames were left out for the same reasons."""
        more = self._counts.total() - len(self._counts)
        if more:
            _log.warning(
                "left out for the same reasons: %s more (-v lists them)", counted(more, "frame")
            )
