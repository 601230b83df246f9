"""The kinds of layers: built-in ones, and those of other packages."""

from __future__ import annotations

import contextlib
import functools
import importlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Protocol, cast

from hypermap.core.errors import HypermapError
from hypermap.core.layer import Layer, Store

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINT_GROUP = "hypermap.layers"

_OURS = {
    "OccupancyGridLayer": "hypermap.formats.grid.map_server:PLUGIN",
    "SemanticLayer": "hypermap.formats.semantic.yaml_files:PLUGIN",
    "ValueLayer": "hypermap.formats.grid.value_files:PLUGIN",
    "NotesLayer": "hypermap.formats.notes_files:PLUGIN",
}


class LayerPlugin(Protocol):
    """One kind of layer and its files.

    A package offers one by an entry point in the group `hypermap.layers`, whose name is the
    class name in configuration files and whose value is an object (or module) with these members.
    """

    def empty(self, name: str, frame_id: str, settings: Mapping[str, Any]) -> Layer:
        """Return an empty layer."""
        ...

    def load(
        self, store: Store, file: str, name: str, frame_id: str, settings: Mapping[str, Any]
    ) -> Layer:
        """Return the layer in `file`, the value of that key in the configuration.

        Raises:
            FormatError: If the files do not contain such a layer.
        """
        ...

    def save(self, layer: Any, store: Store, file: str) -> Mapping[str, Any] | None:
        """Write what `load` reads; the same layer gives the same bytes each time.

        It may return keys for the layer's configuration, which `load` gets in `settings`.

        An empty layer may write nothing: then it is saved with `load_file: false`,
        and opened by `empty`. Other layers may overwrite names other than `file`, `file.*` and
        `file/*`.
        """
        ...


def plugin_for(class_name: str) -> LayerPlugin | None:
    """Return the plug-in for a kind of layer; None if none is installed.

    Raises:
        HypermapError: If the plug-in is installed, but does not work, or several are.
    """
    if class_name in _OURS:  # nobody can replace ours, so no search is needed
        return _ours(class_name)
    from hypermap.entry_points import entry_point  # looks into all packages, which takes a while

    found = entry_point(ENTRY_POINT_GROUP, class_name)
    return None if found is None else _load(found)


@contextlib.contextmanager
def blamed_on_plugin(class_name: str, work: str) -> Iterator[None]:
    """Attribute exceptions of another package to that package.

    Args:
        class_name: the kind of layer.
        work: what it is to do, as "cannot read layer 'x'".

    Raises:
        HypermapError: If another package's plug-in raises an exception of its own.
    """
    try:
        yield
    except (HypermapError, OSError):
        raise
    except BaseException as error:
        if class_name in _OURS:
            raise
        from hypermap.entry_points import in_words, is_packages_fault

        if not is_packages_fault(error):
            raise
        raise HypermapError(
            f"the plug-in for layers of class {class_name!r} {work}: {in_words(error)}"
        ) from error


def installed_layers() -> tuple[str, ...]:
    """Return the class names of all kinds of layers that can be read, ours first."""
    from hypermap.entry_points import installed

    return (*_OURS, *(name for name in installed(ENTRY_POINT_GROUP) if name not in _OURS))


def _ours(class_name: str) -> LayerPlugin:
    module, _, name = _OURS[class_name].partition(":")
    return cast(LayerPlugin, getattr(importlib.import_module(module), name))


@functools.cache
def _load(entry_point: EntryPoint) -> LayerPlugin:
    from hypermap.entry_points import in_words, is_packages_fault

    name, value = entry_point.name, entry_point.value
    try:
        plugin = entry_point.load()
    except BaseException as error:
        if not is_packages_fault(error):
            raise
        raise HypermapError(
            f"the plug-in for layers of class {name!r} ({value}) cannot be imported: "
            f"{in_words(error)}; update its package, or uninstall it: then the other layers can be "
            "used, and these are kept as they are"
        ) from error
    missing = [verb for verb in ("empty", "load", "save") if not callable(getattr(plugin, verb, 0))]
    if missing:
        raise HypermapError(
            f"the plug-in for layers of class {name!r} ({value}) has no function {missing[0]!r}"
        )
    return cast(LayerPlugin, plugin)
