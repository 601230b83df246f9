"""Saving the map when the node ends, so that what was recorded is not lost."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.formats import save_map
from hypermap.ros.port import Parameter, Port, Value

SAVE_TO = Parameter(
    "save_to", "", "Archive (.hmap) in which the map is stored when the node ends; empty for none."
)


def archive_to_save(values: Mapping[str, Value]) -> Path | None:
    """Return where the map is stored at the end; None for nowhere.

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
    return path


def save_at_end(hypermap: Hypermap, path: Path, port: Port) -> None:
    """Store a map, unless there is nothing in it: an older file is worth more than that."""
    if all(layer.extent().is_empty for layer in hypermap):
        port.log("warning", f"{path} is not written: nothing has arrived in any layer")
        return
    try:
        save_map(hypermap, path)
    except (HypermapError, OSError) as error:
        port.log("error", f"the map could not be stored: {error}")
        return
    port.log("info", f"stored the map in {path}")
