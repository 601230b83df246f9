"""Tables as CSV, in which a spreadsheet takes no text for a formula."""

from __future__ import annotations

import csv
import io
import logging
import re
from collections.abc import Iterable, Sequence
from itertools import chain
from types import SimpleNamespace

logger = logging.getLogger(__name__)

_BEGINNINGS = r"=+\-@\t\r\n\0＝＋－＠"
# More than a sign, and not a number; apostrophes before it, so that what is added can be removed.
_FORMULA = re.compile(rf"'*[{_BEGINNINGS}](?!\Z)", re.DOTALL)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)


def as_csv(head: Sequence[str], rows: Iterable[Sequence[object]], end: str = "\n") -> str:
    """Return a table as CSV text (RFC 4180).

    A text that begins with =, +, -, @, a tab, an end of a line or a NUL gets an apostrophe before
    it unless it is a number: spreadsheets would compute it, and a formula can run commands or send
    cells elsewhere. How many texts that were is logged as a warning. To restore them, remove
    one apostrophe where apostrophes and one of these characters begin a cell.

    Args:
        head: names of the columns.
        rows: their cells; None is an empty cell.
        end: of each line.

    Source: OWASP, CSV injection, and ASVS 1.2.10.
    """
    text = io.StringIO(newline="")
    # With these ends, a writer quotes texts with either character: readers end lines at both.
    file = SimpleNamespace(write=lambda line: text.write(line.removesuffix("\r\n") + end))
    writer = csv.writer(file, lineterminator="\r\n")
    marked = 0
    for row in chain([head], rows):
        cells = [_marked(cell) if isinstance(cell, str) else cell for cell in row]
        marked += sum(new is not old for new, old in zip(cells, row, strict=True))
        writer.writerow(cells)
    if marked:
        logger.warning(
            "texts that begin like a formula got an apostrophe in front, so that spreadsheets do "
            "not compute them: %d",
            marked,
        )
    return text.getvalue()


def _marked(text: str) -> str:
    """Return a text that is not a formula: with an apostrophe, or the text itself."""
    if _FORMULA.match(text) is None or _NUMBER.fullmatch(text):
        return text
    return f"'{text}"
