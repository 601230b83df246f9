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


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun.

    >>> counted(1, "object"), counted(2, "class", "classes")
    ('1 object', '2 classes')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"
