"""Tables of results, each described once and written as HTML, CSV and LaTeX."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Literal, TypeAlias

from hypermap.formats.atomic import write_file
from hypermap.spreadsheet import as_csv

NOT_DEFINED = "-"


@dataclass(frozen=True)
class Interval:
    """A mean, and the interval that holds it with a confidence of 95 %.

    Attributes:
        mean: of the differences, or of the figures of the drives.
        low: lower end; that of one value alone has no width, and is not written.
        high: upper end.
        is_change: whether the mean is one of differences, which are written with their sign.
    """

    mean: float
    low: float
    high: float
    is_change: bool = True


Cell: TypeAlias = "str | int | float | Interval | None"


@dataclass(frozen=True)
class Column:
    """A column.

    Attributes:
        title: in the head.
        digits: behind the point.
        style: "probability" is written with an exponent if it is small; "bar" has a bar in HTML,
            as long as the share that it shows.
    """

    title: str
    digits: int = 2
    style: Literal["plain", "probability", "bar"] = "plain"


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        name: of its files, without a suffix, and its label in LaTeX, once `slug` has made it one.
        caption: what it shows.
        columns: the first is that of the names of the rows.
        rows: a cell for each column; None where a figure is not defined.
        bold: the first cells of rows that stand out.
    """

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    bold: tuple[str, ...] = ()

    def only(self, *titles: str) -> Table:
        """Return the table with only some of its columns."""
        places = [k for k, column in enumerate(self.columns) if column.title in titles]
        columns = tuple(self.columns[k] for k in places)
        rows = tuple(tuple(row[k] for k in places) for row in self.rows)
        return replace(self, columns=columns, rows=rows)


def text_of(cell: Cell, column: Column) -> str:
    """Return a cell as text.

    >>> text_of(Interval(0.1, -0.02, 0.2), Column("gain"))
    '+0.10 (-0.02 to +0.20)'
    >>> text_of(0.00001, Column("p", style="probability"))
    '1e-05'
    """
    if cell is None:
        return NOT_DEFINED
    if isinstance(cell, Interval):
        if cell.low == cell.high == 0:  # no drive differs
            return f"{0:.{column.digits}f}"
        sign = "+" if cell.is_change else ""
        values = (cell.mean, cell.low, cell.high)
        mean, low, high = (f"{v:{sign}.{column.digits}f}" for v in values)
        return mean if cell.low == cell.high else f"{mean} ({low} to {high})"
    if not isinstance(cell, float):
        return str(cell)
    if column.style == "probability" and cell < 0.001:
        return f"{cell:.0e}"
    return f"{cell:.{3 if column.style == 'probability' else column.digits}f}"


def number(value: float | None) -> str:
    """Return a figure as text; a dash where it is not defined."""
    return text_of(value, Column(""))


def html_of(table: Table) -> str:
    """Return a table as HTML."""
    head = "".join(f"<th>{html.escape(column.title)}</th>" for column in table.columns)
    body = "".join(
        f"<tr{' class=ours' if row[0] in table.bold else ''}>"
        + "".join(
            f"<td>{_bar(cell, column)}{html.escape(text_of(cell, column))}</td>"
            for cell, column in zip(row, table.columns, strict=True)
        )
        + "</tr>"
        for row in table.rows
    )
    caption = f"<caption>{html.escape(table.caption)}</caption>"
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _bar(cell: Cell, column: Column) -> str:
    if column.style != "bar":
        return ""
    width = 6 * cell if isinstance(cell, float) else 0.0
    return f'<span class=bar style="width:{width:.2f}em"></span>'


def csv_of(table: Table) -> str:
    """Return a table as CSV: all digits, empty where not defined, three columns for an interval."""
    has_interval = [
        any(isinstance(row[place], Interval) for row in table.rows)
        for place in range(len(table.columns))
    ]
    heads = zip(table.columns, has_interval, strict=True)
    head = [name for column, has in heads for name in _csv_titles(column.title, has)]
    rows = []
    for row in table.rows:
        cells = zip(row, has_interval, strict=True)
        rows.append([value for cell, has in cells for value in _csv_values(cell, has)])
    return as_csv(head, rows)


def _csv_titles(title: str, has_interval: bool) -> list[str]:
    return [title, f"{title}: low", f"{title}: high"] if has_interval else [title]


def _csv_values(cell: Cell, has_interval: bool) -> list[str | int | float]:
    if isinstance(cell, Interval):
        return [cell.mean, cell.low, cell.high]
    value = "" if cell is None else cell
    return [value, "", ""] if has_interval else [value]


def latex_of(table: Table) -> str:
    r"""Return a table as LaTeX; it needs `\usepackage{booktabs}`."""
    head = " & ".join(_escaped(column.title) for column in table.columns)
    lines = [
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{_escaped(table.caption)}}}",
        rf"\label{{tab:{slug(table.name)}}}",
        rf"\begin{{tabular}}{{l{'r' * (len(table.columns) - 1)}}}",
        r"\toprule",
        rf"{head} \\",
        r"\midrule",
    ]
    for row in table.rows:
        cells = zip(row, table.columns, strict=True)
        texts = [_escaped(text_of(cell, column)) for cell, column in cells]
        if row[0] in table.bold:
            texts = [rf"\textbf{{{text}}}" for text in texts]
        lines.append(rf"{' & '.join(texts)} \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


_LATEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "[": "{[}",  # or it would be an argument of the command before it
    "*": "{*}",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}


def _escaped(text: str) -> str:
    if text == NOT_DEFINED:
        return "--"
    escaped = "".join(_LATEX.get(sign, sign) for sign in " ".join(text.split()))
    return re.sub(r"(?<![\w.-])-(?=\d)", "$-$", escaped)  # minus signs


def save_tables(tables: Sequence[Table], folder: Path) -> None:
    """Write each table as CSV and as LaTeX into a folder, which may exist.

    Of tables with the same name, the second one gets a 2, and so on. Other tables that were saved
    there before are removed: they are of other worlds or methods. Other files stay.
    """
    folder.mkdir(exist_ok=True)
    taken: set[str] = set()
    for old in [file for file in folder.glob("*.tex") if file.is_file() and _is_table(file)]:
        old.unlink()
        old.with_suffix(".csv").unlink(missing_ok=True)
    for table in tables:
        names = (slug(table.name) + (f"-{k}" if k > 1 else "") for k in count(1))
        name = next(name for name in names if name.casefold() not in taken)
        taken.add(name.casefold())
        named = replace(table, name=name)
        write_file(folder / f"{name}.csv", _encoded(csv_of(named)))
        write_file(folder / f"{name}.tex", _encoded(latex_of(named)))


def _is_table(file: Path) -> bool:
    """Return whether a file is a table that `save_tables` wrote."""
    start = file.read_bytes()[:10_000].decode(errors="replace")
    return start.startswith(r"\begin{table}") and rf"\label{{tab:{file.stem}}}" in start


def _encoded(text: str) -> bytes:
    return text.encode(errors="backslashreplace")  # names of files need not be valid Unicode


def slug(name: str) -> str:
    """Return a name that is good for a file.

    >>> slug("best shape, overlap")
    'best-shape-overlap'
    """
    letters = (sign if sign.isalnum() or sign in "_." else " " for sign in name)
    return "-".join("".join(letters).split())
