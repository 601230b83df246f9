"""Text files of numbers, read line by line with errors that name the line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import NOT_UTF8, FileMissing, FormatError

MAX_BYTES = 256 * 2**20  # ten hours of poses at 100 Hz


def read_lines(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the place ("line 7") and the text of each line that is neither empty nor a comment.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is not a text, or too large to be one of ours.
    """
    if not path.is_file():
        raise FileMissing(f"{path}: there is no such file")
    if path.stat().st_size > MAX_BYTES:
        raise FormatError(f"larger than {MAX_BYTES // 2**20} MiB, too large for a list", path=path)
    with path.open(encoding="utf-8-sig") as file:
        try:
            for number, line in enumerate(file, start=1):
                text = line.strip()
                if text and not text.startswith("#"):
                    yield f"line {number}", text
        except UnicodeDecodeError:
            raise FormatError(NOT_UTF8, path=path) from None


def read_header(path: Path) -> list[str]:
    """Return the names of the columns, which commas separate in a comment above the first numbers.

    Returns:
        The names of the last such comment; none if there is none, or the file cannot be read.
    """
    names: list[str] = []
    with suppress(OSError, UnicodeDecodeError), path.open(encoding="utf-8-sig") as file:
        for line in file:
            text = line.strip()
            if text and not text.startswith("#"):
                break
            if "," in text:
                names = [name.strip() for name in text.strip("#, ").split(",")]
    return names


def words_of(text: str) -> list[str]:
    """Return the words of a line, which spaces or commas separate.

    >>> words_of("1.5, 2 3")
    ['1.5', '2', '3']
    """
    return text.replace(",", " ").split()


def parse_numbers(words: Sequence[str], path: Path, key: str) -> list[float]:
    """Return words as numbers; those that stand for "not a number" become NaN.

    Raises:
        FormatError: If a word is not a number.
    """
    try:
        return [float("nan") if _is_windows_nan(word) else float(word) for word in words]
    except ValueError:
        line = " ".join(words)
        raise FormatError(f"expected numbers, found {line[:80]!r}", path=path, key=key) from None


def finite_numbers(words: Sequence[str], path: Path, key: str) -> list[float]:
    """Return words as finite numbers.

    Raises:
        FormatError: If a word is not a number, or one that is not finite.
    """
    numbers = parse_numbers(words, path, key)
    check_finite(numbers, path, key)
    return numbers


def check_finite(numbers: Iterable[float], path: Path, key: str) -> None:
    """Raise a FormatError if a number is not finite."""
    if not all(map(math.isfinite, numbers)):
        raise FormatError("there is a number that is not finite", path=path, key=key)


def read_matrix(path: Path, *sizes: int) -> NDArray[np.float64]:
    """Return a matrix, shape (N, N) for one of some sizes; it may hold NaN and infinite numbers.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it does not hold as many rows as numbers in each.
    """
    rows = [parse_numbers(words_of(text), path, key) for key, text in read_lines(path)]
    if [len(row) for row in rows] not in [[size] * size for size in sizes]:
        found = ", ".join(str(len(row)) for row in rows[:10]) or "none"
        expected = " or ".join(f"{size} rows of {size}" for size in sizes)
        raise FormatError(
            f"expected {expected} numbers, found rows of these lengths: {found}", path=path
        )
    return np.array(rows)


def _is_windows_nan(word: str) -> bool:
    """Return whether a word is one that Microsoft's C library prints for NaN or infinity."""
    return "#" in word and re.fullmatch(r"[+-]?1\.#\w+", word) is not None
