"""Checks file names from clients: only files in one directory of the operator's choice."""

from __future__ import annotations

import os
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.formats.store import place_for


def path_within(directory: Path, filename: str) -> Path:
    """Return the path of a file in the directory.

    Raises:
        FileMissing: If there is no such directory.
        HypermapError: If the name leads out of it: it is absolute, has `..` in it, or passes a
            link to elsewhere; or if the system can have no file of that name.
    """
    if not directory.is_dir():
        raise FileMissing(f"{directory}: the map_directory does not exist")
    path = place_for(directory, filename)
    if not _real(path).is_relative_to(_real(directory)):
        raise HypermapError(f"{filename!r} is a link that leads out of the map_directory")
    return path


def archive_within(directory: Path, filename: str) -> Path:
    """Return where an archive of the directory is to be written; raises like `path_within`.

    Raises:
        HypermapError: Also if the name does not end in .hmap.
    """
    path = path_within(directory, filename)
    if path.suffix.lower() != ".hmap":
        raise HypermapError(f"{filename!r}: give a name that ends in .hmap")
    return path


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))
