"""The plug-in of semantic layers, and their YAML: named shapes, compatible with the first program.

The specification is docs/formats/semantic.md. One broken entry does not spoil the others: it is
reported, kept, and written back at the end of the file, since old readers stop at the first one.
"""

from __future__ import annotations

import dataclasses
import itertools
import logging
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from hypermap.core.errors import FormatError
from hypermap.core.layer import Store
from hypermap.core.objects import MAX_ID, ObjectTable
from hypermap.core.semantic import Rejected, SemanticLayer, SemanticObject
from hypermap.formats.checked import found
from hypermap.formats.collector import paused_collector
from hypermap.formats.columns.arrow import has_pyarrow
from hypermap.formats.columns.footprints import footprint_from_wkt
from hypermap.formats.columns.geoparquet import MAGIC
from hypermap.formats.config import BINARY_FILE
from hypermap.formats.semantic.embeddings_file import (
    load_embeddings,
    save_embeddings,
    without_embeddings,
)
from hypermap.formats.semantic.evidence_file import load_evidence, save_evidence, without_evidence
from hypermap.formats.semantic.parquet_files import dump_parquet, parse_parquet
from hypermap.formats.semantic.pictures_file import (
    load_pictures,
    save_pictures,
    without_pictures,
)
from hypermap.formats.semantic.records import object_from_record
from hypermap.formats.semantic.regular_yaml import read_regular
from hypermap.formats.semantic.yaml_writing import TooLarge, dump_table
from hypermap.formats.yaml_text import read_yaml

logger = logging.getLogger(__name__)

SemanticForm: TypeAlias = Literal["auto", "yaml", "parquet"]

NEXT_ID = "next_id"
"""The key of a layer's configuration with the next free id, so that no id is reused."""

MANY_OBJECTS = 100_000
"""From how many objects on a layer is kept as GeoParquet, where nothing else is said; one that is
too large for YAML is so with fewer objects, too."""

_TEXT = {("*", "name"), ("*", "shape"), ("*", "tags", "*")}


@dataclass(frozen=True)
class SemanticFiles:
    """The files of semantic layers: `file` NAME means the YAML file NAME or NAME.parquet.

    The evidence for the objects, their pictures and their embeddings are next to it, in the files
    that the keys `evidence`, `pictures` and `embeddings` name.

    Attributes:
        form: `yaml`, `parquet`, or `auto`, which is Parquet for layers of many objects, or too
            large for YAML, where pyarrow is installed, and otherwise YAML.
    """

    form: SemanticForm = "auto"

    def empty(self, name: str, frame_id: str, settings: Mapping[str, Any]) -> SemanticLayer:
        """Return a layer without objects."""
        return SemanticLayer(name, frame_id, settings=_own(settings))

    def load(
        self, store: Store, file: str, name: str, frame_id: str, settings: Mapping[str, Any]
    ) -> SemanticLayer:
        """Return the layer; entries that cannot be read are logged and in its `rejected`.

        Raises:
            FormatError: If the file is neither a list in YAML nor GeoParquet of objects.
            MissingExtra: If it is GeoParquet, and pyarrow is not installed.
        """
        path = store.path_of(file)
        table, rejected = parse_content(store.read(file), path)
        for entry in rejected:
            logger.warning(
                "%s: object %d %r is left out: %s", path, entry.position, entry.name, entry.reason
            )
        evidence = load_evidence(store, settings)
        next_id = settings.get(NEXT_ID)
        free = next_id if type(next_id) is int and 0 <= next_id <= MAX_ID else 0
        layer = SemanticLayer.of_table(
            name, frame_id, table, _own(settings), rejected, evidence, free
        )
        layer.kept_pictures = load_pictures(store, settings)
        layer.kept_embeddings = load_embeddings(store, settings)
        return layer

    def save(self, layer: SemanticLayer, store: Store, file: str) -> Mapping[str, Any]:
        """Write the layer's files, and return which keys they need; an empty layer needs none.

        Raises:
            MissingExtra: If GeoParquet is asked for, and pyarrow is not installed.
            TypeError: If an attribute is of a type that YAML does not have.
            HypermapError: If the layer is too large to read back.
        """
        if not len(layer) and not layer.rejected:
            return {}
        may_be_parquet = self.form == "parquet" or (self.form == "auto" and has_pyarrow())
        if self.form != "parquet" and not (may_be_parquet and len(layer) >= MANY_OBJECTS):
            try:
                store.write(file, dump_table(layer.table, layer.rejected))
                return _about(layer, store, file)
            except TooLarge:
                if not may_be_parquet:
                    raise
        binary = f"{file}.parquet"
        store.write(binary, dump_parquet(layer.table, layer.frame_id, layer.rejected))
        return {BINARY_FILE: binary, **_about(layer, store, file)}


