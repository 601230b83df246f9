"""Arguments and options of the commands that use a shared store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.fleet.store.address import Address
    from hypermap.fleet.store.followed_site import FollowedSite

StoreAddress = Annotated[
    str,
    typer.Argument(
        metavar="STORE",
        show_default=False,
        help="A PostgreSQL database, as for libpq: postgresql://USER@HOST/DATABASE. Pass the "
        "password in PGPASSWORD or ~/.pgpass.",
    ),
]

SiteName = Annotated[
    str | None,
    typer.Option(
        "--site", metavar="SITE", show_default="the one in STORE", help="Name of the site."
    ),
]


def address_with_site(text: str, site: str | None) -> tuple[Address, str]:
    """Return an address, and the site that it or the option names.

    Raises:
        HypermapError: If neither names one, or both name different ones.
    """
    from hypermap.fleet.store.address import parse_address

    address = parse_address(text)
    names = {name for name in (address.site, site) if name}
    if len(names) != 1:
        problem = "two sites are named" if names else "name the site"
        raise HypermapError(f"{address.shown}: {problem}: --site SITE")
    return address, names.pop()


def followed_site(address: object) -> FollowedSite:
    """Return the map of a site, which follows the store as a context.

    Raises:
        HypermapError: If the address names none, or the store does not answer or refuses.
    """
    from hypermap.fleet.store.address import site_address
    from hypermap.fleet.store.followed_site import FollowedSite

    return FollowedSite(site_address(address))
