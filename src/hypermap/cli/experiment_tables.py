"""Where the results of experiments are saved, and their tables at a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.cli.options import check_output
from hypermap.cli.terminal import out, say, table
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.experiments.tables import Table


def tables_folder(output: Path) -> Path:
    """Return the folder for the tables of a report, next to it."""
    return output.with_name(f"{output.stem}-tables")


def check_outputs(output: Path, replace: bool) -> None:
    """Make sure before a long work that its report, figures and tables can be saved.

    Raises:
        HypermapError: If they cannot, or there are some that must not be replaced.
    """
    if output.suffix.lower() not in (".html", ".htm"):
        raise HypermapError(f"{output}: a report is saved as .html")
    for file in (output, output.with_suffix(".json")):
        check_output(file, replace)
    folder = tables_folder(output)
    if folder.exists() and not folder.is_dir():
        raise HypermapError(f"{folder}: this is a file, and the tables need a folder of this name")
    if folder.exists() and not replace:
        raise HypermapError(f"{folder} exists already; give --force to replace the tables in it")


def show(shown: Table) -> None:
    """Print a table."""
    from hypermap.experiments.tables import text_of

    first, *others = shown.columns
    titles = [column.title for column in others]
    rows = table(first.title, *titles, right=titles)
    for row in shown.rows:
        rows.add_row(
            *(text_of(cell, column) for cell, column in zip(row, shown.columns, strict=True))
        )
    say(f"\n{shown.caption}\n")
    out().print(rows)
