"""`hypermap api`: serve a shared store over HTTP."""

from __future__ import annotations

import contextlib
import secrets
from typing import Annotated

import typer

from hypermap.cli.options import Port
from hypermap.cli.public_url import PublicUrl, check_public_url
from hypermap.cli.signals import until_signal
from hypermap.cli.store_options import StoreAddress
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

_SHORTEST_TOKEN = 16  # characters


def command(
    store: StoreAddress,
    host: Annotated[
        str,
        typer.Option(
            "--host", metavar="ADDRESS", help="Address to listen on: one of this machine's."
        ),
    ] = "127.0.0.1",
    port: Port = None,
    token: Annotated[
        str | None,
        typer.Option(
            "--token",
            metavar="TOKEN",
            envvar="HYPERMAP_API_TOKEN",
            show_default="a new one",
            help="Secret that clients must know.",
        ),
    ] = None,
    public_url: PublicUrl = None,
    allow_edits: Annotated[
        bool,
        typer.Option(
            "--allow-edits", help="Let clients change the map: add, replace and remove objects."
        ),
    ] = False,
) -> None:
    """Serve the objects of a shared store over HTTP, for programs and for GIS such as QGIS.

    The API is OGC API - Features; /api is its OpenAPI description. Clients send the header
    "Authorization: Bearer TOKEN". They can only read, unless --allow-edits is given.

    Examples:
        hypermap api postgresql://reader@db.example/maps
        hypermap api postgresql://editor@db.example/maps --allow-edits --port 8100
        hypermap api postgresql://reader@db.example/maps --public-url https://maps.example/objects
    """
    from hypermap.fleet.store.address import parse_address
    from hypermap.fleet.store.service.app import StoreService
    from hypermap.viewer.live.serving import listen, serve

    secret = secrets.token_urlsafe(24) if token is None else token
    if len(secret) < _SHORTEST_TOKEN or not secret.isascii() or not secret.isprintable():
        raise HypermapError(f"a token has at least {_SHORTEST_TOKEN} ASCII characters, no blanks")
    check_public_url(public_url)
    address = parse_address(store)
    service = StoreService(address, secret, allows_edits=allow_edits, url=public_url)
    with service.connections.one() as database:
        database.connected()  # or it is an error before anyone asks
    listening = listen(host, port)
    where = f"http://{host}:{listening.getsockname()[1]}/"

    def started() -> None:
        note(f"serving {address.shown} at {where}; press Ctrl-C to stop")
        if token is None:
            note(f"clients send the header Authorization: Bearer {secret}")

    with contextlib.closing(listening), until_signal():
        serve(service, listening, started)
    service.connections.close()
