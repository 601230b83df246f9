"""Errors caused by a caller's input. Anything else is a bug in Hypermap."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

# Of text in any other encoding, letters would be guessed.
NOT_UTF8 = "is not text in UTF-8; if it is text, save it in this encoding"


class HypermapError(Exception):
    """Base class of every error that a user can cause and fix."""


class FormatError(HypermapError):
    """A file does not have the content that its format requires.

    Attributes:
        path: the file (or ``archive.hmap/member``) that is wrong, if known.
        key: the key, frame, line or object inside it, if known.
    """

    def __init__(
        self, message: str, *, path: str | Path | None = None, key: str | None = None
    ) -> None:
        self.path = path
        self.key = key
        where = ": ".join(str(part) for part in (path, key) if part is not None)
        super().__init__(f"{where}: {message}" if where else message)


class FileMissing(HypermapError, FileNotFoundError):
    """The requested file or folder does not exist."""


class LayerNotFound(HypermapError, KeyError):
    """The hypermap has no layer of that name."""

    def __init__(self, name: str, available: Iterable[str]) -> None:
        self._given = name, list(available)
        super().__init__(f"there is no layer {name!r}; {did_you_mean(*self._given)}")

    def __reduce__(self) -> tuple[Any, ...]:  # to travel from one process to another
        return type(self), self._given

    def __str__(self) -> str:  # KeyError would show the message in quotes
        return str(self.args[0])


class ObjectNotFound(HypermapError, KeyError):
    """A layer has no object, or no note, with that id."""

    def __str__(self) -> str:  # KeyError would show the message in quotes
        return str(self.args[0])


class FrameError(HypermapError):
    """A frame is unknown, or two frames are not connected."""


class AreaError(HypermapError, ValueError):
    """An area has an outline that cannot be used in a query."""


class NoteError(HypermapError, ValueError):
    """A note, or a file attached to it, cannot be kept as it is."""


class MissingExtra(HypermapError, ImportError):
    """An optional library is not installed; the message says which extra installs it."""

    def __init__(self, purpose: str, extra: str) -> None:
        self._given = purpose, extra
        super().__init__(f"{purpose} needs an optional library: pip install 'hypermap[{extra}]'")

    def __reduce__(self) -> tuple[Any, ...]:  # to travel from one process to another
        return type(self), self._given


def did_you_mean(name: str, available: Iterable[str]) -> str:
    """Return a hint: the closest known name, or else all known names.

    >>> did_you_mean("ocupancy", ["occupancy", "semantic"])
    "did you mean 'occupancy'?"
    >>> did_you_mean("x", ["occupancy", "semantic"])
    'known: occupancy, semantic'
    >>> did_you_mean("SEMANTIC", ["occupancy", "semantic"])
    "did you mean 'semantic'?"
    """
    known = list(available)
    in_lower_case = {each.lower(): each for each in reversed(known)}
    if close := difflib.get_close_matches(name, known, n=1):
        return f"did you mean {close[0]!r}?"
    if close := difflib.get_close_matches(name.lower(), in_lower_case, n=1):
        return f"did you mean {in_lower_case[close[0]]!r}?"
    return "known: " + (", ".join(known) if known else "none")
