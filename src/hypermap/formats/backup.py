"""Backups of maps that a save replaces, and whether people have edited them."""

from __future__ import annotations

import copy
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.core.history import MAP_VERSION
from hypermap.core.hypermap import Hypermap
from hypermap.formats.archive import read_archive
from hypermap.formats.atomic import refuse_link_out, write_file
from hypermap.formats.config import CONFIG_NAME, parse_config
from hypermap.formats.hmap import MAPPER_STATE, open_map, save_map

EDITED_WITH = "edited_with"
"""The key of a map's metadata for the program in which people edited it."""

BY_HAND = "by_hand"
"""Where objects and a map's metadata say what people have done to what mapping made."""

ALIGNED_TO = "aligned_to"
"""Where a map's metadata hold the id of the map to which `hypermap align` has aligned it."""

_OF_MAPPING = {"frames", "config"}  # what mapping writes into a map's metadata
_YAML_ENDINGS = (".yaml", ".yml")


def backup_of(path: Path) -> Path:
    """Return the path of the copy of a map's file: NAME.bak, or NAME.bak.hmap for a folder."""
    is_folder = path.suffix.lower() in _YAML_ENDINGS
    return path.with_name(path.name + (".bak.hmap" if is_folder else ".bak"))


def keep_backup(path: Path, *, spare_edited: bool = False) -> Path | None:
    """Keep a copy of the file on disk, named by `backup_of`.

    Args:
        path: of a map.
        spare_edited: whether to keep an existing copy that mapping could not make again, if it
            could make the file again.

    Returns:
        The copy; None if there was nothing to keep.

    Raises:
        HypermapError: If that is not possible; then the file should not be replaced.
    """
    backup = backup_of(path)
    try:
        if spare_edited and why_precious(backup) and not why_precious(path):
            return None
        refuse_link_out(backup, backup.parent)
        if path.suffix.lower() not in _YAML_ENDINGS:
            write_file(backup, path.read_bytes())
        elif path.exists():
            save_map(open_map(path), backup)
        else:
            return None
    except (FileNotFoundError, FileMissing):
        return None
    except (OSError, HypermapError) as error:
        raise HypermapError(f"cannot keep a backup, so nothing is saved: {error}") from error
    return backup


def save_edited(hypermap: Hypermap, path: Path, editor: str) -> None:
    """Save a map that a person has changed, and keep a copy of the file that it replaces.

    Args:
        hypermap: the map; it is marked as edited, so that mapping does not replace it unasked.
        path: its file.
        editor: the program, as "hypermap notes".

    Raises:
        HypermapError: If that is not possible; the old file then remains.
    """
    keep_backup(path)
    marked = copy.copy(hypermap)
    known = hypermap.metadata.get(MAP_VERSION)
    marked.metadata[EDITED_WITH] = editor
    marked.metadata[MAP_VERSION] = 1 + (known if type(known) is int else 0)
    save_map(marked, path)


def may_go_on(archive: Path) -> bool:
    """Return whether an archive holds what mapping needs to go on."""
    try:
        return MAPPER_STATE in read_archive(archive).files
    except (HypermapError, OSError):
        return False


def why_precious(archive: Path) -> str | None:
    """Return why mapping could not make an archive again; None if it could, or it is not a map."""
    try:
        files = read_archive(archive).files
        metadata = parse_config(files[CONFIG_NAME], str(archive)).metadata
    except (HypermapError, OSError, KeyError):
        return None
    if EDITED_WITH in metadata:
        return f"it was edited by hand, with {metadata[EDITED_WITH]}"
    if BY_HAND in metadata:
        return "it was edited by hand"
    return None if metadata.keys() >= _OF_MAPPING else "it was not made by mapping"
