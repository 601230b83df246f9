"""`--public-url`: where clients reach a server that is behind a web server."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import urlsplit

import typer

from hypermap.core.errors import HypermapError

PublicUrl = Annotated[
    str | None,
    typer.Option(
        "--public-url",
        metavar="URL",
        show_default=False,
        help="Where clients reach it, if it is behind a web server: https://maps.example/lab.",
    ),
]


def check_public_url(url: str | None) -> None:
    """Raise a HypermapError if there is an address and links cannot begin with it."""
    if url is not None and not _is_root(url):
        raise HypermapError(
            "--public-url must be the address of a web server, as https://maps.example or "
            "https://maps.example/objects"
        )


def _is_root(url: str) -> bool:
    try:
        parts = urlsplit(url)
    except ValueError:
        return False
    has_more = parts.query or parts.fragment or "@" in parts.netloc
    return parts.scheme in ("http", "https") and bool(parts.hostname) and not has_more
