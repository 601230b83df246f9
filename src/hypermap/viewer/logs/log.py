"""Where a map and its making are logged: to a file, or to a viewer while it runs."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.formats.atomic import file_beside
from hypermap.mapping.mapper import MappedFrame, Mapper

RERUN_SUFFIX, FOXGLOVE_SUFFIX = ".rrd", ".mcap"
SUFFIXES = (RERUN_SUFFIX, FOXGLOVE_SUFFIX)
_GRID_EVERY = 10  # frames; a grid is large, and changes little from one to the next


class MapLog(Protocol):
    """A log of a map and of its making."""

    def add_map(self, hypermap: Hypermap, stamp: float | None = None) -> None:
        """Log some or all layers of a map as they are at a time; None if they never change."""
        ...

    def add_frame(self, mapped: MappedFrame) -> None:
        """Log what the camera saw, from where, and what that says about the floor."""
        ...

    def close(self) -> None:
        """Finish."""
        ...


def open_log(target: str, name: str, frame_id: str = "map") -> MapLog:
    """Begin a log.

    Args:
        target: a file ending with .rrd or .mcap; or "rerun" to start Rerun's viewer, or "foxglove"
            to serve Foxglove and Lichtblick on this machine.
        name: what the program that shows it calls it.
        frame_id: frame of the cameras' poses.

    Raises:
        HypermapError: If the target is none of these, or cannot be written to.
        MissingExtra: If the library for it is not installed.
    """
    suffix = Path(target).suffix.lower()
    if suffix == RERUN_SUFFIX or target == "rerun":
        from hypermap.viewer.logs.rerun_log import RerunLog

        if not suffix:
            return RerunLog(None, name)
        return _LogFile(Path(target), lambda partial: RerunLog(partial, name))
    if suffix == FOXGLOVE_SUFFIX or target == "foxglove":
        from hypermap.viewer.logs.foxglove_log import FoxgloveLog

        if not suffix:
            return FoxgloveLog(None, name, frame_id)
        return _LogFile(Path(target), lambda partial: FoxgloveLog(partial, name, frame_id))
    raise HypermapError(
        f"{target}: a log is a file ending with .rrd (Rerun) or .mcap (Foxglove), or `rerun` or "
        "`foxglove` to watch the map being made"
    )


class _LogFile:
    """A log in a file, which replaces an older one when it is finished."""

    def __init__(self, path: Path, begin: Callable[[Path], MapLog]) -> None:
        self._path = path
        with contextlib.ExitStack() as opening:
            self._log = begin(opening.enter_context(file_beside(path)))
            self._file = opening.pop_all()
        self.add_map = self._log.add_map
        self.add_frame = self._log.add_frame

    def close(self) -> None:
        """Finish the file.

        Raises:
            HypermapError: If all of it could not be written; the old one stays then.
        """
        with self._file:
            try:
                self._log.close()
            except (OSError, RuntimeError) as error:  # whose texts lack the system's message
                raise HypermapError(
                    f"{self._path}: the log could not be written; is the disk full? ({error})"
                ) from None


class LoggedMapping:
    """Watches a mapper, and logs each frame and the map as it is then."""

    def __init__(self, log: MapLog) -> None:
        """Log there."""
        self._log = log
        self._frames = 0

    def __call__(self, mapped: MappedFrame, mapper: Mapper) -> None:
        """Log a frame that was mapped."""
        stamp = mapped.frame.stamp
        self._log.add_frame(mapped)
        occupancy = mapper.occupancy()
        objects = mapper.evidence.layer(frame_id=occupancy.frame_id, is_final=False)
        layers = [occupancy, objects] if self._frames % _GRID_EVERY == 0 else [objects]
        self._log.add_map(Hypermap(layers), stamp)
        self._frames += 1
