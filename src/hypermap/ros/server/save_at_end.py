"""Saves the map when the node ends, so that no recording is lost.

A file that holds another map is never written over: the map is stored next to it then.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.formats.backup import save_with_backup
from hypermap.ros.port import Parameter, Port, Value

SAVE_TO = Parameter(
    "save_to",
    "",
    "Archive (.hmap) in which the map is stored when the node ends; empty for none.",
    once=True,
)


def archive_to_save(values: Mapping[str, Value]) -> Path | None:
    """Return where the operator wants the map stored at the end; None for nowhere.

    Raises:
        HypermapError: If nothing could be stored there: better now than after an hour of mapping.
    """
    given = str(values.get(SAVE_TO.name, ""))
    if not given:
        return None
    path = Path(given).expanduser()
    if path.suffix.lower() != ".hmap":
        raise HypermapError(f"save_to: {given!r}: give a name that ends in .hmap")
    if not path.parent.is_dir():
        raise FileMissing(f"save_to: {given!r}: there is no folder {path.parent}")
    return path.absolute()


def announce_end(path: Path, own: Collection[Path], port: Port) -> None:
    """Say where the map will be stored.

    Args:
        path: where the operator wants it.
        own: files that hold the map, as it was loaded or stored.
        port: takes the line.
    """
    target = place_at_end(path, own)
    if target == path:
        port.log("info", f"the map will be stored in {path} at the end")
    else:
        port.log("warning", f"{_foreign(path)}, and the map will be stored in {target} at the end")


def save_at_end(hypermap: Hypermap, path: Path, own: Collection[Path], port: Port) -> None:
    """Store a map, unless there is nothing in it.

    Args:
        hypermap: the map.
        path: where the operator wants it; a free name next to it if another map lies there.
        own: files that hold the map, as it was loaded or stored: they may be written over.
        port: says what was done.
    """
    if all(layer.extent().is_empty for layer in hypermap):
        port.log("warning", f"{path} is not written: nothing has arrived in any layer")
        return
    target = place_at_end(path, own)
    if target != path:
        port.log("warning", _foreign(path))
    try:
        save_with_backup(hypermap, target)
    except (HypermapError, OSError) as error:
        port.log("error", f"the map could not be stored: {error}")
        return
    port.log("info", f"stored the map in {target}")


def place_at_end(path: Path, own: Collection[Path]) -> Path:
    """Return where a map is stored: the path, or a free name next to it if another map lies there.

    Args:
        path: where the operator wants it.
        own: files that hold the map, as it was loaded or stored.
    """
    if not _is_there(path) or path.resolve() in {file.resolve() for file in own}:
        return path
    return free_name(path)


def free_name(path: Path) -> Path:
    """Return a name next to a path that no file has: NAME-1.hmap, or one with a higher number."""
    candidates = (path.with_stem(f"{path.stem}-{number}") for number in itertools.count(1))
    return next(free for free in candidates if not _is_there(free))


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # not readable: saving says so
        return False


def _foreign(path: Path) -> str:
    return f"{path} is there already, and this node has not loaded it: it is unchanged"
