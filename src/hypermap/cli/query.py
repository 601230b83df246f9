"""`hypermap query`: query a map."""

from __future__ import annotations

import functools
import inspect
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.added_options import with_options
from hypermap.cli.options import MapPath, name_of
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.console.options import OPTIONS
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypermap.console.answer import Shown
    from hypermap.console.questions import Row


def _takes_query_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of the shell's `query` to a command, which gets their values as `given`."""

    @functools.wraps(command)
    def wrapper(**arguments: Any) -> None:
        given = {name: arguments.pop(_key(name)) for name in OPTIONS}
        command(given=given, **arguments)

    signature = inspect.signature(command, eval_str=True)
    path, *own = (p for p in signature.parameters.values() if p.name != "given")
    return with_options(wrapper, [path, *map(_parameter, OPTIONS), *own])


def _key(name: str) -> str:
    """Return the parameter of an option; `--in` and others are keywords of Python."""
    return name.strip("-").replace("-", "_") + "_"


def _parameter(name: str) -> inspect.Parameter:
    option = OPTIONS[name]
    declared = typer.Option(
        name,
        *option.also,
        metavar=option.takes or None,
        min=option.least,
        help=option.help,
        show_default=option.default or False,
        rich_help_panel=option.panel or None,
        autocompletion=_completer(name) if option.takes else None,
    )
    kind = list[str] if option.repeats else option.kind
    is_switch = option.kind is bool
    return inspect.Parameter(
        _key(name),
        inspect.Parameter.KEYWORD_ONLY,
        default=False if is_switch else None,
        annotation=Annotated[kind if is_switch else kind | None, declared],
    )


def _completer(name: str) -> Callable[[typer.Context, str], list[str]]:
    """Return what the Tab key of a user's shell offers for an option: what the map has."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        from hypermap.console.choices import values_of
        from hypermap.formats import open_map

        # Arguments before an option that has no value yet are not assigned.
        path = ctx.params.get("path") or next(iter(ctx.args), None)
        try:
            values = [] if path is None else list(values_of(open_map(path), name))
        except (HypermapError, OSError):
            return []
        found = [value for value in values if value.startswith(incomplete) and value.isprintable()]
        if os.environ.get("_HYPERMAP_COMPLETE") != "complete_bash":  # others quote by themselves
            return found
        return [re.sub(r"([^\w@%+=:,./-])", r"\\\1", value) for value in found]

    return complete


@_takes_query_options
def command(
    path: MapPath,
    *,
    given: dict[str, Any],
    pictures: Annotated[
        Path | None,
        typer.Option(
            "--pictures",
            metavar="DIR",
            show_default=False,
            help="Save the pictures of the objects in this folder, as JPEG files.",
            rich_help_panel="What",
        ),
    ] = None,
) -> None:
    """Query a map: what is here, where is this object, and what is near it?

    Points and areas are in meters. Answers are in the base frame of the map. The distance to an
    object is the distance to its shape. The exit code of an empty answer is 0.

    Examples:
        hypermap query lab.hmap --at 3,-2
        hypermap query lab.hmap --in 2,-2,3,-1
        hypermap query lab.hmap --name cup --nearest --from 1,1
        hypermap query lab.hmap --name cup --nearest --from 1,1 --by path
        hypermap query lab.hmap --name cup --name bottle
        hypermap query lab.hmap --name chair --in kitchen
        hypermap query lab.hmap --with printer
        hypermap query lab.hmap --name chair --near sink --within 2
        hypermap query lab.hmap --name chair --in "1,2 2,2 2,3 1,3" --json
        hypermap query lab.hmap --name cup --last-seen
        hypermap query lab.hmap --name cup --as-of 2026-11-20T10:00
        hypermap query lab.hmap --new-since yesterday
        hypermap query lab.hmap --name chair --not-seen-for 7d
        hypermap query lab.hmap --id 7 --evidence
        hypermap query lab.hmap --name cup --pictures cups
        hypermap query lab.hmap --like "something to sit on" --embedder mobileclip
        hypermap query lab.hmap --layer temperature --above 25
        hypermap query lab.hmap --layer noise --below 40 --nearest --from 1,1
        hypermap query lab.hmap --layer rooms --measured temperature
        hypermap query lab.hmap --name desk --measured wifi --below -75
    """
    from hypermap.console.answer import document, shown
    from hypermap.console.questions import answered
    from hypermap.formats import open_map

    found = answered(open_map(path), given)
    hypermap, rows = found.hypermap, found.rows
    evidence = given["--evidence"]
    if evidence:
        from hypermap.console.evidence import add_evidence
        from hypermap.viewer.live.object_evidence import describe_evidence

        add_evidence(hypermap, rows, describe_evidence)
    saved = 0
    if pictures is not None:
        from hypermap.console.pictures import write_pictures

        saved = write_pictures(hypermap, rows, pictures)
    if given["--json"]:
        say_json(document(name_of(path), hypermap, rows))
        return
    _show(shown(found))
    if evidence:
        _show_evidence(rows)
    for remark in found.remarks:
        note(remark)
    if saved:
        say(f"\nsaved {counted(saved, 'picture')} in {pictures}")
    elif pictures is not None:
        note("there are no pictures of these objects; `hypermap map` keeps them, except of people")


def _show(answer: Shown) -> None:
    grid = table(*answer.columns, right=answer.columns[answer.texts :])
    for row in answer.rows:
        grid.add_row(*row)
    if answer.rows:
        out().print(grid)
    if answer.left_out:
        note(f"and {answer.left_out} more; --json lists all")
    for line in answer.counts:
        say(line)


def _show_evidence(rows: Sequence[Row]) -> None:
    from hypermap.console.evidence import FUSED, left_out, summaries

    for one in summaries(rows):
        say(f"\n{one.title}", style="bold")
        say(one.text)
        if one.fused:
            grid = table(*FUSED, right=FUSED[1:])
            for cells in one.fused:
                grid.add_row(*cells)
            out().print(grid)
    if more := left_out(rows):
        say(more)
