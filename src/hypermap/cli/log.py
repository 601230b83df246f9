"""`hypermap log`: show the history of a site in a shared store."""

from __future__ import annotations

from hypermap.cli.options import AsJson
from hypermap.cli.store_options import SiteName, StoreAddress, address_with_site
from hypermap.cli.terminal import out, say_json, table


def command(store: StoreAddress, site: SiteName = None, as_json: AsJson = False) -> None:
    """Show who wrote each version of a site, and when; the newest first.

    Examples:
        hypermap log postgresql://me@db.example/maps --site lab
        hypermap log postgresql://me@db.example/maps --site lab --json
    """
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.sites import history
    from hypermap.text import printable

    address, name = address_with_site(store, site)
    database = Database(address)
    versions = history(database, name)
    database.close()
    if as_json:
        say_json(
            [
                {
                    "version": each.version,
                    "at": each.at.isoformat(),
                    "author": each.author,
                    "note": each.note,
                    "outcome": each.outcome,
                }
                for each in versions
            ]
        )
        return
    shown = table("version", "at", "author", "note", right=("version",))
    for each in versions:
        at = f"{each.at:%Y-%m-%d %H:%M:%S} UTC"
        shown.add_row(str(each.version), at, printable(each.author), printable(each.note, 60))
    out().print(shown)
