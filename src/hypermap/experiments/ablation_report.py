"""The report of an ablation: its figures as JSON, and a page."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

from hypermap.experiments.ablation import rows_of
from hypermap.experiments.page import page_of, plot_of, wide
from hypermap.experiments.plots import changes_plot
from hypermap.experiments.results import MEASURES, Data, WorldResult
from hypermap.experiments.tables import Table, html_of
from hypermap.formats.atomic import write_file


def to_data(results: Sequence[WorldResult]) -> Data:
    """Return all figures as plain values, for JSON."""
    scopes = {result.world.name: [result] for result in results}
    return {
        "worlds": {name: _scope(some) for name, some in scopes.items()},
        "all": _scope(results),
        "rule": "a change is the figure without a part minus the figure with it, paired by drive; "
        "low and high: 95 % interval of its mean (Student's t)",
    }


def _scope(results: Sequence[WorldResult]) -> Data:
    return {
        "seeds": {r.world.name: [mapped.drive.seed for mapped in r.mapped] for r in results},
        "parts": {
            row.part: {
                "means": dict(row.means),
                "changes": {
                    name: None if change is None else vars(change)
                    for name, change in row.changes.items()
                },
            }
            for row in rows_of(results)
        },
    }


def write_report(tables: Sequence[Table], path: Path, method: str, command: str) -> None:
    """Write the page.

    Args:
        tables: of all worlds, as `tables_of` gives them.
        path: where to save.
        method: which was taken apart.
        command: what makes the report, for those who want to repeat it.
    """
    parts = [
        f"<h1>What the parts of {html.escape(method)} contribute</h1>",
        f"<p>Made by <code>{html.escape(command)}</code>. Each row leaves one part out. The "
        "part matters if the interval does not contain 0: red where the figure falls without it, "
        "green where it rises, gray where the drives cannot tell.</p>",
    ]
    for table in tables:
        if table.name.endswith("-changes"):
            titles = [MEASURES[name].title for name in ("iou", "f1", "f1_half")]
            parts.append(plot_of(changes_plot(table, titles), table.caption))
        parts.append(wide(html_of(table)))
    write_file(path, page_of(f"parts of {method}", parts))
