"""`hypermap query`: ask a map one question."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import AN_AREA, AsJson, MapPath, parse_point
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.core.errors import HypermapError
from hypermap.viewer.text import printable

if TYPE_CHECKING:
    from hypermap.cli.ask import Row

_MOST_ROWS = 50  # of a table; --json lists all

_WHAT, _WHERE = "What", "Where"


def command(
    path: MapPath,
    at: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="What is at this point?", rich_help_panel=_WHERE),
    ] = None,
    area: Annotated[
        str | None,
        typer.Option(
            "--in",
            metavar="AREA",
            help=f"Only this area: {AN_AREA}. Alone: what is in it?",
            rich_help_panel=_WHERE,
        ),
    ] = None,
    name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Only what is called so: may be repeated, for either.",
            rich_help_panel=_WHAT,
        ),
    ] = None,
    value: Annotated[
        float | None,
        typer.Option(
            "--value",
            "--id",
            metavar="N",
            help="Where is this number? Of an object it is the id.",
            rich_help_panel=_WHAT,
        ),
    ] = None,
    nearest: Annotated[
        bool, typer.Option("--nearest", help="Only the nearest one.", rich_help_panel=_WHAT)
    ] = False,
    count: Annotated[
        int | None,
        typer.Option("-k", min=1, metavar="K", help="The K nearest ones.", rich_help_panel=_WHAT),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="X,Y",
            show_default="0,0",
            help="From where --nearest and -k measure.",
            rich_help_panel=_WHERE,
        ),
    ] = None,
    near: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|X,Y", help="Only objects near this one.", rich_help_panel=_WHERE
        ),
    ] = None,
    within: Annotated[
        float | None,
        typer.Option(metavar="METRES", min=0, help="How near --near is.", rich_help_panel=_WHERE),
    ] = None,
    inside: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|AREA",
            help="Only objects whose middle lies in this one.",
            rich_help_panel=_WHERE,
        ),
    ] = None,
    evidence: Annotated[
        bool,
        typer.Option("--evidence", help="Look behind the objects found.", rich_help_panel=_WHAT),
    ] = False,
    layers: Annotated[
        list[str] | None,
        typer.Option("--layer", metavar="NAME", help="Only this layer: may be repeated."),
    ] = None,
    frame_id: Annotated[
        str | None,
        typer.Option(
            "--frame",
            metavar="FRAME",
            show_default="the map's base frame",
            help="Frame of the coordinates: of the points and areas in the question.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Ask a map: what is here, where is that, and what is near to it?

    Points and areas are in metres; answers are in the map's base frame. To an object, the distance
    is that to its shape. An empty answer is an answer: the exit code is 0.

    Examples:
        hypermap query lab.hmap --at 3,-2
        hypermap query lab.hmap --in 2,-2,3,-1
        hypermap query lab.hmap --name cup --nearest --from 1,1
        hypermap query lab.hmap --name cup --name bottle
        hypermap query lab.hmap --name chair --near sink --within 2
        hypermap query lab.hmap --name chair --in "1,2 2,2 2,3 1,3" --json
        hypermap query lab.hmap --id 7 --evidence
    """
    from hypermap.cli.ask import Question, answers, hint_for
    from hypermap.cli.evidence import add_evidence, show_evidence
    from hypermap.formats import open_map

    if name and value is not None:
        raise HypermapError("give either --name or --value, not both")
    question = Question(
        at=None if at is None else parse_point(at, "--at"),
        names=name or (),
        number=value,
        area=area,
        start=(0.0, 0.0) if start is None else parse_point(start, "--from"),
        most=count if count is not None else 1 if nearest else None,
        near=near,
        within=within,
        inside=inside,
        layers=layers or (),
        frame_id=frame_id,
    )
    hypermap = open_map(path)
    rows = answers(hypermap, question)
    if evidence:
        add_evidence(hypermap, rows)
    if as_json:
        say_json({"map": str(path), "frame_id": hypermap.base_frame, "answers": rows})
        return
    if rows:
        # Of an area alone, a grid would show every cell.
        _show(rows, cells_are_counted=not question.what and at is None)
    else:
        note("nothing found" + "".join(f"; {hint}" for hint in hint_for(hypermap, question)))
    if evidence:
        show_evidence(rows)
    if question.most is not None and start is None and rows:
        note("measured from (0, 0); give --from X,Y to measure from elsewhere")


def _show(rows: list[Row], cells_are_counted: bool) -> None:
    listed = [row for row in rows if "object" in row] if cells_are_counted else rows
    has_distance = "distance" in rows[0]
    numbers = ["value", "x", "y", *(["distance"] if has_distance else [])]
    grid = table("layer", "label", *numbers, right=numbers)
    for row in listed[:_MOST_ROWS]:
        texts = [printable(row["layer"]), printable(row["label"])]
        grid.add_row(*texts, *(_number(row[key]) for key in numbers))
    if listed:
        out().print(grid)
    if len(listed) > _MOST_ROWS:
        note(f"and {len(listed) - _MOST_ROWS} more; --json lists all")
    if cells_are_counted:
        cells = Counter((row["layer"], row["label"]) for row in rows if "object" not in row)
        for (layer, label), count in cells.items():
            say(f"{printable(layer)}: {count} {printable(label)}")


def _number(value: object) -> str:
    """Return a number to the millimetre, whole ones as they are."""
    return f"{value:.3f}" if isinstance(value, float) else "-" if value is None else str(value)
