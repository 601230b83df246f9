"""Names from files and recordings, made fit to be shown."""

from __future__ import annotations


def printable(text: object, longest: int = 28) -> str:
    r"""Return a text in one line, without control characters and cut at a length.

    >>> printable("a cup\n of tea")
    'a cup of tea'
    >>> printable("a very long name", longest=8)
    'a very …'
    """
    visible = "".join(c if c.isprintable() else " " for c in str(text))
    line = " ".join(visible.split())
    return line if len(line) <= longest else line[: longest - 1] + "…"
