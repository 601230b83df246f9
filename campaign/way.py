"""What a way to save is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Way:
    """A way to save.

    Attributes:
        name: in words.
        save: saves the first or the second version in a folder; must be repeatable.
        read: returns what is there, as a text that differs between the versions.
    """

    name: str
    save: Callable[[Path, int], object]
    read: Callable[[Path], str]
