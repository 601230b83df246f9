"""`hypermap history`: the versions of a map, and how much of them it keeps."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.change_rows import summary_of
from hypermap.cli.options import AsJson, Force, MapPath, check_edited, check_output
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.core.errors import HypermapError
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap


def command(
    path: MapPath,
    keep: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            show_default="as the map says, else 90d",
            help="From now on, keep changes up to this long before the newest one: 90d, 12w.",
        ),
    ] = None,
    max_mb: Annotated[
        float | None,
        typer.Option(
            "--max-mb",
            metavar="MB",
            show_default="as the map says, else 100",
            help="From now on, keep at most this much.",
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="Save all changes as a table: .csv, or .parquet.",
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Show the versions of MAP: when and how each was made, and what changed in it.

    Maps made by `hypermap map` keep a history automatically. For other maps, --keep
    starts one. `hypermap changes` shows each change.

    Examples:
        hypermap history office.hmap
        hypermap history office.hmap --keep 30d --max-mb 20
        hypermap history office.hmap --export changes.parquet
    """
    from hypermap.formats import open_map
    from hypermap.formats.config import file_of_map
    from hypermap.formats.locks import turn_to_edit

    if export is not None:
        check_output(export, force)
    is_changed = keep is not None or max_mb is not None
    file = file_of_map(path)
    if is_changed:
        check_edited(file)
    with turn_to_edit(*([file] if is_changed else [])):
        hypermap = open_map(path)
        if is_changed:
            _set_policy(hypermap, path, keep, max_mb)
    if export is not None:
        _export(hypermap, export)
    rows = _versions(hypermap)
    if as_json:
        say_json({"policy": _policy(hypermap), "versions": rows})
        return
    _show(hypermap, rows)


def _policy(hypermap: Hypermap) -> dict[str, Any]:
    from dataclasses import asdict

    from hypermap.history import HistoryPolicy

    return asdict(HistoryPolicy.of(hypermap.metadata))


def _set_policy(hypermap: Hypermap, path: Path, keep: str | None, max_mb: float | None) -> None:
    """Change what a map keeps of its history, and save it."""
    from dataclasses import asdict

    from hypermap.formats import save_map
    from hypermap.history import POLICY, HistoryPolicy, begin_history

    given = {"keep": keep, "max_mb": max_mb}
    try:
        values = _policy(hypermap)
    except HypermapError:  # it is mended
        values = asdict(HistoryPolicy())
    values |= {key: value for key, value in given.items() if value is not None}
    hypermap.metadata[POLICY] = asdict(HistoryPolicy(**values))
    if begin_history(hypermap):
        note(f"{path} keeps its history from now on")
    save_map(hypermap, path)


def _export(hypermap: Hypermap, target: Path) -> None:
    from hypermap.formats.history_table import save_history_table

    count = save_history_table(hypermap, target)
    note(f"saved {counted(count, 'change')} in {target}")


def _versions(hypermap: Hypermap) -> list[dict[str, Any]]:
    from hypermap.console.moments import iso_of

    revisions = [] if hypermap.history is None else hypermap.history.revisions()
    return [
        {
            "version": revision.version,
            "time": None if revision.time is None else iso_of(revision.time),
            "cause": revision.cause,
            "drive": revision.drive,
            "changes": dict(Counter(change.kind for change in revision.changes)),
            "follows_loss": revision.follows_loss,
        }
        for revision in revisions
    ]


def _show(hypermap: Hypermap, rows: list[dict[str, Any]]) -> None:
    from hypermap.questions.times import time_of

    if hypermap.history is None:
        say("this map keeps no history; --keep 90d begins one")
        return
    policy = _policy(hypermap)
    if rows:
        shown = table("version", "when", "by", "changes", right=("version",))
        for row, revision in zip(rows, hypermap.history.revisions(), strict=True):
            counts = summary_of(revision)
            lost = "(versions before this one are lost) " if row["follows_loss"] else ""
            by = printable(row["drive"], 40) or row["cause"]
            made = "?" if revision.time is None else time_of(revision.time)
            shown.add_row(str(row["version"]), made, by, lost + (counts or "nothing"))
        out().print(shown)
    kept = f"changes of {policy['keep']}, at most {policy['max_mb']:g} MB, are kept"
    say(f"{counted(len(rows), 'version')}; {kept}")
