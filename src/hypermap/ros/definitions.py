"""Finds the message definitions of the package `hypermap_msgs`."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from hypermap.core.errors import HypermapError

PACKAGE = "hypermap_msgs"


@cache
def package_folder() -> Path:
    """Return the folder of the package, with `msg` and `srv` in it.

    An installed Hypermap carries a copy; in a checkout it is the package itself.

    Raises:
        HypermapError: If there is none.
    """
    here = Path(__file__).resolve().parent
    checkout = here.parents[2] / "ros" / PACKAGE
    for folder in (here / PACKAGE, checkout):
        if (folder / "msg").is_dir():
            return folder
    raise HypermapError(f"the message definitions are missing: expected them in {here / PACKAGE}")
