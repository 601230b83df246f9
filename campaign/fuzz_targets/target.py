"""What a target of fuzzing is, and what the targets share."""

from __future__ import annotations

import contextlib
import importlib
import random
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from campaign.mutation import Mutator, joined, mutate_parts, parted

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap


@dataclass(frozen=True)
class Target:
    """A place where bytes come in.

    Attributes:
        ask: takes the bytes. What it raises but HypermapError is a finding.
        corpus: examples of what is right.
        mutate: spoils an example.
        close: ends what the target has started.
    """

    ask: Callable[[bytes], object]
    corpus: Sequence[bytes]
    mutate: Mutator
    close: Callable[[], None] = lambda: None


def of_tests(module: str) -> Any:
    """Return a module of the tests, whose builders make examples."""
    return importlib.import_module(f"tests.{module}")


def draw_of(data: bytes) -> random.Random:
    """Return luck that the same bytes have again."""
    return random.Random(data[:4096])


def a_map() -> Hypermap:
    """Return a map with a turned layer, a hole, evidence, and names that are no plain words."""
    made: Hypermap = of_tests("viewer.seen_map").seen_map(is_turned=True)
    return made


def a_small_map() -> Hypermap:
    """Return a map of a grid and a few things."""
    made: Hypermap = of_tests("viewer.live_tools").a_map()
    return made


def target_of_files(
    parts: dict[str, bytes], read: Callable[[Path, bytes], object], folder: Path
) -> Target:
    """Return a target of several files in a folder, of which each is spoiled in turn.

    Args:
        parts: the files, by their paths in the folder.
        read: takes the folder, and the bytes that it was made of.
        folder: to work in.
    """

    def ask(data: bytes) -> None:
        write_parts(folder / "files", data)
        read(folder / "files", data)

    return Target(ask, [joined(parts)], mutate_parts)


def write_parts(place: Path, data: bytes) -> None:
    """Write the files of `joined` into an empty folder, but none beside it."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    for name, content in parted(data).items():
        with contextlib.suppress(OSError, ValueError):
            path = place / name
            if ".." not in path.parts and path.is_relative_to(place) and path != place:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
