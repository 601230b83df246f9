"""How many cells a map may have when it is opened: a file of 200 bytes can unpack to 10^8 cells."""

from __future__ import annotations

import os

from hypermap.core.errors import FormatError, HypermapError
from hypermap.formats import limits

SETTING = "HYPERMAP_MAX_CELLS"
"""The environment variable by which the limit is raised."""


def check_cells(count: int, size: str, path: str, weight: int = 1) -> None:
    """Check a number of cells before memory is allocated for them.

    Args:
        count: of the cells, of one grid or of all grids of a map together.
        size: the cells as in the message, such as "10000 x 10000 cells".
        path: of the file.
        weight: what a cell counts, if reading it takes more memory than usual.

    Raises:
        FormatError: If there are too many. The message says how many bytes they would take, and
            how to raise the limit.
        HypermapError: If the setting is no whole number.
    """
    most = max_cells() // weight
    if count <= most:
        return
    raise FormatError(
        f"has {size} ({count / 1e6:.0f} MB in memory), more than the {most:,} that are allowed; "
        f"if you trust the file, set {SETTING}={weight * count} in the environment",
        path=path,
    )


def max_cells() -> int:
    """Return how many cells the grids of a map may have together when it is opened.

    Raises:
        HypermapError: If the setting is no whole number.
    """
    text = os.environ.get(SETTING)
    if not text:
        return limits.MAX_CELLS
    if not (text.isascii() and text.isdigit() and len(text) < 20):
        raise HypermapError(f"{SETTING}={text!r} in the environment must be a whole number")
    return int(text)
