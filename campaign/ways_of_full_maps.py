"""Ways to save what mapping and people leave: notes with their files, history, state, the spool."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import importlib.util
from collections.abc import AsyncIterator, Callable, Iterator
from datetime import datetime, timezone
from pathlib import Path

import shapely

from campaign.full_map import ATTACHED, full_map
from campaign.way import Way
from hypermap import HypermapError, NotesLayer, open_map, save_map
from hypermap.core.hypermap import Hypermap
from hypermap.core.notes import Attachment, Note
from hypermap.formats.config import CONFIG_NAME
from hypermap.formats.hmap import files_of_map
from hypermap.testing import square

_LARGE = 2_500_000  # bytes, more than the page keeps in memory
_MONDAY = datetime(2026, 11, 23, tzinfo=timezone.utc)


def ways_of_full_maps() -> list[Way]:
    """Return the ways; that of the spool only where its library is installed."""
    has_store = importlib.util.find_spec("psycopg") is not None
    spool = [Way("spool", _put_into_spool, _read_spool)] if has_store else []
    return [
        Way("full archive", _save_full("map.hmap"), _read_full("map.hmap")),
        Way("full folder", _save_full(CONFIG_NAME), _read_full(CONFIG_NAME)),
        Way("upload of a file to the page", _upload, _read_full("map.hmap")),
        *spool,
    ]


def write_full_sources(folder: Path) -> None:
    """Write both versions of the full map, whose notes have files in the map and next to it."""
    folder.mkdir(parents=True, exist_ok=True)
    for version in (0, 1):
        made = full_map(version)
        for layer in made:
            if isinstance(layer, NotesLayer):
                layer.inside_up_to = len(ATTACHED)
        save_map(made, _source(folder, version))


def _source(folder: Path, version: int) -> Path:
    return folder / f"full-{version}.hmap"


def _opened_source(folder: Path, version: int) -> Hypermap:
    return open_map(_source(folder.parent / "sources", version))


def _save_full(name: str) -> Callable[[Path, int], object]:
    return lambda folder, version: save_map(_opened_source(folder, version), folder / name)


def _read_full(name: str) -> Callable[[Path], str]:
    """Return what reads all that a map holds, but for how often it was saved."""

    def read(folder: Path) -> str:
        opened = open_map(folder / name)
        files = files_of_map(opened)
        del files[CONFIG_NAME]
        contents = [files[key] for key in sorted(files)]
        contents += [each.sha256.encode() + _content(each) for each in _attached(opened)]
        return hashlib.sha256(b"|".join(contents)).hexdigest()[:16]

    return read


def _attached(hypermap: Hypermap) -> Iterator[Attachment]:
    for layer in hypermap:
        if isinstance(layer, NotesLayer):
            for note in layer:
                yield from note.attachments


def _content(attachment: Attachment) -> bytes:
    with attachment.open() as file:
        content = file.read()
    if hashlib.sha256(content).hexdigest() != attachment.sha256:
        raise HypermapError(f"the attached {attachment.name} is not whole")
    return content


def _upload(folder: Path, version: int) -> None:
    """Send a large file to the page, and save a map with a note that has it."""
    from hypermap.viewer.live.attached import Uploads

    async def pieces() -> AsyncIterator[bytes]:
        for _ in range(5):
            yield bytes([version]) * (_LARGE // 5)

    path = folder / "map.hmap"
    sent = asyncio.run(Uploads().receive(pieces(), "plan.bin", path))
    note = Note(shapely.Point(1, 2), f"Plan {version}", "Ada", _MONDAY, (sent,))
    save_map(Hypermap([NotesLayer("notes", "map", [note])]), path)


def _put_into_spool(folder: Path, version: int) -> None:
    """Put one thing or two into a spool, unless they are there."""
    from hypermap.fleet.store.observed import Observed
    from hypermap.fleet.store.spool import Spool

    spool = Spool(folder / "spool")
    with contextlib.closing(spool):
        for number in range(len(spool), version + 1):
            spool.put(Observed("lab", "semantic", "anna", [square("cup", number, 0, id=number)]))


def _read_spool(folder: Path) -> str:
    """Return how much waits; what waits longest must be readable."""
    from hypermap.fleet.store.spool import Spool

    spool = Spool(folder / "spool")
    with contextlib.closing(spool):
        first = spool.first()
        return f"{len(spool)}, first {None if first is None else first[1].objects[0].id}"
