"""`hypermap pull`: get a map from a shared store."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hypermap.cli.options import ForceMap, check_map_output
from hypermap.cli.store_options import SiteName, StoreAddress, address_with_site
from hypermap.cli.terminal import note


def command(
    store: StoreAddress,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="OUT", show_default=False, help="Save here: .hmap."),
    ],
    site: SiteName = None,
    version: Annotated[
        int | None,
        typer.Option(
            "--version",
            metavar="VERSION",
            min=1,
            show_default="the present one",
            help="Version of the site; `hypermap log` lists them.",
        ),
    ] = None,
    force: ForceMap = False,
) -> None:
    """Get a map from a shared store, as it was pushed, in its present or in a former version.

    Examples:
        hypermap pull postgresql://me@db.example/maps --site lab -o lab.hmap
        hypermap pull postgresql://me@db.example/maps --site lab --version 3 -o before.hmap
    """
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.pushing import pull
    from hypermap.formats import save_map
    from hypermap.formats.backup import keep_backup

    address, name = address_with_site(store, site)
    check_map_output(output, force)
    database = Database(address)
    hypermap = pull(database, name, version or address.version)
    database.close()
    backup = keep_backup(output, spare_edited=True)
    save_map(hypermap, output)
    if backup is not None:
        note(f"the previous map is kept as {backup}")
    note(f"saved {output}")
