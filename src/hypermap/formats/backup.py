"""Backups of maps that a save replaces, and whether people have edited them."""

from __future__ import annotations

import contextlib
import copy
import shutil
import tempfile
from collections.abc import Callable, Iterator
from datetime import date, datetime, time
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.core.history import MAP_ID, MAP_VERSION
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.formats.archive import read_archive
from hypermap.formats.atomic import Undo, refuse_link_out, unfinished_file, why_not_written
from hypermap.formats.config import CONFIG_NAME, file_of_map, parse_config
from hypermap.formats.history_file import KEY as HISTORY
from hypermap.formats.history_file import edited_layers
from hypermap.formats.hmap import MAPPER_STATE, archive_of_map, open_map, replace_map
from hypermap.formats.journal import final_of
from hypermap.history import version_of

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


def is_from_before_today(backup: Path, hypermap: Hypermap) -> bool:
    """Return whether a copy is of a map as it was before today, by the times in its history.

    All that was changed since must have been changed today, on the clock of this computer.
    """
    known = hypermap.metadata.get(MAP_ID)
    if hypermap.history is None or known is None:
        return False
    try:
        old = open_map(backup)
    except (HypermapError, OSError):
        return False
    newer = [one for one in hypermap.history.revisions() if one.version > version_of(old)]
    midnight = datetime.combine(date.today(), time()).timestamp()
    is_todays = all(one.time is not None and one.time >= midnight for one in newer)
    return old.metadata.get(MAP_ID) == known and bool(newer) and is_todays


def save_with_backup(
    hypermap: Hypermap, path: Path, *, spare_edited: bool = False, spare: bool = False
) -> Path | None:
    """Save a map, and keep a copy of the file that it replaces, named by `backup_of`.

    If that fails, the file and an older copy stay as they are.

    Args:
        hypermap: the map.
        path: its file.
        spare_edited: whether to keep an existing copy that mapping could not make again, if it
            could make the file again.
        spare: whether to keep an existing copy in any case.

    Returns:
        The copy; None if there was nothing to keep, or an existing one was kept.

    Raises:
        HypermapError: If the map cannot be saved, or the copy cannot be made.
    """
    path = file_of_map(path)
    backup = backup_of(path)
    content = None
    is_spared = spare_edited and why_precious(backup) and not why_precious(path)
    if not (is_spared or (spare and backup.exists())):
        with _keeping(backup):
            content = _copy_of(path, backup)
    if content is None:
        replace_map(hypermap, path)
        return None
    final = final_of(backup)
    with contextlib.ExitStack() as held:
        with _keeping(backup):
            copied = held.enter_context(unfinished_file(final.parent, mode=0o600))
            copied.path.write_bytes(content)

        def before() -> Undo:
            with _keeping(backup):
                return copied.become_for_now(final, like=path)

        replace_map(hypermap, path, before=before)
    return backup


@contextlib.contextmanager
def or_elsewhere(name: str, hypermap: Callable[[], Hypermap]) -> Iterator[None]:
    """Save what took long to map in the folder for temporary files, if it cannot be saved within.

    Args:
        name: of the file, an archive.
        hypermap: returns the map.

    Raises:
        HypermapError: What was raised within; it says where the map is, if it could be saved.
    """
    try:
        yield
    except HypermapError as error:
        if (path := _saved_elsewhere(hypermap(), name)) is None:
            raise
        raise HypermapError(f"{error}; this map is in {path} instead") from None


def _saved_elsewhere(hypermap: Hypermap, name: str) -> Path | None:
    """Return where a map was saved; None if it cannot be saved there either."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="hypermap-"))
    except OSError:
        return None
    try:
        replace_map(hypermap, folder / name)
    except HypermapError:
        shutil.rmtree(folder, ignore_errors=True)
        return None
    return folder / name


def _copy_of(path: Path, backup: Path) -> bytes | None:
    """Return what the copy of a file will hold; None if there is no such file."""
    try:
        refuse_link_out(backup, backup.parent)
        if path.suffix.lower() not in _YAML_ENDINGS:
            return path.read_bytes()
        return archive_of_map(open_map(path), backup) if path.exists() else None
    except (FileNotFoundError, FileMissing, ValueError):  # of a wrong name, saving says so
        return None


@contextlib.contextmanager
def _keeping(backup: Path) -> Iterator[None]:
    """Say that an error is about the copy."""
    try:
        yield
    except OSError as error:
        raise HypermapError(
            f"cannot keep a backup, so nothing is saved: {backup}: {why_not_written(error)}"
        ) from error
    except HypermapError as error:
        raise HypermapError(f"cannot keep a backup, so nothing is saved: {error}") from error


def save_edited(hypermap: Hypermap, path: Path, editor: str) -> None:
    """Save a map that a person has changed, and keep a copy of the file that it replaces.

    Args:
        hypermap: the map; it is marked as edited, so that mapping does not replace it unasked.
        path: its file.
        editor: the program, as "hypermap notes".

    Raises:
        HypermapError: If that is not possible; the old file then remains.
    """
    marked = copy.copy(hypermap)
    known = hypermap.metadata.get(MAP_VERSION)
    marked.metadata[EDITED_WITH] = editor
    marked.metadata[MAP_VERSION] = 1 + (known if type(known) is int else 0)
    save_with_backup(marked, path)


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
        config = parse_config(files[CONFIG_NAME], str(archive))
    except (HypermapError, OSError, KeyError):
        return None
    metadata = config.metadata
    if EDITED_WITH in metadata:
        return f"it was edited by hand, with {metadata[EDITED_WITH]}"
    names = config.others.get(HISTORY)
    listed = [str(name) for name in names] if isinstance(names, list) else []
    history = (files[name] for name in listed if name in files)
    # `hypermap rooms` can find rooms again.
    if BY_HAND in metadata or edited_layers(history) - {ROOMS}:
        return "it was edited by hand"
    return None if metadata.keys() >= _OF_MAPPING else "it was not made by mapping"
