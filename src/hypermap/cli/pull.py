"""`hypermap pull`: get a map from a shared store."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import ForceMap, MapOutput, check_map_output
from hypermap.cli.signals import until_signal
from hypermap.cli.store_options import SiteName, StoreAddress, address_with_site
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.fleet.store.address import Address


def command(
    store: StoreAddress,
    output: MapOutput,
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
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            help="Keep running until Ctrl-C, and save OUT again whenever the site changes.",
        ),
    ] = False,
    force: ForceMap = False,
) -> None:
    """Get a map from a shared store, as it was pushed: the present or an earlier version.

    With --follow, OUT is kept up to date: programs that watch the file, such as `hypermap view`,
    see changes to the site within a second.

    Examples:
        hypermap pull postgresql://me@db.example/maps --site lab -o lab.hmap
        hypermap pull postgresql://me@db.example/maps --site lab --version 3 -o before.hmap
        hypermap pull postgresql://me@db.example/maps --site lab -o lab.hmap --follow
    """
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.pushing import pull
    from hypermap.formats.backup import save_with_backup

    address, name = address_with_site(store, site)
    if follow and (version or address.version):
        raise HypermapError("--follow is for the present version; leave the version out")
    check_map_output(output, force)
    database = Database(address)
    hypermap = pull(database, name, version or address.version)
    database.close()
    backup = save_with_backup(hypermap, output, spare_edited=True)
    if backup is not None:
        note(f"the previous map is kept as {backup}")
    note(f"saved {output}")
    if follow:
        with until_signal():
            _follow(address.at(name), output)


def _follow(address: Address, output: Path) -> None:
    """Save each new version of a site."""
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.followers import follow
    from hypermap.fleet.store.pushing import pull
    from hypermap.formats import save_map

    database = Database(address)
    note("following the site; press Ctrl-C to stop")
    for version in follow(address, threading.Event()):
        save_map(pull(database, address.site or ""), output)
        note(f"version {version}")
