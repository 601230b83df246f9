"""Reads and writes maps: the `.hmap` archive, a configuration in a folder, a map_server map.

The specification is docs/formats/hmap.md.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import re
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hypermap.core.arguments import check_kind
from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.history import MAP_VERSION, History
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer, Store
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.outside import open_site
from hypermap.formats.archive import packed_archive, read_archive, write_archive
from hypermap.formats.atomic import Before, is_folder, nothing_before, write_files
from hypermap.formats.beside import folder_beside, put_beside
from hypermap.formats.config import (
    BINARY_FILE,
    CONFIG_NAME,
    LayerEntry,
    MapConfig,
    dump_config,
    file_of_map,
    parse_config,
)
from hypermap.formats.grid.budget import check_cells
from hypermap.formats.grid.map_server import load_occupancy
from hypermap.formats.history_file import END_KEY as HISTORY_END
from hypermap.formats.history_file import KEY as HISTORY
from hypermap.formats.history_file import HistoryFiles, end_of, history_files, with_end
from hypermap.formats.journal import read_as_saved
from hypermap.formats.plugins import LayerPlugin, blamed_on_plugin, installed_layers, plugin_for
from hypermap.formats.semantic.yaml_files import SemanticFiles, SemanticForm
from hypermap.formats.store import FolderStore, MemoryStore, read_file, safe_name
from hypermap.formats.yaml_text import read_yaml
from hypermap.history import HistoryPolicy, begun, grown, keeps_history
from hypermap.text import is_address

logger = logging.getLogger(__name__)

OTHER_KEYS = "other_keys"
"""The key of a map's metadata for keys of other programs in the configuration."""

MAPPER_STATE = "mapper_state"
"""The configuration's key that names the file of what mapping needs to go on."""

_YAML_ENDINGS = (".yaml", ".yml")
_BAG_ENDINGS = (".bag", ".active", ".db3", ".mcap")
_TO_MAP = "`hypermap map` makes a map of a recording"


def open_map(path: str | Path) -> Hypermap:
    """Return the map in a file, or of a site in a store.

    Args:
        path: an `.hmap` archive, a configuration YAML in a folder or that folder, a
            map_server YAML, or the address of a site: "postgresql://HOST/DATABASE?site=SITE".

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it, or a file that belongs to it, is wrong or missing.
        HypermapError: If a plug-in for one of its layers does not work.
    """
    if is_address(path):
        return open_site(path)
    path = Path(path)
    if is_folder(path):
        try:
            return _open_yaml(path / CONFIG_NAME)
        except FileMissing:
            message = f"is a folder without {CONFIG_NAME}, so it is not a map; {_TO_MAP}"
            raise FormatError(message, path=path) from None
    if path.suffix.lower() in _YAML_ENDINGS:
        return _open_yaml(path)
    if path.suffix.lower() in _BAG_ENDINGS and path.is_file():
        raise FormatError(f"is a bag, not a map; {_TO_MAP}", path=path)
    store = read_archive(path)
    if CONFIG_NAME not in store.files:
        raise FormatError(f"is a zip archive without {CONFIG_NAME}, so it is not a map", path=path)
    return _read_map(store, CONFIG_NAME)


def save_map(hypermap: Hypermap, path: str | Path, semantic: SemanticForm = "auto") -> None:
    """Write a map so that `open_map` returns an equal one.

    The same map gives the same bytes each time. If saving fails, the old file stays. What has
    changed since the map was opened or saved is added to its history, if it keeps one, and its
    version counts up.

    Args:
        hypermap: the map.
        path: for a path that ends in `.yaml` or `.yml`, a configuration with the layers' files
            next to it; for an existing folder, the same as `hmap_config.yaml` in it; for any
            other path, an archive.
        semantic: the file format of semantic layers: `yaml`, which all programs read; `parquet`,
            which is several times faster, but which the first program does not read; or `auto`:
            Parquet from 100,000 objects on and for layers that are too large for YAML, if pyarrow
            is installed.

    Raises:
        MissingExtra: If the format is Parquet and pyarrow is not installed.
        FileMissing: If the folder to save in does not exist.
        HypermapError: If it cannot be written, or there is no plug-in for one of its layers.
        TypeError: If it is not a map.
    """
    check_kind(hypermap, Hypermap)
    replace_map(hypermap, path, semantic)


