"""How an answer is shown: its rows and columns, or JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from hypermap.console.questions import Answered, Row
from hypermap.core.hypermap import Hypermap
from hypermap.text import counted, decimal, printable

_MOST_ROWS = 50


@dataclass(frozen=True)
class Shown:
    """What people see of an answer; programs take the rows themselves.

    Attributes:
        columns: their names.
        texts: how many of them, the first, hold texts; the others hold numbers.
        rows: the first of them, as texts.
        counts: a line for each layer of cells that are counted.
        left_out: how many rows more there are.
    """

    columns: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    counts: list[str] = field(default_factory=list)
    left_out: int = 0
    texts: int = 2


def shown(answered: Answered) -> Shown:
    """Return what is shown of an answer."""
    rows, query = answered.rows, answered.answer.query
    if not rows:
        return Shown()
    # Of an area alone, a grid would show every cell.
    is_at_point = any(one.reference.point_xy is not None for one in query.where)
    is_some = query.names or query.ids or query.value is not None or query.give == "places"
    cells_are_counted = not (is_some or is_at_point)

    def is_counted(row: Row) -> bool:
        return not _is_thing(row) and (cells_are_counted or "cells" in row)

    of_cells = [row for row in rows if is_counted(row)]
    listed = [row for row in rows if not is_counted(row)] if of_cells else rows
    cells: Counter[tuple[str, str]] = Counter()
    for row in of_cells:
        if "unit" not in row:
            cells[row["layer"], row["label"]] += row.get("cells", 1)
    optional = ("deviation", "distance", "similarity", "area")
    numbers = ["value", "x", "y", *(key for key in optional if any(key in row for row in listed))]
    also = (key for key in ("room", "measured", "last_seen") if any(key in row for row in listed))
    names = ("layer", "label", *also)
    texts = [
        [*(_text(row.get(key)) for key in names), *(_number(row.get(key)) for key in numbers)]
        for row in listed[:_MOST_ROWS]
    ]
    counts = [f"{printable(on)}: {count} {printable(what)}" for (on, what), count in cells.items()]
    counts += _ranges([row for row in of_cells if "unit" in row])
    more = max(0, len(listed) - _MOST_ROWS)
    columns = [name.replace("_", " ") for name in (*names, *numbers)]
    return Shown(columns, texts, counts, more, len(names))


def _is_thing(row: Row) -> bool:
    """Return whether a row is about an object or a note, not about a cell."""
    return "object" in row or "note" in row


def _ranges(rows: Sequence[Row]) -> list[str]:
    """Return a line for each layer of measured values: mean, smallest and largest."""
    lines = []
    for layer in dict.fromkeys(row["layer"] for row in rows):
        known = [row for row in rows if row["layer"] == layer and row["value"] is not None]
        if not known:
            lines.append(f"{printable(layer)}: no value")
            continue
        known.sort(key=lambda row: float(row["value"]))
        mean, count = sum(row["value"] for row in known) / len(known), len(known)
        least, most = known[0]["label"], known[-1]["label"]
        if "cells" in known[0]:  # it stands for all
            least, most = (f"{known[0][key]:.4g} {known[0]['unit']}" for key in ("min", "max"))
            count = known[0]["cells"]
        about = f"{mean:.5g} on average, {printable(least)} to {printable(most)}"
        lines.append(f"{printable(layer)}: {about}, in {counted(count, 'cell')}")
    return lines


def plain(answer: Shown) -> str:
    """Return an answer as lines with aligned columns."""
    lines = aligned([answer.columns, *answer.rows], answer.texts) if answer.rows else []
    more = [f"and {answer.left_out} more; --json lists all"] if answer.left_out else []
    return "\n".join([*lines, *more, *answer.counts])


def aligned(table: Sequence[Sequence[str]], texts: int) -> list[str]:
    """Return a line for each row: the first `texts` columns left-aligned, others right-aligned."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for row in table:
        cells = [
            cell.ljust(width) if i < texts else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells))
    return lines


def document(source: str | None, hypermap: Hypermap, rows: Sequence[Row]) -> dict[str, Any]:
    """Return an answer as programs take it, for JSON; `source` is where the map comes from."""
    return {"map": source, "frame_id": hypermap.base_frame, "answers": list(rows)}


def _text(value: Any) -> str:
    """Return a text, the name of a room, a measured value, or nothing."""
    if isinstance(value, dict):
        value = value["name"] if "name" in value else value["label"]
    return "" if value is None else printable(value)


def _number(value: object) -> str:
    """Return a number to the millimeter, whole ones as they are."""
    return decimal(value, 3) if isinstance(value, float) else "-" if value is None else str(value)
