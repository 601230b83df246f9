"""The legend next to a map: a block per layer, with the classes of its objects counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from hypermap.text import natural, printable
from hypermap.viewer.paper import (
    FAINT,
    INK,
    NOTE,
    SHAPE_ALPHA,
    SMALL,
    fill_style,
    line_style,
    text_width,
)

if TYPE_CHECKING:
    from hypermap.colors import Color
    from hypermap.viewer.picture import Drawing

ROW = 25.0  # pixels
_SWATCH, _INDENT, _COUNT_GAP, _COLUMN_GAP = 15.0, 25.0, 18.0, 30.0
_MIN_ROWS, _MAX_COLUMNS = 16, 3


@dataclass(frozen=True)
class Row:
    """A line of the legend: a heading where it has no color, a note where it has a number."""

    text: str
    color: Color | None = None
    count: str = ""
    alpha: float = 1.0
    is_outline: bool = False
    number: str = ""


@dataclass(frozen=True)
class LegendColumn:
    """Rows below each other, and how much room they take to the right [pixels]."""

    rows: tuple[Row, ...]
    width: float


def legend_columns(drawing: Drawing, height: float) -> list[LegendColumn]:
    """Return the legend in as many columns as a page of that height [pixels] needs."""
    rows = _rows(drawing)
    per_column = max(int(height / ROW), _MIN_ROWS)
    room = per_column * _MAX_COLUMNS
    if len(rows) > room:
        rows = [*rows[: room - 1], Row(f"and {len(rows) - room + 1} more")]
    parts = [rows[i : i + per_column] for i in range(0, len(rows), per_column)]
    return [LegendColumn(tuple(part), max(map(_row_width, part)) + _COLUMN_GAP) for part in parts]


def draw_legend(page: Axes, columns: Sequence[LegendColumn], left: float, top: float) -> None:
    """Draw columns to the right of each other; the page is measured in pixels."""
    for column in columns:
        right = left + column.width - _COLUMN_GAP
        for i, row in enumerate(column.rows):
            y = top - (i + 0.75) * ROW
            if row.color is None:
                page.text(left, y, row.text, fontsize=SMALL, color=FAINT)
                continue
            if row.number:
                page.text(left, y, row.number, fontsize=SMALL, color=row.color, weight="bold")
                page.text(left + _INDENT, y, row.text, fontsize=SMALL, color=INK)
                continue
            style = line_style(row.color) if row.is_outline else fill_style(row.color, row.alpha)
            page.add_patch(Rectangle((left, y - 2), _SWATCH, _SWATCH, **style))
            page.text(left + _INDENT, y, row.text, fontsize=SMALL, color=INK)
            page.text(right, y, row.count, fontsize=SMALL, color=FAINT, ha="right")
        left += column.width


def _rows(drawing: Drawing) -> list[Row]:
    rows: list[Row] = []
    for part in drawing.shapes:
        counts = Counter(part.names)
        rows += [Row(""), Row(printable(part.layer))] if rows else [Row(printable(part.layer))]
        rows += [
            Row(
                printable(name),
                drawing.colors[name],
                str(counts[name]),
                SHAPE_ALPHA,
                part.are_outlines,
            )
            for name in sorted(counts, key=lambda name: (-counts[name], natural(name)))
        ]
    for layer in dict.fromkeys(mark.layer for mark in drawing.marks):
        rows += [Row(""), Row(printable(layer))] if rows else [Row(printable(layer))]
        rows += [
            Row(printable(mark.title), NOTE, number=str(mark.number))
            for mark in drawing.marks
            if mark.layer == layer
        ]
    for raster in drawing.rasters:
        rows += [Row(""), Row(printable(raster.layer))] if rows else [Row(printable(raster.layer))]
        for text, (red, green, blue) in raster.picture.legend.items():
            rows.append(Row(printable(text), (red / 255, green / 255, blue / 255)))
    return rows


def _row_width(row: Row) -> float:
    if row.color is None:
        return text_width(row.text, SMALL)
    count = _COUNT_GAP + text_width(row.count, SMALL) if row.count else 0
    return _INDENT + text_width(row.text, SMALL) + count
