"""`hypermap thin`: remove old versions from a shared store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import AsJson
from hypermap.cli.store_options import SiteName, StoreAddress
from hypermap.cli.terminal import BAD_INPUT, complain, out, say_json, table
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.thinning import Thinned


def command(
    store: StoreAddress,
    site: SiteName = None,
    keep: Annotated[
        str,
        typer.Option(
            "--keep-for", metavar="TIME", help="Keep what was written since: 90d, 2w; >= 1d."
        ),
    ] = "90d",
    max_mb: Annotated[
        float | None,
        typer.Option(
            "--keep-mb",
            metavar="MB",
            min=0,
            show_default=False,
            help="Keep at most so much of each site's history; the last day always stays.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Remove old versions of one site, or of all sites, of a shared store.

    The present versions stay, with their evidence. Former versions that are older than
    --keep-for can no longer be pulled. A site that fails is named, and the others are thinned.
    Needs an administrator of the database.

    Examples:
        hypermap thin postgresql://postgres@db.example/maps --keep-for 30d
        hypermap thin postgresql://postgres@db.example/maps --keep-for 2w --keep-mb 1000
    """
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.database import Database
    from hypermap.fleet.store.sites import list_sites
    from hypermap.fleet.store.thinning import DAY
    from hypermap.history.policy import HistoryPolicy

    seconds = HistoryPolicy(keep).seconds
    if seconds < DAY:
        raise HypermapError(
            f"--keep-for {keep}: the last day of a store always stays; give 1d or more"
        )
    address = parse_address(store)
    database = Database(address)
    wanted = site or address.site
    names = [each.name for each in list_sites(database)] if wanted is None else [wanted]
    done: list[Thinned | None] = []
    try:
        for name in names:
            done.append(_thinned(database, name, seconds, max_mb))  # noqa: PERF401 - what is done
    finally:  # also where the database was lost in between
        database.close()
        if any(done) or not names:
            _show([each for each in done if each is not None], as_json)
    if None in done:
        raise typer.Exit(BAD_INPUT)


def _thinned(database: Database, site: str, seconds: float, max_mb: float | None) -> Thinned | None:
    """Thin a site; where the store refuses, say so and return None."""
    from hypermap.fleet.store.address import StoreAway, StoreError
    from hypermap.fleet.store.thinning import thin

    try:
        return thin(database, site, seconds, max_mb)
    except StoreAway:  # so are the others
        raise
    except StoreError as error:
        complain(f"{site}: not thinned: {error}")
        return None


def _show(done: list[Thinned], as_json: bool) -> None:
    if as_json:
        say_json([vars(each) for each in done])
        return
    from hypermap.text import printable

    shown = table("site", "oldest", "versions removed", "rows removed", right=("oldest",))
    for each in done:
        shown.add_row(printable(each.site), *map(str, (each.first, each.versions, each.rows)))
    out().print(shown)
