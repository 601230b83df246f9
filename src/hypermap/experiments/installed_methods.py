"""Mapping methods of other packages, which register them as entry points `hypermap.methods`."""

from __future__ import annotations

import copy
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import Any, Protocol, TypeAlias

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.entry_points import entry_point, in_words, installed, is_packages_fault
from hypermap.mapping.config import MappingConfig
from hypermap.perception.frame import RgbdFrame

ENTRY_POINT_GROUP = "hypermap.methods"


class MethodFailed(HypermapError):
    """A method of a package has failed on a drive."""


class MappingRun(Protocol):
    """A method of a package at work on one drive."""

    def add(self, frame: RgbdFrame) -> None:
        """Map the next frame; it has images, a pose and `detections`, and is the run's own."""

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

    def start(self, occupancy: OccupancyLayer, drive: str) -> MappingRun:
        """Return a new run.

        Whatever goes wrong in the package is an error that names the method and the drive, so that
        it can travel from one process to another.

        Args:
            occupancy: the map of the drive, which is read-only.
            drive: what errors call it.

        Raises:
            MethodFailed: If the package fails to.
        """
        starts_run: StartsRun = _loaded(_found(self.name))
        with _named(self, "cannot start", drive):
            run = starts_run(occupancy)
        for needed in ("add", "objects"):
            if not callable(getattr(run, needed, None)):
                missing = f"its {type(run).__name__} has no method {needed}()"
                raise _cannot(self.name, self.source, missing)
        return _NamedRun(self, run, drive)


@contextmanager
def _named(method: InstalledMethod, what: str, drive: str) -> Iterator[None]:
    """Turn what a package raises into a MethodFailed."""
    try:
        yield
    except BaseException as error:
        if not is_packages_fault(error):
            raise
        last = traceback.extract_tb(error.__traceback__)[-1]
        why = f"{what} on {drive}: {in_words(error)} (line {last.lineno} of {last.filename})"
        raise _cannot(method.name, method.source, why) from error


@dataclass(frozen=True)
class _NamedRun:
    """A run whose errors name the method.

    Attributes:
        method: the method.
        run: the package's.
        drive: what errors call it.
    """

    method: InstalledMethod
    run: MappingRun
    drive: str

    def add(self, frame: RgbdFrame) -> None:
        """Map the next frame, of which the package may change what it likes: it is a copy."""
        with _named(self.method, f"add() failed at {frame.stamp:g} s", self.drive):
            self.run.add(copy.deepcopy(frame))

    def objects(self) -> Sequence[SemanticObject]:
        """Return the objects of the map so far."""
        with _named(self.method, "objects() failed", self.drive):
            found: list[object] = list(self.run.objects())
        for one in found:
            if not isinstance(one, SemanticObject):
                why = f"objects() must give SemanticObjects, gave {type(one).__name__}"
                raise _cannot(self.method.name, self.method.source, why)
        return [one for one in found if isinstance(one, SemanticObject)]


def installed_names() -> list[str]:
    """Return the names of all methods that are installed, in alphabetical order."""
    return installed(ENTRY_POINT_GROUP)


def installed_method(name: str) -> MappingConfig | InstalledMethod:
    """Return a method that is installed: its configuration, or its code.

    Raises:
        HypermapError: If there is none of that name, or several, it cannot be loaded, or it is
            neither.
    """
    entry = _found(name)
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


def _found(name: str) -> EntryPoint:
    found = entry_point(ENTRY_POINT_GROUP, name)
    if found is None:
        hint = did_you_mean(name, installed_names())
        raise HypermapError(
            f"--method {name}: no such method is installed; {hint}; "
            "a configuration is a file, NAME.yaml"
        )
    return found


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except BaseException as error:
        if not is_packages_fault(error):
            raise
        raise _cannot(entry.name, entry.value, f"cannot be loaded: {in_words(error)}") from error


def _cannot(name: str, source: str, why: str) -> MethodFailed:
    return MethodFailed(f"method {name!r} ({source}): {why}")