PLUGIN = SemanticFiles()


def _about(layer: SemanticLayer, store: Store, file: str) -> dict[str, Any]:
    """Write evidence, pictures and embeddings next to the layer's file, and return their keys."""
    return {
        **save_evidence(layer, store, file),
        **save_pictures(layer, store, file),
        **save_embeddings(layer, store, file),
        **_ids_of(layer),
    }


def _ids_of(layer: SemanticLayer) -> dict[str, int]:
    """Return the configuration of ids, which is needed only if removed objects had larger ones."""
    largest = int(layer.ids.max(initial=-1))
    return {NEXT_ID: layer.next_id} if layer.next_id > largest + 1 else {}


def _own(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings without those that name files, which saving sets again."""
    others = without_embeddings(without_pictures(without_evidence(settings)))
    return {k: v for k, v in others.items() if k not in (BINARY_FILE, NEXT_ID)}


def parse_content(content: bytes, path: str) -> tuple[ObjectTable, list[Rejected]]:
    """Return the objects of a semantic file of either form, and the entries that are none.

    Raises:
        FormatError: If it is neither a list in YAML nor GeoParquet of objects.
        MissingExtra: If it is GeoParquet, and pyarrow is not installed.
    """
    with paused_collector():
        return (parse_parquet if content.startswith(MAGIC) else parse_table)(content, path)


def parse_objects(content: bytes, path: str) -> tuple[list[SemanticObject], list[Rejected]]:
    """Return the objects of a semantic YAML file, and the entries that are none.

    An object's id is its key `id`, and otherwise its position in the file. Where another object
    claims that number by its key, the object gets the next free one.

    Args:
        content: the file.
        path: how messages name it.

    Raises:
        FormatError: If the file is not a list in YAML.
    """
    entries = read_yaml(content, path, _TEXT)
    if entries is None:
        entries = []
    if not isinstance(entries, list):
        raise FormatError(f"expected a list of objects, found {found(entries)}", path=path)
    claimed = {_claimed_id(entry) for entry in entries} - {None}
    free = (number for number in itertools.count(len(entries)) if number not in claimed)
    objects: dict[int, SemanticObject] = {}
    rejected: list[Rejected] = []
    for position, entry in enumerate(entries):
        try:
            item = _object(entry)
            if item.id in objects:
                raise ValueError(f"its id {item.id} is that of another object")
        except ValueError as error:
            rejected.append(_rejected(position, entry, str(error), taken=objects))
            continue
        number = item.id
        if number is None:
            number = next(free) if position in claimed else position
        objects[number] = dataclasses.replace(item, id=number)
    return list(objects.values()), rejected


def parse_table(content: bytes, path: str) -> tuple[ObjectTable, list[Rejected]]:
    """Like `parse_objects`, but return columns; much faster for most files.

    Raises:
        FormatError: If the file is not a list in YAML.
    """
    table = read_regular(content)
    if table is not None:
        return table, []
    objects, rejected = parse_objects(content, path)
    return ObjectTable.of(objects), rejected


def dump_objects(objects: Iterable[SemanticObject], rejected: Iterable[Rejected] = ()) -> bytes:
    """Return a semantic YAML file; `parse_objects` gives exactly the same objects again.

    Args:
        objects: with ids.
        rejected: entries that could not be read.
    """
    return dump_table(ObjectTable.of(list(objects)), rejected)


def _object(entry: Any) -> SemanticObject:
    if not isinstance(entry, Mapping):
        raise ValueError(f"expected a name and a shape, found {found(entry)}")
    for key in ("name", "shape"):
        if not isinstance(entry.get(key), str):
            problem = f"must be text, found {found(entry[key])}" if key in entry else "is missing"
            raise ValueError(f"its {key} {problem}")
    return object_from_record(entry, footprint_from_wkt(entry["shape"]))


def _rejected(position: int, entry: Any, reason: str, taken: Container[int]) -> Rejected:
    """Return a rejected entry; an id that no other object has becomes its position."""
    name = str(entry.get("name", "")) if isinstance(entry, Mapping) else ""
    claimed = _claimed_id(entry)
    if claimed is not None and claimed not in taken:
        return Rejected(claimed, name, reason, {k: v for k, v in entry.items() if k != "id"})
    return Rejected(position, name, reason, entry)


def _claimed_id(entry: Any) -> int | None:
    claim = entry.get("id") if isinstance(entry, Mapping) else None
    return claim if type(claim) is int and 0 <= claim <= MAX_ID else None
