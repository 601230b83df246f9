"""`hypermap view`: view and edit a map in the browser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import Force, MapPath, Port, check_output
from hypermap.cli.public_url import PublicUrl, check_public_url
from hypermap.cli.signals import until_signal
from hypermap.cli.store_options import followed_site
from hypermap.cli.terminal import note, say
from hypermap.core.errors import HypermapError
from hypermap.fleet.store.address import site_address
from hypermap.text import is_address

if TYPE_CHECKING:
    from hypermap.viewer.live.shown_map import ShownMap


def command(
    path: MapPath,
    port: Port = None,
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen on: 0.0.0.0 accepts other machines. Everyone with "
            "the token can then see and edit the map, and the connection is not "
            "encrypted.",
        ),
    ] = "127.0.0.1",
    public_url: PublicUrl = None,
    no_token: Annotated[
        bool,
        typer.Option(
            "--no-token",
            help="Accept everyone who can reach the address, including other users of "
            "this machine.",
        ),
    ] = False,
    read_only: Annotated[bool, typer.Option("--read-only", help="Do not allow edits.")] = False,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the page and the map to one file, which works offline, instead "
            "of starting a server.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """View, query and edit a map in the browser, until Ctrl-C.

    The page is only accessible from this machine, and private: the printed address contains an
    access token. The page draws all layers, answers queries at points and in areas, finds objects
    by name, and adds, renames, reshapes, tags and deletes objects. Nothing is written until you
    save; the previous file is kept as MAP.bak. The page of a site in a store is read-only, and
    shows changes by others as they happen.

    Examples:
        hypermap view lab.hmap
        hypermap view lab.hmap --read-only --no-browser --port 9000
        hypermap view lab.hmap --no-browser --public-url https://robot.example/maps
        hypermap view lab.hmap --html lab.html
        hypermap view "postgresql://me@db.example/maps?site=lab"
    """
    if html is not None:
        _write(path, html, force)
        return
    if force:
        raise HypermapError("--force is for --html FILE; the page asks before it overwrites a map")
    from hypermap.viewer.live.page import require_page

    require_page()
    check_public_url(public_url)
    with _shown(path, read_only) as document:
        address = host, port, public_url
        _serve(document, address, is_private=not no_token, browser=browser)


@contextmanager
def _shown(path: Path, read_only: bool) -> Iterator[ShownMap]:
    """Open a file, or follow a site of a store, which the page cannot edit."""
    from hypermap.viewer.live.document import MapDocument
    from hypermap.viewer.live.followed_map import FollowedMap

    if is_address(path):
        with followed_site(path) as site:
            yield FollowedMap(site)
        return
    document = MapDocument(path, is_editable=not read_only)
    yield document
    if document.is_unsaved:
        note(f"{document.address}: unsaved changes made in the browser are lost")


def _serve(
    document: ShownMap,
    address: tuple[str, int | None, str | None],
    *,
    is_private: bool,
    browser: bool,
) -> None:
    """Serve the page at a host, a port and a public address until Ctrl-C."""
    from hypermap.viewer.live.app import MapApp
    from hypermap.viewer.live.serving import is_local, listen, open_browser, serve, url_of

    host, port, public_url = address
    app = MapApp(document, host, is_private=is_private, public_url=public_url)
    listening = listen(host, port)
    url = url_of(app, listening, public_url)

    def started() -> None:
        say(url)
        note(f"showing {document.address}; press Ctrl-C to stop")
        if public_url is not None:
            own = ":".join(map(str, listening.getsockname()[:2]))
            note(f"the web server there passes requests on to {own}")
        if not is_local(host):
            rights = "see and change" if document.is_editable else "see"
            who = "reach this machine" + (" and knows the token" if is_private else "")
            note(f"everyone who can {who} can {rights} the map")
        if browser:
            open_browser(app, listening)

    with closing(listening), until_signal():
        serve(app, listening, started)


def _write(path: Path, html: Path, force: bool) -> None:
    """Write the page and the map as one file."""
    from hypermap.formats import open_map
    from hypermap.viewer.live.export import export_page

    check_output(html, force)
    # An address may hold a password; the page names the file that a pull would make.
    named = Path(f"{site_address(path).site}.hmap") if is_address(path) else path
    done = export_page(open_map(path), named, html)
    for line in done.notes:
        note(line)
    note(f"saved {html}, {done.size / 1e6:.1f} MB")
