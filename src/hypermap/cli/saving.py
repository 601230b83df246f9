"""Saves a map in another place than it was read from."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.formats.semantic.yaml_files import SemanticForm


def save_from(
    hypermap: Hypermap, source: Path | None, output: Path, semantic: SemanticForm = "auto"
) -> None:
    """Save a map so that its lifts and stairs lead to the same files as those of its source.

    Args:
        hypermap: the map; its metadata may change.
        source: the file that its metadata are from; None for a new map.
        output: the file to save to.
        semantic: as in `save_map`.

    Raises:
        HypermapError: If it cannot be saved.
    """
    from hypermap.formats import save_map

    _relink(hypermap, source, output)
    save_map(hypermap, output, semantic)


def replace_from(hypermap: Hypermap, source: Path | None, output: Path) -> Path | None:
    """Do what `save_from` does, and return the copy that is kept of an older map, if it is."""
    from hypermap.formats.backup import save_with_backup

    _relink(hypermap, source, output)
    return save_with_backup(hypermap, output, spare_edited=True)


def _relink(hypermap: Hypermap, source: Path | None, output: Path) -> None:
    from hypermap.formats.config import file_of_map

    has_links = bool(hypermap.metadata.get("connectors"))  # else, save the time of the import
    if has_links and source is not None and source.exists():  # not the address of a site
        from hypermap.paths.floors import relink

        with contextlib.suppress(HypermapError):  # unreadable ones stay as they are
            relink(hypermap, file_of_map(source), file_of_map(output))
