"""What other packages offer: objects that they register as entry points in a group."""

from __future__ import annotations

import signal
from importlib import metadata

from hypermap.core.errors import HypermapError

_BY_SIGNAL = tuple(128 + number for number in signal.valid_signals())  # exit codes


def installed(group: str) -> list[str]:
    """Return the names in a group, in alphabetical order."""
    return sorted({entry.name for entry in metadata.entry_points(group=group)})


def entry_point(group: str, name: str) -> metadata.EntryPoint | None:
    """Return the entry point of a name in a group; None if there is none.

    Raises:
        HypermapError: If packages offer different objects of this name: nobody could tell which of
            them has been used.
    """
    found = {entry.value: entry for entry in metadata.entry_points(group=group, name=name)}
    if len(found) > 1:
        both = " and ".join(_source(entry) for entry in found.values())
        raise HypermapError(f"{both} have the same name {name!r} in {group}; uninstall one of them")
    return next(iter(found.values()), None)


def is_packages_fault(error: BaseException) -> bool:
    """Return whether it is the fault of a package that its code has raised an exception.

    Packages may raise anything, and even end the program by `sys.exit`. Not their fault are a full
    memory, and signals, by which the user ends the program.
    """
    if isinstance(error, SystemExit):
        return not (isinstance(error.code, int) and error.code in _BY_SIGNAL)
    return not isinstance(error, (KeyboardInterrupt, MemoryError))


def in_words(error: BaseException) -> str:
    """Return an exception of another package as part of a message."""
    kind, why = type(error).__name__, str(error)
    return f"{kind}: {why}" if why else kind


def _source(entry: metadata.EntryPoint) -> str:
    package = "" if entry.dist is None else f" of {entry.dist.name}"
    return f"{entry.value}{package}"
