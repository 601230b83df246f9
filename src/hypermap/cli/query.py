"""`hypermap query`: query a map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.options import MapPath
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.console.options import OPTIONS
from hypermap.text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypermap.console.answer import Shown
    from hypermap.console.questions import Row

_WHAT, _WHERE, _WHEN = "What", "Where", "When"


def _option(name: str, panel: str | None = None, default: str | None = None) -> Any:
    """Return an option as the shell has it, too."""
    option = OPTIONS[name]
    return typer.Option(
        name,
        *option.also,
        metavar=option.takes or None,
        min=option.least,
        help=option.help,
        show_default=default or False,
        rich_help_panel=panel,
    )


def command(
    path: MapPath,
    at: Annotated[str | None, _option("--at", _WHERE)] = None,
    area: Annotated[str | None, _option("--in", _WHERE)] = None,
    name: Annotated[list[str] | None, _option("--name", _WHAT)] = None,
    value: Annotated[float | None, _option("--value", _WHAT)] = None,
    nearest: Annotated[bool, _option("--nearest", _WHAT)] = False,
    count: Annotated[int | None, _option("-k", _WHAT)] = None,
    start: Annotated[str | None, _option("--from", _WHERE, "0,0")] = None,
    by: Annotated[str | None, _option("--by", _WHERE, "air")] = None,
    robot_radius: Annotated[float | None, _option("--robot-radius", _WHERE)] = None,
    near: Annotated[str | None, _option("--near", _WHERE)] = None,
    within: Annotated[float | None, _option("--within", _WHERE)] = None,
    inside: Annotated[str | None, _option("--inside", _WHERE)] = None,
    like: Annotated[str | None, _option("--like", _WHAT)] = None,
    embedder: Annotated[
        str | None, _option("--embedder", _WHAT, "HYPERMAP_EMBEDDER of the environment")
    ] = None,
    having: Annotated[str | None, _option("--with", _WHAT)] = None,
    above: Annotated[float | None, _option("--above", _WHAT)] = None,
    below: Annotated[float | None, _option("--below", _WHAT)] = None,
    measured: Annotated[str | None, _option("--measured", _WHAT)] = None,
    since: Annotated[str | None, _option("--since", _WHEN)] = None,
    new_since: Annotated[str | None, _option("--new-since", _WHEN)] = None,
    not_seen_for: Annotated[str | None, _option("--not-seen-for", _WHEN)] = None,
    as_of: Annotated[str | None, _option("--as-of", _WHEN)] = None,
    last_seen: Annotated[bool, _option("--last-seen", _WHEN)] = False,
    evidence: Annotated[bool, _option("--evidence", _WHAT)] = False,
    pictures: Annotated[
        Path | None,
        typer.Option(
            "--pictures",
            metavar="DIR",
            show_default=False,
            help="Save the pictures of the objects in this folder, as JPEG files.",
            rich_help_panel=_WHAT,
        ),
    ] = None,
    layer: Annotated[list[str] | None, _option("--layer")] = None,
    frame_id: Annotated[str | None, _option("--frame", None, "the map's base frame")] = None,
    as_json: Annotated[bool, _option("--json")] = False,
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

    given = {
        "--at": at,
        "--in": area,
        "--name": name,
        "--value": value,
        "--nearest": nearest,
        "-k": count,
        "--from": start,
        "--by": by,
        "--robot-radius": robot_radius,
        "--near": near,
        "--within": within,
        "--inside": inside,
        "--like": like,
        "--embedder": embedder,
        "--with": having,
        "--above": above,
        "--below": below,
        "--measured": measured,
        "--since": since,
        "--new-since": new_since,
        "--not-seen-for": not_seen_for,
        "--as-of": as_of,
        "--last-seen": last_seen,
        "--layer": layer,
        "--frame": frame_id,
    }
    found = answered(open_map(path), given)
    hypermap, rows = found.hypermap, found.rows
    if evidence:
        from hypermap.console.evidence import add_evidence
        from hypermap.viewer.live.object_evidence import describe_evidence

        add_evidence(hypermap, rows, describe_evidence)
    saved = 0
    if pictures is not None:
        from hypermap.console.pictures import write_pictures

        saved = write_pictures(hypermap, rows, pictures)
    if as_json:
        say_json(document(str(path), hypermap, rows))
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