def replace_map(
    hypermap: Hypermap,
    path: str | Path,
    semantic: SemanticForm = "auto",
    before: Before = nothing_before,
) -> None:
    """Do what `save_map` does, and something just before the new files replace the old."""
    path = file_of_map(Path(path))
    given, hypermap = hypermap, grown(hypermap, time.time())
    is_config = path.suffix.lower() in _YAML_ENDINGS
    beside = folder_beside(path)
    store = _write_map(hypermap, path.name if is_config else CONFIG_NAME, semantic, beside)
    # Large files are in place before the map that names them, and those of the old map stay.
    put_beside(path.parent / beside, store.large)
    files = store.files
    if is_config:
        config = files.pop(path.name)
        # The configuration comes last: by it, readers see that the files are from another save.
        write_files(path.parent, {**files, path.name: config}, before)
    else:
        write_archive(path, files, before)
    if hypermap is not given:  # saving it again adds nothing
        given.history = hypermap.history
        given.metadata[MAP_VERSION] = hypermap.metadata[MAP_VERSION]


def archive_of_map(hypermap: Hypermap, path: Path) -> bytes:
    """Return what an archive of a map holds; its large files are put next to the path.

    Raises:
        FileMissing: If the path's folder, or an attached file, does not exist.
        HypermapError: If it cannot be made, as in `save_map`.
    """
    beside = folder_beside(path)
    store = _write_map(hypermap, CONFIG_NAME, "auto", beside)
    put_beside(path.parent / beside, store.large)
    return packed_archive(store.files, path)


def files_of_map(hypermap: Hypermap) -> dict[str, bytes]:
    """Return the files of a map by name, as an archive holds them.

    Raises:
        HypermapError: If there is no plug-in for one of its layers.
    """
    return _write_map(hypermap, CONFIG_NAME, "auto").files


def map_of_files(files: Mapping[str, bytes], where: str) -> Hypermap:
    """Return the map in files of `files_of_map`; messages name them by `where`.

    Raises:
        FormatError: If one is wrong or missing.
    """
    return _read_map(MemoryStore(files, where=where), CONFIG_NAME)


def _open_yaml(path: Path) -> Hypermap:
    """Open a configuration or a map_server map, depending on the keys."""
    return read_as_saved(path, lambda: _read_yaml_map(path))


def _read_yaml_map(path: Path) -> Hypermap:
    document = read_yaml(read_file(path), str(path))
    if isinstance(document, Mapping) and "layers" in document:
        return _read_map(FolderStore(path.parent), path.name)
    if isinstance(document, Mapping) and "image" in document:
        return Hypermap([load_occupancy(path)])
    raise FormatError(
        "is neither a map's configuration (with the key 'layers') nor a map_server map (with the "
        "key 'image')",
        path=path,
    )


