"""The file of an open map: whether it is still the one that was opened, and how it is replaced."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.formats.atomic import write_file
from hypermap.formats.config import CONFIG_NAME
from hypermap.formats.store import safe_name
from hypermap.viewer.live.refusals import Refused

_YAML_ENDINGS = (".yaml", ".yml")


@dataclass
class MapFile:
    """Where a map lies, and how the file looked when the map was last the same as it.

    Attributes:
        path: an archive, or a configuration in a folder.
        state: what has happened to the file since then.
    """

    path: Path
    seen: tuple[int, int, int] | None
    is_own: bool = True
    state: Literal["same", "changed", "vanished"] = "same"

    @classmethod
    def of(cls, path: Path) -> MapFile:
        """Return the file of a map that is opened or saved now."""
        path = path / CONFIG_NAME if path.is_dir() else path
        return cls(path, _look_of(path))

    def beside(self, name: str) -> MapFile:
        """Return another file of the same folder, to save in.

        Raises:
            Refused: If the name leads out of the folder, or does not end in .hmap.
        """
        folder = self.path.parent
        try:
            path = folder / safe_name(name)
        except HypermapError as error:
            raise Refused(str(error), 403) from None
        if not _real(path).is_relative_to(_real(folder)):
            raise Refused(f"{name!r} leads out of the map's folder", 403)
        if path == self.path:
            return self
        if path.suffix.lower() != ".hmap":
            raise Refused(f"{name!r}: give a name that ends in .hmap")
        return MapFile(path, None, is_own=False)

    def look(self) -> bool:
        """Look at the file, and return whether its state is another than before."""
        now = _look_of(self.path)
        state = self.state
        self.state = "same" if now == self.seen else "vanished" if now is None else "changed"
        return self.state != state

    def check_before_saving(self, hypermap: Hypermap, overwrite: bool) -> None:
        """Make sure that saving destroys nothing unknowingly.

        Raises:
            Refused: If it would.
        """
        name = self.path.name
        is_plain_grid = not any(isinstance(layer, SemanticLayer) for layer in hypermap)
        if self.path.suffix.lower() in _YAML_ENDINGS and is_plain_grid:
            raise Refused(f"{name}: a map_server map stays as it is; save as NAME.hmap")
        self.look()
        if self.is_own and self.state == "changed" and not overwrite:
            raise Refused(
                f"{name} has changed on disk since it was opened; saving would replace that",
                409,
                "disk",
            )
        if not self.is_own and self.path.exists() and not overwrite:
            raise Refused(f"{name} exists already; saving would replace it", 409, "exists")

    def keep_backup(self) -> None:
        """Keep what lies on the disk beside it: NAME.bak; of a folder an archive, NAME.bak.hmap.

        Raises:
            HypermapError: If that is not possible; then the file should not be replaced.
        """
        try:
            if self.path.suffix.lower() not in _YAML_ENDINGS:
                content = self.path.read_bytes()
                write_file(self.path.with_name(self.path.name + ".bak"), content)
            elif self.path.exists():
                save_map(open_map(self.path), self.path.with_name(self.path.name + ".bak.hmap"))
        except (FileNotFoundError, FileMissing):
            return  # there is nothing to keep
        except (OSError, HypermapError) as error:
            raise HypermapError(f"no backup can be kept, so nothing is saved: {error}") from error


def _look_of(path: Path) -> tuple[int, int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))
