"""`hypermap sites`: list the sites of a shared store."""

from __future__ import annotations

from hypermap.cli.options import AsJson
from hypermap.cli.store_options import StoreAddress
from hypermap.cli.terminal import out, say, say_json, table


def command(store: StoreAddress, as_json: AsJson = False) -> None:
    """List the sites of a shared store, with their versions and numbers of objects.

    Examples:
        hypermap sites postgresql://me@db.example/maps
        hypermap sites postgresql://me@db.example/maps --json
    """
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.sites import list_sites
    from hypermap.text import printable

    database = Database(parse_address(store))
    sites = list_sites(database)
    database.close()
    if as_json:
        say_json(
            [
                {
                    "site": each.name,
                    "version": each.version,
                    "objects": each.objects,
                    "changed": each.changed.isoformat(),
                }
                for each in sites
            ]
        )
    elif sites:
        shown = table("site", "version", "objects", "changed", right=("version", "objects"))
        for each in sites:
            changed = f"{each.changed:%Y-%m-%d %H:%M} UTC"
            shown.add_row(printable(each.name), str(each.version), str(each.objects), changed)
        out().print(shown)
    else:
        say("there are no sites yet; `hypermap push` adds one")
