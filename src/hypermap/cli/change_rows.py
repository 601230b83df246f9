"""One change of an object in tables and in JSON."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from hypermap.text import decimal, printable

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hypermap.core.history import Change, Revision
    from hypermap.core.semantic import SemanticObject


def named(change: Change) -> str:
    """Return what changed, as tables show it."""
    names = dict.fromkeys(one.name for one in (change.before, change.after) if one is not None)
    name = printable(" → ".join(names), 80)
    return name if change.layer == "semantic" else f"{name} ({printable(change.layer, 40)})"


def place_of(thing: SemanticObject | None) -> str:
    """Return where an object is [m]."""
    if thing is None:
        return "-"
    center = thing.footprint.centroid
    return f"{decimal(center.x)}, {decimal(center.y)}"


def distance_of(change: Change) -> str:
    """Return how far an object was moved, and how likely it is the same.

    Of one that is elsewhere because poses were corrected, only how far; of one that came or went,
    only how likely it is, or was, there, if that is doubtful.
    """
    if change.kind == "corrected" and change.distance is not None:
        return f"{change.distance:.2f} m"
    if change.confidence is None:
        return ""
    sure = f"({change.confidence:.0%})"
    if change.kind == "moved" and change.distance is not None:
        return f"{change.distance:.2f} m {sure}"
    return sure if change.is_doubtful else ""


def counts_of(changes: Iterable[Change]) -> str:
    """Return how many changes there are of each kind, as a sentence has it; empty for none.

    Of what only stands elsewhere on the map because poses were corrected, also how far on average.
    """
    found = list(changes)
    said = [f"{n} {kind}" for kind, n in Counter(one.kind for one in found).items()]
    by = mean_distance(one for one in found if one.kind == "corrected")
    return ", ".join(f"{one} by {by}" if one.endswith(" corrected") else one for one in said)


def summary_of(revision: Revision) -> str:
    """Return how much a version changed, as a sentence has it; empty for nothing."""
    sure = revision.worth_showing()
    doubtful = len(revision.changes) - len(sure)
    return ", ".join(filter(None, [counts_of(sure), f"{doubtful} doubtful" if doubtful else ""]))


def mean_distance(changes: Iterable[Change]) -> str:
    """Return how far apart things were before and after, on average; empty if none was."""
    found = [one.distance for one in changes if one.distance is not None]
    return f"{sum(found) / len(found):.2f} m" if found else ""


def described(change: Change) -> dict[str, Any]:
    """Return a change as JSON values."""
    row: dict[str, Any] = {"change": change.kind, "layer": change.layer}
    for when, thing in (("before", change.before), ("after", change.after)):
        if thing is not None:
            center = thing.footprint.centroid
            row[when] = {"id": thing.id, "name": thing.name, "x": center.x, "y": center.y}
    values = {"distance": change.distance, "confidence": change.confidence}
    return row | {key: value for key, value in values.items() if value is not None}
