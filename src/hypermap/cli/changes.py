"""`hypermap changes`: what changed in a map over time."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.change_rows import (
    counts_of,
    described,
    distance_of,
    mean_distance,
    named,
    place_of,
)
from hypermap.cli.options import AsJson, MapPath, OnlyNames, check_picture, title_of
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypermap.core.history import Change, Revision
    from hypermap.core.hypermap import Hypermap

    _Found = Sequence[tuple[Revision, Change]]


def command(
    path: MapPath,
    since: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            show_default="all that is kept",
            help="Only from this time on: yesterday, monday, 2026-11-20T10:00, 7d, or v3: those "
            "after version 3.",
        ),
    ] = None,
    names: OnlyNames = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="Draw the result: the changes on the map, with arrows, as .png or .svg.",
        ),
    ] = None,
    show_all: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Also show doubtful changes, and each object of the first drive and of corrected "
            "poses. --json always does.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Show what changed in MAP: added, gone, moved, reshaped, renamed or edited objects.

    Each line has the time and the cause: a drive, or an edit by hand. The times of drives are those
    of their recordings. A change is doubtful if its object probably did not come or go.
    `hypermap diff` compares two maps instead.

    Examples:
        hypermap changes office.hmap --since monday
        hypermap changes office.hmap --since 7d --name chair --picture chairs.png
        hypermap changes office.hmap --since v3 --json
    """
    from hypermap.console.moments import changes_since, unknown_since, worth_showing
    from hypermap.formats import open_map
    from hypermap.history import placed
    from hypermap.viewer.picture import check_suffix

    if picture is not None:
        check_suffix(picture)
        check_picture(picture)
    hypermap = open_map(path)
    found: _Found = [
        (revision, placed(hypermap, change))
        for revision, change in changes_since(hypermap, since)
        if not names or change.names & set(names)
    ]
    unknown = unknown_since(hypermap, since)
    if unknown:
        note(unknown)
    _tell_unknown_names(hypermap, names or ())
    shown_changes = found if as_json or show_all else worth_showing(found)
    if picture is not None:  # first: nobody may read what is printed
        from hypermap.evaluation import Changes
        from hypermap.viewer.changes import render_changes

        drawn = tuple(change for _, change in shown_changes)
        shown = Changes(drawn, _unchanged(hypermap, found, names))
        render_changes(hypermap, shown, picture, title=title_of(path), is_over_time=True)
    if as_json:
        rows = [_facts(revision) | described(change) for revision, change in found]
        say_json({"frame_id": hypermap.base_frame, "changes": rows})
    else:
        nothing = "no change is known" if unknown else "nothing changed"
        _show(shown_changes, names is not None or show_all, nothing)
        if left_out := len(found) - len(shown_changes):
            note(f"{counted(left_out, 'doubtful change')} left out; --all shows them")
    if picture is not None:
        note(f"saved {picture}")


def _tell_unknown_names(hypermap: Hypermap, names: Sequence[str]) -> None:
    """Say which of some names no object has or had, as far as the map's history is known."""
    from hypermap.console.moments import changes_since
    from hypermap.core.errors import did_you_mean
    from hypermap.core.semantic import SemanticLayer

    layers = (layer for layer in hypermap if isinstance(layer, SemanticLayer))
    known = {item.name for layer in layers for item in layer.objects()} if names else set()
    for _, change in changes_since(hypermap, None) if set(names) - known else ():
        known |= change.names
    for name in names:
        if name not in known:
            hint = did_you_mean(name, sorted(known))
            note(f"no object is called {name!r}, now or in the history; {hint}")


def _unchanged(
    hypermap: Hypermap, found: Sequence[tuple[Revision, Change]], names: Sequence[str] | None
) -> int:
    """Return how many objects of a map, of some names or all, are as they were."""
    from hypermap.core.semantic import SemanticLayer

    changed = {(change.layer, change.object.id) for _, change in found}
    return sum(
        (layer.name, item.id) not in changed and (not names or item.name in names)
        for layer in hypermap
        if isinstance(layer, SemanticLayer)
        for item in layer.objects()
    )


def _show(found: _Found, each: bool, nothing: str) -> None:
    """Show the changes.

    What the first drive found is one row, and so is what only stands elsewhere because poses were
    corrected, unless `each` is wanted. `nothing` is said if there are none.
    """
    from hypermap.questions.departed import when

    if found:
        rows = table("when", "change", "object", "before", "now", "distance", "by")
        for revision, group in groupby(found, key=_first):
            changes = [change for _, change in group]
            for together in () if each else _one_row(revision, changes):
                told = set(together)
                changes = [one for one in changes if one not in told]
                kind, by = together[0].kind, mean_distance(together)
                things = counted(len(together), "object")
                rows.add_row(when(revision), kind, things, "-", "", by, _cause(revision))
            for change in changes:
                rows.add_row(
                    when(revision),
                    change.kind,
                    named(change),
                    place_of(change.before),
                    place_of(change.after),
                    distance_of(change),
                    _cause(revision),
                )
        out().print(rows)
    say(counts_of(change for _, change in found) or nothing)


def _first(pair: tuple[Revision, Change]) -> Revision:
    return pair[0]


def _one_row(revision: Revision, changes: list[Change]) -> list[list[Change]]:
    """Return which changes of a revision are told as one."""
    corrected = [one for one in changes if one.kind == "corrected"]
    return [one for one in ([*changes] if revision.is_beginning else [], corrected) if one]


def _cause(revision: Revision) -> str:
    return printable(revision.drive, 40) or revision.cause


def _facts(revision: Revision) -> dict[str, Any]:
    from hypermap.console.moments import iso_of

    return {
        "version": revision.version,
        "time": None if revision.time is None else iso_of(revision.time),
        "cause": revision.cause,
        "drive": revision.drive,
    }
