"""The history of a map: which objects changed, in which version, when and why."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from hypermap.core.semantic import SemanticLayer, SemanticObject

MAP_ID, MAP_VERSION = "map_id", "map_version"
"""Where a map's metadata hold its id, and a number that counts up with its changes."""

EARLIEST = 1e8
"""Seconds since 1970; smaller stamps count from the start of something else, such as a program."""

_AHEAD = 86_400  # s by which a clock may be ahead of ours
_PROBABLE = 0.5  # least confidence of an object that came or went

ADDED, GONE, EXPIRED = "added", "gone", "expired"
MOVED, RESHAPED, RENAMED, EDITED = "moved", "reshaped", "renamed", "edited"
FIRST_SEEN, NOT_REVISITED = "first seen", "not revisited"
CORRECTED = "corrected"
KINDS = (
    *(ADDED, GONE, EXPIRED, MOVED, RESHAPED, RENAMED, EDITED, FIRST_SEEN, NOT_REVISITED),
    CORRECTED,
)
"""Kinds of changes. "first seen" and "not revisited" are of places that only one of two maps knows.
What an earlier drive has detected, though too seldom, also is "first seen" when it comes onto the
map. What is "corrected" has not moved: it is elsewhere on the map because poses were corrected."""

Cause = Literal["mapping", "edit"]
"""What made a revision: frames that were mapped, or a person or a program that changed objects."""


def latest_time() -> float:
    """Return the latest time [s] that a clock which is right may have shown, since 1970.

    That is infinite if our own clock is not set, as that of a robot without a battery for it.
    """
    now = time.time()
    return now + _AHEAD if now >= EARLIEST else math.inf


@dataclass(frozen=True, eq=False)
class Change:
    """One object that changed.

    Attributes:
        kind: one of `KINDS`.
        layer: name of its layer.
        before: the object before; None if it was not there.
        after: the object after; None if it is not there any more.
        distance: between the centroids [m]; None unless it was there before and after.
        confidence: how likely the two are one object, 0..1, if it was moved; how likely it is, or
            was, there, if mapping has added it or found it gone; None for other changes.
    """

    kind: str
    layer: str
    before: SemanticObject | None
    after: SemanticObject | None
    distance: float | None = None
    confidence: float | None = None

    @property
    def object(self) -> SemanticObject:
        """The object as it is now, or as it was."""
        found = self.after or self.before
        assert found is not None
        return found

    @property
    def is_doubtful(self) -> bool:
        """Whether it is about an object that probably did not come or go, or never was there."""
        is_likely = self.confidence is None or self.confidence >= _PROBABLE
        return self.kind != MOVED and not is_likely

    @property
    def names(self) -> set[str]:
        """Its name; if it was renamed, both."""
        return {one.name for one in (self.before, self.after) if one is not None}


@dataclass(frozen=True, eq=False)
class Revision:
    """What changed from one version of a map to the next.

    Attributes:
        version: of the map after it.
        time: when, in seconds since 1970; None where the recording's clock does not say it.
        cause: what made it.
        drive: name of the recording; empty for edits.
        changes: of objects; may be empty.
        follows_loss: whether revisions right before this one are lost.
        begins: whether it is the first one of a map, though its version is later, as that of a
            live node which has saved several times.
    """

    version: int
    time: float | None
    cause: Cause
    drive: str
    changes: tuple[Change, ...]
    follows_loss: bool = False
    begins: bool = False

    @property
    def is_beginning(self) -> bool:
        """Whether it is the first one of a map made by mapping."""
        return (self.version == 1 or self.begins) and self.cause == "mapping"

    def worth_showing(self) -> list[Change]:
        """Return the changes that people are shown: without doubtful ones, but for the first."""
        return [one for one in self.changes if self.is_worth_showing(one)]

    def is_worth_showing(self, change: Change) -> bool:
        """Return whether people are shown one of its changes, as it is or in another frame."""
        return self.is_beginning or not change.is_doubtful


@dataclass(frozen=True)
class Mapped:
    """The frames that a map was just made from, which its next revision names.

    Attributes:
        drive: name of the recording.
        time: stamp of its last frame in seconds since 1970; None if its clock does not say it.
        doubt: returns how likely it is that an object which seems to have come or gone did not,
            0..1; None if that is unknown.
        shifts: by how much corrected poses have shifted each object, in x and y [m], by its id;
            None if no poses of earlier frames were corrected.
    """

    drive: str
    time: float | None
    doubt: Callable[[Change], float] | None = None
    shifts: Mapping[int, tuple[float, float]] | None = None


@dataclass(frozen=True, eq=False)
class History:
    """The log of a map, which only grows. Saving adds what has changed since.

    Attributes:
        earlier: returns the revisions in the map's file, oldest first; None for none.
        added: the revisions after those.
        version: of the map after the last revision.
        layers: copies of the semantic layers as they were then, by name.
        mapped: what the map was made from since; None if it was not.
        loses_end: returns whether the last of the earlier revisions are lost; None if none is.
    """

    earlier: Callable[[], Sequence[Revision]] | None = None
    added: tuple[Revision, ...] = ()
    version: int = 0
    layers: Mapping[str, SemanticLayer] = field(default_factory=dict)
    mapped: Mapped | None = None
    loses_end: Callable[[], bool] | None = None

    @property
    def is_end_lost(self) -> bool:
        """Whether what changed last is lost, so that nothing before it is known."""
        return not self.added and self.loses_end is not None and self.loses_end()

    def revisions(self) -> list[Revision]:
        """Return all revisions, oldest first."""
        added = self.added
        if added and self.loses_end is not None and self.loses_end():
            added = (replace(added[0], follows_loss=True), *added[1:])
        return [*(self.earlier() if self.earlier is not None else ()), *added]

    def dated(self) -> Iterator[tuple[float, Revision]]:
        """Yield each revision with the time from which on it was in force, oldest first.

        A recording may be mapped after later ones. As times never fall in a layer, its changes are
        in force from the time of what was there already; other layers, such as rooms, do not delay
        them. One whose clock gives no time, or was far ahead of ours, comes after all before it.
        Before the first known time it is -inf.
        """
        latest, end = -math.inf, latest_time()
        of_layers: dict[str, float] = {}
        for revision in self.revisions():
            layers = {change.layer for change in revision.changes}
            if revision.time is not None and revision.time <= end:
                latest = max(latest, revision.time)
                known = [of_layers[name] for name in layers & of_layers.keys()]
                begins = max([revision.time, *known])
            else:
                begins = latest
            of_layers |= dict.fromkeys(layers, begins)
            yield begins, revision
