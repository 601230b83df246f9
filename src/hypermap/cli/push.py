"""`hypermap push`: put a map into a shared store."""

from __future__ import annotations

from typing import Annotated

import typer

from hypermap.cli.options import AsJson, MapPath
from hypermap.cli.store_options import SiteName, StoreAddress, address_with_site
from hypermap.cli.terminal import note, say, say_json


def command(
    path: MapPath,
    store: StoreAddress,
    site: SiteName = None,
    update: Annotated[
        bool, typer.Option("--update", help="Make it the next version of an existing site.")
    ] = False,
    expect: Annotated[
        int | None,
        typer.Option(
            "--expect",
            metavar="VERSION",
            min=1,
            show_default="any",
            help="With --update: only if the site still has this version.",
        ),
    ] = None,
    another_map: Annotated[
        bool,
        typer.Option("--another-map", help="With --update: even if the site has another map."),
    ] = False,
    message: Annotated[
        str, typer.Option("--note", metavar="TEXT", help="Comment for `hypermap log`.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Put a map into a shared store, as a new site or as the next version of one.

    The whole map is written, or nothing. Only changes since the previous version take space.
    `hypermap pull` returns exactly the same file, for earlier versions, too.

    Examples:
        hypermap push lab.hmap postgresql://me@db.example/maps --site lab
        hypermap push lab.hmap postgresql://me@db.example/maps --site lab --update --note "moved"
    """
    from hypermap.core.semantic import SemanticLayer
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.pushing import push
    from hypermap.formats import open_map
    from hypermap.text import counted, printable

    address, name = address_with_site(store, site)
    hypermap = open_map(path)
    database = Database(address)
    database.connected()
    objects = sum(len(layer) for layer in hypermap if isinstance(layer, SemanticLayer))
    note(f"pushing {counted(objects, 'object')} ...")
    pushed = push(
        database, hypermap, name, update=update, force=another_map, expected=expect, note=message
    )
    database.close()
    if as_json:
        say_json({"site": name, "version": pushed.version, "changes": pushed.changes})
        return
    say(f"{printable(name, 60)}: version {pushed.version}")
    changes = ", ".join(f"{what} {count}" for what, count in pushed.changes.items())
    say(f"  new, changed or gone: {changes or 'nothing'}")
