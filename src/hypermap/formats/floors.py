"""The maps of a building: one file, and all that its lifts and stairs lead to."""

from __future__ import annotations

import os.path
from pathlib import Path

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.formats.config import file_of_map
from hypermap.formats.hmap import open_map
from hypermap.paths.floors import connectors_on, other_file


def open_floors(path: str | Path) -> dict[str, Hypermap]:
    """Return a map and all maps that lifts and stairs lead to, by their absolute paths.

    Raises:
        FileMissing: If there is no such file.
        HypermapError: If one cannot be read; it names the map that leads there.
    """
    first = os.path.normpath(file_of_map(Path(path)).absolute())
    maps: dict[str, Hypermap] = {}
    waiting = [(first, "")]
    while waiting:
        file, leading = waiting.pop(0)
        if file in maps:
            continue
        try:
            maps[file] = open_map(file)
            leads = [
                (other_file(file, each), f"{file}, {each.title}: ")
                for each in connectors_on(maps[file])
            ]
        except HypermapError as error:
            if leading:
                raise HypermapError(f"{leading}{error}") from error
            raise
        waiting += leads
    return maps
