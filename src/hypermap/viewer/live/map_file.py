"""The file of an open map: detects changes on disk, and checks before it is replaced."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from hypermap.core.errors import FormatError
from hypermap.core.hypermap import Hypermap
from hypermap.formats.atomic import is_write_protected
from hypermap.formats.config import file_of_map
from hypermap.formats.store import FolderStore, place_for, read_file
from hypermap.formats.yaml_text import read_yaml
from hypermap.viewer.live.request_errors import Refused

_YAML_ENDINGS = (".yaml", ".yml")
_Look: TypeAlias = tuple[tuple[int, int, int], ...]


@dataclass
class MapFile:
    """Where a map is stored, and the state of the file when it was last read or written.

    Attributes:
        path: an archive, or a configuration in a folder.
        parts: of a configuration, what the layers name as their files.
        seen: when each of the files was written, and how large it was.
        is_own: whether the map was opened from it or saved in it.
        is_plain_grid: whether it is a map_server YAML, which can hold nothing but a grid.
        state: what has happened to the file since then.
    """

    path: Path
    parts: tuple[str, ...]
    seen: _Look
    is_own: bool = True
    is_plain_grid: bool = False
    state: Literal["same", "changed", "vanished"] = "same"

    @classmethod
    def of(cls, path: Path, hypermap: Hypermap) -> MapFile:
        """Return the file of a map that is opened or saved now."""
        path = file_of_map(path)
        named = (layer.settings.get("file") for layer in hypermap)
        is_folder = path.suffix.lower() in _YAML_ENDINGS
        parts = tuple(file for file in named if is_folder and isinstance(file, str))
        return cls(
            path, parts, _look_at(path, parts), is_plain_grid=is_folder and not _has_layers(path)
        )

    def sibling(self, name: str) -> MapFile:
        """Return another file of the same folder, to save in.

        Raises:
            Refused: If the name leads out of the folder, or does not end in .hmap.
            HypermapError: If the system can have no file of that name.
        """
        folder = self.path.parent
        try:
            path = place_for(folder, name)
        except FormatError as error:
            raise Refused(str(error), 403) from None
        if not _real(path).is_relative_to(_real(folder)):
            raise Refused(f"{name!r} leads out of the map's folder", 403)
        if path == self.path:
            return self
        if path.suffix.lower() != ".hmap":
            raise Refused(f"{name!r}: give a name that ends in .hmap")
        return MapFile(path, (), (), is_own=False)

    def look(self) -> bool:
        """Look at the file, and return whether its state is another than before."""
        now = _look_at(self.path, self.parts)
        state = self.state
        self.state = "same" if now == self.seen else "changed" if now else "vanished"
        return self.state != state

    def check_before_saving(self, overwrite: bool) -> None:
        """Make sure that saving destroys nothing unknowingly.

        Raises:
            Refused: If it would.
        """
        name = self.path.name
        if self.is_plain_grid:
            raise Refused(f"{name}: a map_server map can hold no objects; save as NAME.hmap")
        self.look()
        if self.is_own and self.state == "changed" and not overwrite:
            raise Refused(
                f"{name} has changed on disk since it was opened; saving would replace that",
                409,
                "disk",
            )
        if is_write_protected(self.path) and not overwrite:
            raise Refused(f"{name} is write-protected; saving would replace it", 409, "exists")
        if not self.is_own and self.path.exists() and not overwrite:
            raise Refused(f"{name} exists already; saving would replace it", 409, "exists")


def _has_layers(path: Path) -> bool:
    """Return whether a YAML file is a map's configuration."""
    document = read_yaml(read_file(path), str(path))
    return isinstance(document, Mapping) and "layers" in document


def _look_at(path: Path, parts: tuple[str, ...]) -> _Look:
    """Return what identifies the state of a map's files; nothing if they are gone."""
    if not path.exists():
        return ()
    store = FolderStore(path.parent)
    files = [path, *(path.parent / name for part in parts for name in store.names_of(part))]
    looks = []
    for file in files:
        with contextlib.suppress(OSError):  # it went just now; then there is one less
            found = file.stat()
            looks.append((found.st_mtime_ns, found.st_size, found.st_ino))
    return tuple(looks)


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))
