"""What is known of objects that are not on the map any more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from hypermap.core.history import EARLIEST, Change, Revision
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.history import placed, version_of
from hypermap.questions.times import time_of
from hypermap.text import printable


@dataclass(frozen=True, eq=False)
class Departed:
    """The last object of a name that left a map.

    Attributes:
        object: as it was on the map, in the base frame.
        revision: without it.
        version: of the map that last had it; None if that is not known.
    """

    object: SemanticObject
    revision: Revision
    version: int | None

    def sentence(self, more: str = "") -> str:
        """Return until when it was on the map, with more on that, and when it was seen, and where.

        >>> import shapely
        >>> cup = SemanticObject("cup", shapely.box(0, 0, 1, 1))
        >>> Departed(cup, Revision(4, None, "edit", "", ()), 3).sentence(" (--as-of v3)")
        "'cup' was on the map until v4 (--as-of v3)"
        """
        name = printable(self.object.name)
        said = f"{name!r} was on the map until {when(self.revision)}{more}"
        seen, center = self.object.last_seen, self.object.footprint.centroid
        if seen is None or seen < EARLIEST:
            return said
        return f"{said}; last seen {time_of(seen)} at ({center.x:.2f}, {center.y:.2f})"


def departed(hypermap: Hypermap, is_meant: Callable[[str], bool]) -> Departed | None:
    """Return the last object that left a map, and of several the one seen last.

    None if none did, as far as the map's history knows.

    Args:
        hypermap: the map.
        is_meant: returns whether an object of a name counts.
    """
    found: Departed | None = None
    previous: int | None = None
    dated = () if hypermap.history is None else hypermap.history.dated()
    now = version_of(hypermap)  # it may be a map as it was
    for _, revision in dated:
        if revision.version > now:
            continue
        gone = [change for change in revision.changes if _takes_away(change, is_meant)]
        if revision.follows_loss:  # of what was before it, the version right before is known alone
            found = None if found is None else replace(found, version=None)
            previous = None if previous is None else revision.version - 1
        if gone:
            last = max(gone, key=lambda one: _was(one).last_seen or 0.0)
            found = Departed(_was(placed(hypermap, last)), revision, previous)
        previous = revision.version
    return found


def when(revision: Revision) -> str:
    """Return when a version was made, as people write it; else its number."""
    return f"v{revision.version}" if revision.time is None else time_of(revision.time)


def names_before(hypermap: Hypermap) -> set[str]:
    """Return the names that objects of a map have or had, as far as its history knows."""
    revisions = () if hypermap.history is None else hypermap.history.revisions()
    changes = [change for revision in revisions for change in revision.changes]
    return {name for one in changes if one.layer != ROOMS for name in one.names}


def _takes_away(change: Change, is_meant: Callable[[str], bool]) -> bool:
    """Return whether a change takes an object away, or gives it a name that is not meant."""
    was, now = change.before, change.after
    return was is not None and is_meant(was.name) and (now is None or not is_meant(now.name))


def _was(change: Change) -> SemanticObject:
    """Return an object as it was before a change."""
    assert change.before is not None
    return change.before
