"""The evidence for the objects of an answer, for `--evidence`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from hypermap.console.answer import aligned
from hypermap.console.questions import Row
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.questions.times import are_calendar, time_of
from hypermap.text import counted, printable

DescribeEvidence: TypeAlias = Callable[[Hypermap, str, int], dict[str, Any]]
"""From a map, a layer and an object's id to the evidence for it, as `viewer` describes it."""

FUSED = ["method", "area in m²", "IoU"]
"""The columns about each method's shape; all but the first are numbers."""

_DRIVES = 3600.0  # [s] between observations that are hardly of one drive
_MOST = 20  # objects whose evidence is shown as text; --json has all


@dataclass(frozen=True)
class Summary:
    """What people see of the evidence for one object.

    Attributes:
        title: which object.
        text: what was seen of it, or why that is not known.
        fused: the shapes that the methods make of it, in the columns `FUSED`.
    """

    title: str
    text: str
    fused: list[list[str]] = field(default_factory=list)


def add_evidence(
    hypermap: Hypermap, rows: Sequence[Row], describe_evidence: DescribeEvidence
) -> None:
    """Give each row of an object the key `evidence`: what `describe_evidence` says of it.

    Raises:
        HypermapError: If there are rows, but none is of an object.
    """
    objects = [row for row in rows if "object" in row]
    if rows and not objects:
        raise HypermapError(
            "--evidence shows the observations of objects; choose some with --name, --id or --in"
        )
    for row in objects:
        answer = describe_evidence(hypermap, row["layer"], row["object"]["id"])
        row["evidence"] = {k: v for k, v in answer.items() if k not in ("layer", "id", "name")}


def summaries(rows: Sequence[Row]) -> list[Summary]:
    """Return what is shown of the evidence in the rows of an answer."""
    return [_summary_of(row) for row in [row for row in rows if "evidence" in row][:_MOST]]


def left_out(rows: Sequence[Row]) -> str:
    """Return a line about the objects that `summaries` leaves out; empty if there are none."""
    more = sum("evidence" in row for row in rows) - _MOST
    return f"and {counted(more, 'more object')}; --json lists all" if more > 0 else ""


def plain_evidence(rows: Sequence[Row]) -> str:
    """Return the evidence for the objects of an answer as lines."""
    lines: list[str] = []
    for one in summaries(rows):
        lines += ["", one.title, one.text]
        lines += aligned([FUSED, *one.fused], texts=1) if one.fused else []
    return "\n".join([*lines, left_out(rows)]).rstrip("\n")


def _summary_of(row: Row) -> Summary:
    evidence = row["evidence"]
    title = f"{printable(row['label'])} {row['value']} of {printable(row['layer'])}"
    if not evidence["observations"]:
        return Summary(title, evidence["reason"])
    fused = [
        [
            one["method"] + (" (made the map)" if one["is_own"] else ""),
            f"{one['area']:.3f}",
            f"{one['jaccard']:.0%}",
        ]
        for one in evidence["fused"]
    ]
    return Summary(title, _seen(evidence), fused)


def _seen(evidence: dict[str, Any]) -> str:
    kept = evidence["observations"]
    scores = [seen["score"] for seen in kept]
    text = f"seen {counted(evidence['seen'], 'time')}, {len(kept)} kept"
    text += f", mean score {sum(scores) / len(scores):.2f}"
    first, last, start = (evidence[key] for key in ("first_seen", "last_seen", "start"))
    if first is not None and last is not None:
        if last - start >= _DRIVES and are_calendar([last]):
            return f"{text}, from {time_of(first)} to {time_of(last)}"
        text += f", from {first - start:.1f} s to {last - start:.1f} s of the recording"
    return text
