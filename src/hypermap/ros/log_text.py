"""What a node logs, of which a part may come from strangers, such as names of frames and sites."""

from __future__ import annotations

from hypermap.text import visible

_LONGEST = 20_000  # characters, as of a traceback


def log_text(text: str) -> str:
    r"""Return a text that controls no terminal; only its first line can look like a line of a log.

    >>> print(log_text("frame \x1b[31m\n[ERROR] the disk is full"))
    frame \x1b[31m
        [ERROR] the disk is full
    """
    return visible(text, _LONGEST).rstrip("\n").replace("\n", "\n    ")
