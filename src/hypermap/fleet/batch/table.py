"""The results of a batch as a table: CSV, JSON and a page."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hypermap.fleet.batch.batch import Result
from hypermap.formats.atomic import write_file
from hypermap.spreadsheet import as_csv

_FIGURES = ("frames", "seconds", "frames_per_second", "objects", "f1", "precision", "recall", "iou")
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 14px/1.5 system-ui, sans-serif; margin: 2rem; color: #222; }}
table {{ border-collapse: collapse; }}
th, td {{ padding: 0.3rem 0.8rem; border-bottom: 1px solid #ddd; text-align: left; }}
td.number {{ text-align: right; font-variant-numeric: tabular-nums; }}
tr.failed {{ background: #fdecea; }}
</style>
</head>
<body>
<h1>{title}</h1>
<p>{summary}</p>
<table>
<thead><tr>{head}</tr></thead>
<tbody>
{body}
</tbody>
</table>
</body>
</html>
"""


def rows_of(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a row for each job: its name, recording, varied settings, state and figures."""
    swept = list(dict.fromkeys(key for result in results for key, _ in result.job.settings))
    figures = [name for name in _FIGURES if any(name in result.figures for result in results)]
    return [
        {
            "name": result.job.name,
            "recording": str(result.job.recording),
            **{key: dict(result.job.settings).get(key) for key in swept},
            "state": result.state,
            **{name: result.figures.get(name) for name in figures},
            "error": result.error,
        }
        for result in results
    ]


def write_tables(results: Sequence[Result], folder: Path) -> None:
    """Write results.csv, results.json and results.html.

    Raises:
        HypermapError: If they cannot be written.
    """
    rows = rows_of(results)
    write_file(folder / "results.csv", csv_text(rows).encode())
    write_file(folder / "results.json", (json.dumps(rows, indent=2, default=str) + "\n").encode())
    write_file(folder / "results.html", page(rows, summary(results)).encode())


def summary(results: Sequence[Result]) -> str:
    """Return how many jobs ended how, as "3 done, 1 failed"."""
    states = [result.state for result in results]
    kinds = ("done", "unchanged", "failed", "not begun")
    return ", ".join(f"{states.count(kind)} {kind}" for kind in kinds if kind in states)


def csv_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows as CSV with a head."""
    columns = list(rows[0]) if rows else []
    return as_csv(columns, ([row[column] for column in columns] for row in rows))


def page(rows: Sequence[dict[str, Any]], summary_text: str) -> str:
    """Return rows as an HTML page."""
    columns = list(rows[0]) if rows else []
    head = "".join(f"<th>{html.escape(column.replace('_', ' '))}</th>" for column in columns)
    body = "\n".join(
        f'<tr class="{html.escape(row["state"])}">'
        + "".join(_cell(column, row[column]) for column in columns)
        + "</tr>"
        for row in rows
    )
    return _PAGE.format(title="Batch of maps", summary=summary_text, head=head, body=body)


def _cell(column: str, value: Any) -> str:
    if value is None:
        return "<td></td>"
    text = html.escape(str(value))
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f'<td class="number">{text}</td>'
    return f"<td>{text}</td>" if column != "name" else f"<td><b>{text}</b></td>"
