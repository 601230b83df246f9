"""`hypermap find`: find objects at many sites."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.options import AsJson
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.fleet.store.finding import AtSite, Sighting

COMMAND_CLASS = PointsCommand


def command(
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", show_default=False, help="Names of objects."),
    ],
    store: Annotated[
        str | None,
        typer.Option(
            "--in-store",
            metavar="STORE",
            show_default=False,
            help="All sites of a shared store: postgresql://USER@HOST/DATABASE.",
        ),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--in",
            metavar="FOLDER",
            show_default=False,
            help="All .hmap files in a folder and its subfolders.",
        ),
    ] = None,
    start: Annotated[
        str,
        typer.Option(
            "--point", metavar="X,Y", help="From where to measure, in each site's own frame [m]."
        ),
    ] = "0,0",
    not_seen_for: Annotated[
        str | None,
        typer.Option(
            "--not-seen-for",
            metavar="TIME",
            show_default=False,
            help="Only objects that were not seen for this long: 30d, 2h.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find objects at many sites: how many there are, in which rooms, and which is the nearest.

    Examples:
        hypermap find "fire extinguisher" --in-store postgresql://me@db.example/maps
        hypermap find "fire extinguisher" --in maps
        hypermap find chair stool --in maps --point 2,-1 --json
        hypermap find "fire extinguisher" --in maps --not-seen-for 30d
    """
    from hypermap.console.places import parse_point
    from hypermap.fleet.store.finding import by_site, seen_in_future
    from hypermap.questions.times import parse_moment

    if (store is None) == (folder is None):
        raise HypermapError("say where to look: --in-store STORE or --in FOLDER")
    point = parse_point(start, "--point")
    before = None
    if not_seen_for is not None:
        before = parse_moment(not_seen_for, "--not-seen-for").timestamp()
    found = _found(store, folder, names, point, before)
    for site in seen_in_future(found):
        note(f"{site}: something was seen later than now; is a clock off?")
    if as_json:
        say_json({"sites": [_described(each, found) for each in by_site(found)]})
    else:
        _show(by_site(found), len(found))


def _found(
    store: str | None,
    folder: Path | None,
    names: list[str],
    point: tuple[float, float],
    before: float | None,
) -> list[Sighting]:
    from hypermap.fleet.store.finding import find_in_folder, find_in_store, maps_in

    if folder is None:
        from hypermap.fleet.store.address import parse_address
        from hypermap.fleet.store.database import Database

        return find_in_store(Database(parse_address(store)), names, point, before)
    from hypermap.cli.progress import counting

    with counting("reading", len(maps_in(folder)), "map") as count:
        found, wrong = find_in_folder(folder, names, point, before, count)
    for error in wrong:
        note(f"left out: {error}")
    return found


def _described(site: AtSite, found: list[Sighting]) -> dict[str, Any]:
    keys = ("layer", "id", "name", "x", "y", "distance", "room", "last_seen")
    things = [each for each in found if each.site == site.site]
    return {
        "site": site.site,
        "count": site.count,
        "rooms": site.rooms,
        "found": [{key: getattr(each, key) for key in keys} for each in things],
    }


def _show(sites: list[AtSite], count: int) -> None:
    from hypermap.questions.times import time_of
    from hypermap.text import decimal, printable

    if not sites:
        say("found nowhere")
        return
    right = ("found", "x", "y", "meters")
    shown = table("site", "found", "rooms", "nearest", "x", "y", "meters", "seen", right=right)
    for each in sites:
        near = each.nearest
        rooms = ", ".join(f"{printable(name)} {n}" for name, n in each.rooms.items() if name)
        shown.add_row(
            printable(each.site, 40),
            str(each.count),
            rooms,
            f"{printable(near.name)} {near.id}",
            decimal(near.x),
            decimal(near.y),
            f"{near.distance:.2f}",
            "" if near.last_seen is None else time_of(near.last_seen, short=True),
        )
    out().print(shown)
    say(f"{count} at {counted(len(sites), 'site')}")
