"""Makes names and numbers from files and recordings safe to display."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

_LONGEST = 2000  # characters of a message
# Also matches without the @ that ends a password: a search that fails there would begin again at
# each beginning of an address, which takes quadratic time.
_PASSWORD = re.compile(r"(\bpostgres(?:ql)?:/+[^:/@\s]*):[^@\s]*(@?)")


def is_address(text: object) -> bool:
    """Return whether a text, or a path made of it, is the address of a store, not of a file.

    >>> is_address("postgresql://me@db.example/maps?site=lab"), is_address("office.hmap")
    (True, False)
    """
    return str(text).startswith(("postgresql:/", "postgres:/"))  # paths lose a slash


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


def visible(text: str, longest: int = _LONGEST) -> str:
    r"""Return a text of ours with names from outside in it, safe for a terminal and not endless.

    The password in the address of a store is left out.

    >>> visible("\x1b[31m.hmap: there is no such file")
    '\\x1b[31m.hmap: there is no such file'
    >>> visible("postgresql://me:secret@db.example/maps: no file")
    'postgresql://me@db.example/maps: no file'
    """
    text = _PASSWORD.sub(lambda found: f"{found[1]}@" if found[2] else found[0], text)
    if len(text) > longest:
        text = f"{text[: longest // 2]} ... {text[-longest // 2 :]}"
    return escaped(text)


def escaped(text: str) -> str:
    r"""Return a text in which nothing but an end of a line controls a terminal.

    >>> escaped("a\u202eb\n\x1b[31mc")
    'a\\u202eb\n\\x1b[31mc'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def decimal(number: float, digits: int = 2) -> str:
    """Return a number with so many decimals, and no minus before nothing but zeros.

    >>> decimal(-0.0001), decimal(-1.5, 1)
    ('0.00', '-1.5')
    """
    return f"{round(number, digits) + 0.0:.{digits}f}"


def fit_for_json(value: Any) -> Any:
    """Return a value with keys that are texts, and null for numbers that are not finite.

    >>> fit_for_json({1: float("nan"), "b": (2, 3.5)})
    {'1': None, 'b': [2, 3.5]}
    """
    if isinstance(value, Mapping):
        return {str(key): fit_for_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [fit_for_json(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun.

    >>> counted(1, "object"), counted(2, "class", "classes")
    ('1 object', '2 classes')
    """
    return f"{number} {noun(number, one, many)}"


def noun(number: int, one: str, many: str = "") -> str:
    """Return a noun as it follows a number.

    >>> noun(1, "object"), noun(0, "object")
    ('object', 'objects')
    """
    return one if number == 1 else many or one + "s"


def natural(name: str) -> list[tuple[int, str]]:
    """Return what sorts names as people do, "room 2" before "room 10".

    >>> sorted(["room 10", "room 2", "room"], key=natural)
    ['room', 'room 2', 'room 10']
    """
    parts = re.split(r"(\d{1,18})", name)
    return [(int(part), "") if place % 2 else (-1, part) for place, part in enumerate(parts)]
