"""`hypermap refused`: what a shared store refused of a robot's observations."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.options import AsJson
from hypermap.cli.terminal import BAD_INPUT, note, out, say, say_json, table
from hypermap.core.errors import FileMissing, HypermapError
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from rich.table import Table

    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.spool import Refused, Spool


def command(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="SPOOL", show_default=False, help="The file of `live --spool`: hypermap.spool."
        ),
    ],
    numbers: Annotated[
        list[int] | None,
        typer.Argument(metavar="[NUMBER]...", show_default="all", help="Only these parts."),
    ] = None,
    resend: Annotated[
        str | None,
        typer.Option(
            metavar="STORE",
            show_default=False,
            help="Send them again to this store; what it takes is removed from SPOOL.",
        ),
    ] = None,
    drop: Annotated[bool, typer.Option("--drop", help="Remove them from SPOOL.")] = False,
    as_json: AsJson = False,
) -> None:
    """List what a shared store refused of the observations of a robot, with the reasons.

    What is sent again is as it was then: an object that the robot has seen since gets its earlier
    state.

    Examples:
        hypermap refused hypermap.spool
        hypermap refused hypermap.spool --resend postgresql://robot@db.example/maps
        hypermap refused hypermap.spool 3 4 --drop
    """
    from hypermap.fleet.store.spool import Spool

    if resend is not None and drop:
        raise HypermapError("give --resend or --drop, not both")
    if not path.exists():  # which opening it would make
        raise FileMissing(f"{path}: there is no such file")
    spool = Spool(path)
    try:
        chosen = _chosen(spool, numbers or [])
        if drop:
            for each in chosen:
                spool.forget(each)
            say(f"{counted(len(chosen), 'part')} dropped")
        elif resend is not None:
            _resend(spool, chosen, resend)
        else:
            _show(spool, chosen, as_json)
    finally:
        spool.close()


def _chosen(spool: Spool, numbers: list[int]) -> list[Refused]:
    kept = spool.refused()
    known = {each.number for each in kept}
    if missing := [number for number in numbers if number not in known]:
        raise HypermapError(f"{spool.path}: nothing refused has the number {missing[0]}")
    return [each for each in kept if not numbers or each.number in numbers]


def _resend(spool: Spool, chosen: list[Refused], store: str) -> None:
    """Send parts to a store, and forget those that it takes; the others are named."""
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database

    database = Database(parse_address(store))
    try:
        left = [each for each in chosen if not _is_sent(spool, each, database)]
    finally:
        database.close()
    say(f"{counted(len(chosen) - len(left), 'part')} stored, {len(left)} still refused")
    if left:
        raise typer.Exit(BAD_INPUT)


def _is_sent(spool: Spool, part: Refused, database: Database) -> bool:
    from hypermap.fleet.store.address import StoreAway
    from hypermap.fleet.store.delivery import deliver

    try:
        deliver(database, spool.observed(part))
    except StoreAway:  # for all others, too
        raise
    except HypermapError as error:
        note(f"{part.number}: {error}")
        return False
    except Exception as error:  # of a library below, for which it may have been set aside
        note(f"{part.number}: {type(error).__name__}: {error}")
        return False
    spool.forget(part)
    return True


def _show(spool: Spool, chosen: list[Refused], as_json: bool) -> None:
    rows = [_row(spool, each) for each in chosen]
    if as_json:
        say_json({"refused": rows, "dropped": spool.dropped})
        return
    if rows:
        out().print(_table(rows))
    else:
        say("nothing that was refused is kept")
    if spool.dropped:
        say(f"{counted(spool.dropped, 'older part')} had to be dropped (live --refused-mb)")


def _table(rows: list[dict[str, Any]]) -> Table:
    shown = table("number", "site", "robot", "objects", "kB", "reason", right=("number", "kB"))
    for row in rows:
        texts = [row["number"], row["site"], row["robot"], ", ".join(row["objects"]), row["kB"]]
        shown.add_row(*(printable(str(text), 40) for text in texts), printable(row["reason"], 300))
    return shown


def _row(spool: Spool, part: Refused) -> dict[str, Any]:
    row: dict[str, Any] = {
        "number": part.number,
        "reason": part.reason,
        "kB": -(-len(part.content) // 1000),
    }
    try:
        observed = spool.observed(part)
    except HypermapError:  # damage, of which the reason tells
        return {**row, "site": "", "robot": "", "objects": []}
    names = [item.name for item in observed.objects]
    return {**row, "site": observed.site, "robot": observed.source, "objects": names}
