"""What is behind the objects of an answer, for `hypermap query --evidence`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hypermap.cli.terminal import out, say, table
from hypermap.core.errors import HypermapError
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.console.questions import Row
    from hypermap.core.hypermap import Hypermap

_MOST = 20  # objects that are looked behind as text; --json has all


def add_evidence(hypermap: Hypermap, rows: list[Row]) -> None:
    """Give each row of an object the key `evidence`: see `describe_evidence`.

    Raises:
        HypermapError: If there are rows, but none is of an object.
    """
    from hypermap.viewer.live.object_evidence import describe_evidence

    objects = [row for row in rows if "object" in row]
    if rows and not objects:
        raise HypermapError("--evidence looks behind objects; ask for some by --name, --id or --in")
    for row in objects:
        answer = describe_evidence(hypermap, row["layer"], row["object"]["id"])
        row["evidence"] = {k: v for k, v in answer.items() if k not in ("layer", "id", "name")}


def show_evidence(rows: list[Row]) -> None:
    """Print what is behind the objects of an answer."""
    objects = [row for row in rows if "evidence" in row]
    for row in objects[:_MOST]:
        evidence = row["evidence"]
        say(
            f"\n{printable(row['label'])} {row['value']} of {printable(row['layer'])}", style="bold"
        )
        if not evidence["observations"]:
            say(evidence["reason"])
            continue
        say(_summary(evidence))
        grid = table("method", "area in m²", "alike", right=("area in m²", "alike"))
        for fused in evidence["fused"]:
            made = " (made the map)" if fused["is_own"] else ""
            grid.add_row(fused["method"] + made, f"{fused['area']:.3f}", f"{fused['jaccard']:.0%}")
        out().print(grid)
    if len(objects) > _MOST:
        say(f"and {len(objects) - _MOST} more objects; --json lists all")


def _summary(evidence: dict[str, Any]) -> str:
    kept = evidence["observations"]
    scores = [seen["score"] for seen in kept]
    text = f"seen {counted(evidence['seen'], 'time')}, {len(kept)} kept"
    text += f", mean score {sum(scores) / len(scores):.2f}"
    first, last, start = (evidence[key] for key in ("first_seen", "last_seen", "start"))
    if first is not None and last is not None:
        text += f", from {first - start:.1f} s to {last - start:.1f} s of the recording"
    return text
