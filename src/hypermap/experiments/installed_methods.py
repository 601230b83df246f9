"""Mapping methods of other packages, which register them as entry points `hypermap.methods`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Protocol, TypeAlias

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.mapping.config import MappingConfig
from hypermap.perception.frame import RgbdFrame

ENTRY_POINT_GROUP = "hypermap.methods"


class MappingRun(Protocol):
    """A method of a package at work on one drive."""

    def add(self, frame: RgbdFrame) -> None:
        """Map the next frame; it has images, a pose and `detections`."""

    def objects(self) -> Sequence[SemanticObject]:
        """Return the objects of the map so far, in the frame of the poses."""


StartsRun: TypeAlias = Callable[[OccupancyLayer], MappingRun]
"""Starts a run on a drive whose occupancy map is known."""


@dataclass(frozen=True)
class InstalledMethod:
    """A method of a package that is code, and not a configuration.

    It is known by its name alone, so that other processes can load it, too.

    Attributes:
        name: of the entry point.
        source: where its code is, as in `my_package.greedy:Greedy`.
        version: of the package.
    """

    name: str
    source: str
    version: str

    def start(self, occupancy: OccupancyLayer) -> MappingRun:
        """Return a new run.

        Raises:
            HypermapError: If the package fails to; names the method.
        """
        starts_run: StartsRun = _loaded(_installed()[self.name])
        try:
            run = starts_run(occupancy)
        except (HypermapError, MemoryError):
            raise
        except Exception as error:
            raise _cannot(self.name, self.source, f"cannot start: {_words(error)}") from error
        for needed in ("add", "objects"):
            if not callable(getattr(run, needed, None)):
                missing = f"its {type(run).__name__} has no method {needed}()"
                raise _cannot(self.name, self.source, missing)
        return run


def checked_objects(name: str, objects: Iterable[object]) -> tuple[SemanticObject, ...]:
    """Return the objects of a method's map.

    Raises:
        HypermapError: If one is something else; names the method.
    """
    found = []
    for one in objects:
        if not isinstance(one, SemanticObject):
            kind = type(one).__name__
            raise HypermapError(
                f"method {name!r}: objects() must give SemanticObjects, gave {kind}"
            )
        found.append(one)
    return tuple(found)


def installed_names() -> list[str]:
    """Return the names of all methods that are installed, in alphabetical order."""
    return sorted(_installed())


def installed_method(name: str) -> MappingConfig | InstalledMethod:
    """Return a method that is installed: its configuration, or its code.

    Raises:
        HypermapError: If there is none of that name, it cannot be loaded, or it is neither.
    """
    known = _installed()
    if name not in known:
        raise HypermapError(
            f"--method {name}: no such method is installed; {did_you_mean(name, known)}; "
            "a configuration is a file, NAME.yaml"
        )
    entry = known[name]
    loaded = _loaded(entry)
    if isinstance(loaded, MappingConfig):
        return loaded
    if callable(loaded):
        version = entry.dist.version if entry.dist is not None else ""
        return InstalledMethod(name, entry.value, version)
    raise _cannot(
        name,
        entry.value,
        "expected a MappingConfig, or a class or function that starts a run from an occupancy "
        f"layer, found {type(loaded).__name__}",
    )


def _installed() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=ENTRY_POINT_GROUP)}


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except (HypermapError, MemoryError):
        raise
    except Exception as error:
        raise _cannot(entry.name, entry.value, f"cannot be loaded: {_words(error)}") from error


def _cannot(name: str, source: str, why: str) -> HypermapError:
    return HypermapError(f"method {name!r} ({source}): {why}")


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
