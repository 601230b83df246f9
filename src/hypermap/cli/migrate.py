"""`hypermap migrate`: create a shared store, or bring it to this program's version."""

from __future__ import annotations

from hypermap.cli.store_options import StoreAddress
from hypermap.cli.terminal import note


def command(store: StoreAddress) -> None:
    """Create a shared store in a PostgreSQL database, or upgrade one to this program's version.

    Adds the schema "hypermap" with its tables, the extensions PostGIS and btree_gist, and the
    roles hypermap_reader, hypermap_robot and hypermap_editor, so it needs an administrator.

    Examples:
        hypermap migrate postgresql://postgres@db.example/maps
    """
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.migrating import migrate

    address = parse_address(store)
    version = migrate(address)
    note(f"{address.shown}: the store has schema version {version}")