def _read_map(store: MemoryStore | FolderStore, config_name: str) -> Hypermap:
    claims = _Claims(store)
    config = parse_config(claims.read(config_name), store.path_of(config_name))
    # Files that no known layer reads belong to the unknown ones.
    layers = list(_read_layers(config.layers, claims, store.path_of(config_name)))
    mapper_state = _read_mapper_state(config.others.pop(MAPPER_STATE, None), claims)
    history = _read_history(
        config.others.pop(HISTORY, None), config.others.pop(HISTORY_END, None), claims
    )
    opaque = [layer for layer in layers if isinstance(layer, OpaqueLayer)]
    for layer in opaque:
        if (file := layer.settings.get("file")) is not None:
            layer.files.update((name, claims.read(name)) for name in claims.left(file))
    if isinstance(store, MemoryStore):
        rest = {name: store.files[name] for name in store.files if name not in claims.names}
        if opaque:
            opaque[0].files.update(rest)
        elif rest:
            names = ", ".join(rest)
            logger.warning("%s: no layer uses %s; saving will leave it out", store.where, names)
    metadata = dict(config.metadata)
    if config.others:
        metadata[OTHER_KEYS] = config.others
    hypermap = Hypermap(layers, config.frames, metadata)
    hypermap.mapper_state = mapper_state
    if keeps_history(hypermap):
        hypermap.history = begun(hypermap, history)
    return hypermap


def _read_mapper_state(name: Any, store: Store) -> bytes | None:
    """Return what mapping needs to go on, which older programs leave out; this is logged."""
    if not isinstance(name, str):
        return None
    try:
        return store.read(name)
    except FormatError as error:
        logger.warning("mapping cannot continue this map: %s", error)
        return None


def _read_history(names: Any, end: Any, store: Store) -> History | None:
    """Return the history of a map, unparsed; a file of it that is lost is logged.

    Args:
        names: of its files.
        end: the version of its last line; None in maps of older programs.
        store: with the files.
    """
    if not isinstance(names, list) or not names:
        return None
    files = {str(name): _read_part(str(name), store) for name in names}
    earlier = HistoryFiles(with_end(files, end), store.path_of(HISTORY))
    return History(earlier=earlier, loses_end=earlier.loses_end)


def _read_part(name: str, store: Store) -> bytes | None:
    try:
        return store.read(name)
    except FormatError as error:
        logger.warning("a part of the map's history is lost: %s", error)
        return None


def _read_layers(entries: Iterable[LayerEntry], store: Store, path: str) -> Iterator[Layer]:
    """Yield the layers; many small files must not make many large grids."""
    cells = 0
    for entry in entries:
        layer = _read_layer(entry, store)
        if isinstance(layer, OccupancyLayer) and layer.cells is not None:
            cells += layer.cells.size
            check_cells(cells, f"layers of {cells} cells", path)
        yield layer


def _read_layer(entry: LayerEntry, store: Store) -> Layer:
    plugin = plugin_for(entry.class_name)
    if plugin is None:
        logger.warning(
            "layer %r has the unknown class %r; is its plug-in installed? Its files are kept as "
            "they are (known: %s)",
            entry.name,
            entry.class_name,
            ", ".join(installed_layers()),
        )
        return OpaqueLayer(
            entry.class_name,
            entry.name,
            entry.frame_id,
            load_file=entry.load_file,
            settings=entry.settings,
        )
    with blamed_on_plugin(entry.class_name, f"cannot read layer {entry.name!r}"):
        file = entry.settings.get(BINARY_FILE)
        if file is None:
            if not entry.load_file:
                return plugin.empty(entry.name, entry.frame_id, entry.settings)
            file = entry.settings["file"]
        return plugin.load(store, file, entry.name, entry.frame_id, entry.settings)


class _Claims:
    """A store that remembers which of its files were read."""

    def __init__(self, store: MemoryStore | FolderStore) -> None:
        self._store = store
        self.names: set[str] = set()
        self.write = store.write
        self.path_of = store.path_of
        self.folder = store.folder

    def read(self, name: str) -> bytes:
        content = self._store.read(name)
        self.names.add(safe_name(name))
        return content

    def left(self, file: str) -> list[str]:
        """Return the names of a layer's files that were not read."""
        return [name for name in self._store.names_of(file) if name not in self.names]


