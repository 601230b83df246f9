"""Layers of notes as files. The specification is docs/formats/notes.md."""

from __future__ import annotations

import hashlib
import json
import stat
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

import shapely
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import FormatError, NoteError
from hypermap.core.iso_times import time_from_iso
from hypermap.core.layer import Store
from hypermap.core.notes import Attachment, Note
from hypermap.core.notes_layer import INSIDE_UP_TO, NotesLayer
from hypermap.formats import limits
from hypermap.formats.beside import is_kept
from hypermap.formats.checked import Checked, check
from hypermap.formats.letters import check_read
from hypermap.formats.store import MemoryStore
from hypermap.notes.media_types import HEAD, media_type_of

VERSION = 1

_LARGEST_ID = (1 << 31) - 1  # of a ROS message
_Id = Annotated[int, Field(ge=0, le=_LARGEST_ID, strict=True)]
_WRONG = (ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError)


class _File(Checked):
    name: str
    media_type: str
    size: Annotated[int, Field(ge=0, strict=True)]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    inside: Annotated[bool, Field(strict=True)]


class _Properties(Checked):
    text: str = ""
    author: str = ""
    time: str
    changed: str | None = None
    links: tuple[str, ...] = ()
    files: tuple[Any, ...] = ()


class _Feature(Checked):
    type: Literal["Feature"]
    id: _Id
    geometry: dict[str, Any]
    properties: dict[str, Any]


class _Geometry(Checked):
    type: Literal["Point", "Polygon", "MultiPolygon"]
    coordinates: list[Any]


class _Collection(Checked):
    type: Literal["FeatureCollection"]
    hypermap_notes: int
    next_id: Annotated[int, Field(ge=0, le=_LARGEST_ID + 1, strict=True)] = 1
    inside_up_to: Annotated[int, Field(ge=0, strict=True)] = INSIDE_UP_TO
    beside: str | None = None
    features: list[Any]


class NotesFiles:
    """The files of notes: `file` NAME means NAME.geojson and what is attached, NAME/SHA256."""

    def empty(self, name: str, frame_id: str, settings: Mapping[str, Any]) -> NotesLayer:
        """Return a layer without notes."""
        return NotesLayer(name, frame_id, settings=settings)

    def load(
        self, store: Store, file: str, name: str, frame_id: str, settings: Mapping[str, Any]
    ) -> NotesLayer:
        """Return the layer.

        Raises:
            FormatError: If one of its files is missing or wrong. A file next to the map may be
                missing: whoever opens it is told.
        """
        path = store.path_of(f"{file}.geojson")
        collection = _parsed(store.read(f"{file}.geojson"), path)
        reader = _Reader(store, file, path, collection.beside)
        notes = [reader.note(raw, i) for i, raw in enumerate(collection.features)]
        try:
            return NotesLayer(
                name,
                frame_id,
                notes,
                settings,
                next_id=collection.next_id,
                inside_up_to=collection.inside_up_to,
            )
        except ValueError as error:
            raise FormatError(str(error), path=path, key="features") from None

    def save(self, layer: NotesLayer, store: MemoryStore, file: str) -> None:
        """Write the layer's files; a layer that has never had a note needs none."""
        notes = layer.notes()
        if not notes and layer.next_id == 1:
            return
        inside = _inside(layer, notes, store.beside is not None)
        features = [_feature(note, inside) for note in notes]
        files = {each.sha256: each for note in notes for each in note.attachments}
        document = {
            "type": "FeatureCollection",
            "hypermap_notes": VERSION,
            "next_id": layer.next_id,
            "inside_up_to": layer.inside_up_to,
            **({"beside": store.beside} if files.keys() - inside else {}),
            "features": features,
        }
        text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
        content = text.encode()
        if len(content) > limits.MAX_NOTES_BYTES:
            raise NoteError(
                f"layer {layer.name!r}: the texts of all notes have {len(content)} bytes, more "
                f"than the {limits.MAX_NOTES_BYTES} that are allowed"
            )
        store.write(f"{file}.geojson", content)
        for sha256, each in sorted(files.items()):
            if sha256 in inside:
                with each.open() as opened:
                    store.write(f"{file}/{sha256}", opened.read())
            else:
                store.large.append(each)


PLUGIN = NotesFiles()