def _write_map(
    hypermap: Hypermap, config_name: str, semantic: SemanticForm, beside: str | None = None
) -> MemoryStore:
    """Return the files of a map, the configuration first, and the large ones in `beside`."""
    # A name stands for one content. Opaque layers cannot choose theirs, so they come first.
    taken: dict[str, bytes | None] = {config_name: None}
    for layer in hypermap.layers:
        if isinstance(layer, OpaqueLayer):
            if clash := _clash(layer.files, taken):
                raise HypermapError(
                    f"layer {layer.name!r} cannot be saved: another file is named {clash!r}"
                )
            taken.update(layer.files)
    store = MemoryStore({config_name: b""})
    entries = []
    for layer in hypermap.layers:
        entry, staged = _write_layer(layer, taken, semantic, beside)
        entries.append(entry)
        store.files.update(staged.files)
        store.large += staged.large
        taken.update(staged.files)
    metadata = dict(hypermap.metadata)
    others = dict(metadata.pop(OTHER_KEYS, {}))
    if (state := hypermap.mapper_state) is not None:
        numbered = (f"{MAPPER_STATE}_{number}" for number in itertools.count(2))
        names = itertools.chain([MAPPER_STATE], numbered)
        others[MAPPER_STATE] = next(name for name in names if name not in taken)
        store.files[others[MAPPER_STATE]] = state() if callable(state) else state
        taken[others[MAPPER_STATE]] = None
    if hypermap.history is not None:
        kept = history_files(hypermap.history, HistoryPolicy.of(hypermap.metadata))
        if clash := _clash(kept, taken):
            raise HypermapError(f"the history cannot be saved: another file is named {clash!r}")
        if kept:
            others[HISTORY] = list(kept)
        if (end := end_of(kept)) is not None:
            others[HISTORY_END] = end
        store.files.update(kept)
    config = MapConfig(entries, hypermap.frames, metadata, others)
    store.files[config_name] = dump_config(config)
    return store


def _write_layer(
    layer: Layer, taken: Mapping[str, bytes | None], semantic: SemanticForm, beside: str | None
) -> tuple[LayerEntry, MemoryStore]:
    """Return a layer's configuration and its files, whose names clash with no other."""
    if isinstance(layer, OpaqueLayer):
        entry = _entry(layer, layer.load_file, layer.settings)
        return entry, MemoryStore(layer.files)
    plugin = plugin_for(layer.class_name)
    if plugin is None:
        raise HypermapError(
            f"layer {layer.name!r} cannot be saved: no plug-in for its class "
            f"{layer.class_name!r} is installed (known: {', '.join(installed_layers())})"
        )
    chosen: LayerPlugin = SemanticFiles(semantic) if isinstance(plugin, SemanticFiles) else plugin
    for file in _file_names(layer):
        staged = MemoryStore(beside=beside)
        with blamed_on_plugin(layer.class_name, f"cannot write layer {layer.name!r}"):
            keys = chosen.save(layer, staged, file) or {}
        if not staged.files:
            return _entry(layer, False, layer.settings), staged
        if not _clash(staged.files, taken):
            settings = {**layer.settings, "file": file, **keys}
            return _entry(layer, BINARY_FILE not in keys, settings), staged
    raise HypermapError(f"layer {layer.name!r} cannot be saved: its files' names are all taken")


def _entry(layer: Layer, load_file: bool, settings: dict[str, Any]) -> LayerEntry:
    return LayerEntry(layer.class_name, layer.name, layer.frame_id, load_file, settings)


def _file_names(layer: Layer) -> Iterator[str]:
    """Yield what a layer's `file` may be: what it was, then names made from the layer's."""
    file = layer.settings.get("file")
    if isinstance(file, str):
        with contextlib.suppress(FormatError):
            yield safe_name(file)
    name = re.sub(r"[^\w.-]+", "_", layer.name).strip("._") or "layer"
    yield name
    yield from (f"{name}_{number}" for number in range(2, 100))


def _clash(files: Mapping[str, bytes], taken: Mapping[str, bytes | None]) -> str | None:
    """Return the first name that stands for another content already."""
    return next((n for n, content in files.items() if n in taken and taken[n] != content), None)