class _Reader:
    """Makes notes of parsed features."""

    def __init__(self, store: Store, file: str, path: str, beside: str | None) -> None:
        self._store, self._file, self._path = store, file, path
        self._beside = None if beside is None else self._place_beside(beside)

    def note(self, raw: Any, position: int) -> Note:
        place = f"features[{position}]"
        feature = check(_Feature, raw, self._path, place)
        check_read(json.dumps(feature.properties, ensure_ascii=False), self._path, place)
        about = check(_Properties, feature.properties, self._path, f"{place}.properties")
        shape = self._shape(feature.geometry, f"{place}.geometry")
        try:
            return Note(
                shape,
                about.text,
                about.author,
                _time(about.time),
                tuple(self._attachment(each, place, i) for i, each in enumerate(about.files)),
                about.links,
                feature.id,
                None if about.changed is None else _time(about.changed),
            )
        except (ValueError, NoteError) as error:
            raise FormatError(str(error), path=self._path, key=f"{place}.properties") from None

    def _attachment(self, raw: Any, place: str, number: int) -> Attachment:
        key = f"{place}.properties.files[{number}]"
        file = check(_File, raw, self._path, key)
        if file.inside:
            member = f"{self._file}/{file.sha256}"
            content = self._store.read(member)
            if hashlib.sha256(content).hexdigest() != file.sha256:
                path = self._store.path_of(member)
                raise FormatError("the attached file is damaged", path=path, key=key)
            media_type = media_type_of(content[:HEAD])
            return Attachment(file.name, media_type, file.size, file.sha256, content)
        if self._beside is None:
            what = "says that a file is next to the map, but not where"
            raise FormatError(what, path=self._path, key=key)
        place_beside = self._beside / file.sha256
        if _is_link(place_beside):
            raise FormatError(f"{place_beside} is a link", path=self._path, key=key)
        return Attachment(file.name, file.media_type, file.size, file.sha256, place_beside)

    def _place_beside(self, name: str) -> Path:
        """Return the folder of large files, which is next to the map and nowhere else."""
        if "/" in name or "\\" in name or name in ("", ".", "..") or not name.isprintable():
            raise FormatError(f"{name!r} is not a folder next to the map", path=self._path)
        return (self._store.folder or Path()).absolute() / name

    def _shape(self, raw: Mapping[str, Any], key: str) -> BaseGeometry:
        geometry = check(_Geometry, raw, self._path, key)
        try:
            shape: BaseGeometry = shapely.geometry.shape(geometry.model_dump())
        except (*_WRONG, shapely.errors.ShapelyError) as error:
            what = f"is not a valid {geometry.type}: {error}"
            raise FormatError(what, path=self._path, key=key) from None
        return shape


def _is_link(path: Path) -> bool:
    try:
        return stat.S_ISLNK(path.lstat().st_mode)
    except OSError:  # also where nobody may look, and for names that no file can have
        return False


def _parsed(content: bytes, path: str) -> _Collection:
    if len(content) > limits.MAX_NOTES_BYTES:
        raise FormatError(f"holds more than {limits.MAX_NOTES_BYTES} bytes", path=path)
    try:
        document = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"is not valid JSON: {error}", path=path) from None
    collection = check(_Collection, document, path)
    if collection.hypermap_notes != VERSION:
        raise FormatError(
            f"is of version {collection.hypermap_notes}; this program reads {VERSION}",
            path=path,
            key="hypermap_notes",
        )
    return collection


def _time(text: str) -> datetime:
    moment = time_from_iso(text)
    if moment.tzinfo is None:
        raise ValueError(f"the time {text!r} has no time zone")
    return moment


def _inside(layer: NotesLayer, notes: list[Note], may_be_beside: bool) -> set[str]:
    """Return the hashes of the files that are kept within the map: small ones, as long as fit."""
    inside: set[str] = set()
    total = 0
    for each in _attachments(notes):
        is_small = each.size <= layer.inside_up_to and (each.is_there or not is_kept(each))
        fits = total + each.size <= limits.MAX_ATTACHED_INSIDE
        is_inside = is_small and fits and len(inside) < limits.MAX_ATTACHED_MEMBERS
        if (is_inside or not may_be_beside) and each.sha256 not in inside:
            inside.add(each.sha256)
            total += each.size
    if total > limits.MAX_ATTACHED_INSIDE:
        raise NoteError(
            f"layer {layer.name!r}: the attached files have {total / 1e6:.0f} MB; only a map in a "
            f"file, which keeps large files next to it, can have more than "
            f"{limits.MAX_ATTACHED_INSIDE / 1e6:.0f} MB"
        )
    return inside


def _attachments(notes: list[Note]) -> Iterator[Attachment]:
    return (each for note in notes for each in note.attachments)


def _feature(note: Note, inside: set[str]) -> dict[str, Any]:
    properties = {
        "title": note.title,
        "text": note.text,
        "author": note.author,
        "time": note.time.isoformat(),
        **({} if note.changed is None else {"changed": note.changed.isoformat()}),
        "links": list(note.links),
        "files": [
            {
                "name": each.name,
                "media_type": each.media_type,
                "size": each.size,
                "sha256": each.sha256,
                "inside": each.sha256 in inside,
            }
            for each in note.attachments
        ],
    }
    return {
        "type": "Feature",
        "id": note.id,
        "geometry": shapely.geometry.mapping(note.place),
        "properties": properties,
    }
