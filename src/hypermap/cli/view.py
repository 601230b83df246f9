"""`hypermap view`: see a map in the browser, ask it and change it."""

from __future__ import annotations

import signal
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from hypermap.cli.options import Force, MapPath, check_output
from hypermap.cli.terminal import note, say
from hypermap.core.errors import HypermapError


def command(
    path: MapPath,
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            show_default="8090, or the next one that is free",
            help="Port to listen on: 0 for any that is free.",
        ),
    ] = None,
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen on: with any other than this machine's own, others who know "
            "the token can see and change the map, and the network between can read along.",
        ),
    ] = "127.0.0.1",
    no_token: Annotated[
        bool,
        typer.Option(
            "--no-token",
            help="Let in everyone who can reach the address, also other users of this machine.",
        ),
    ] = False,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Let nobody change the map.")
    ] = False,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the page with the map inside to this one file, which works from disk and "
            "without a network, and serve nothing.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Show a map in the browser: look, ask by pointing, and change it; until Ctrl-C.

    The page is served to this machine alone, and private: the address that is printed and opened
    holds a secret token, without which nothing is answered. The page draws every layer, tells what
    is at a point and in an area, finds things by name, and adds, renames, reshapes, tags and
    deletes objects. Nothing is written before it is saved there; the file as it was stays beside it
    as MAP.bak.

    Examples:
        hypermap view lab.hmap
        hypermap view lab.hmap --read-only --no-browser --port 9000
        hypermap view lab.hmap --html lab.html
    """
    if html is not None:
        _write(path, html, force)
        return
    if force:
        raise HypermapError("--force goes with --html FILE; a served map asks before it overwrites")
    from hypermap.viewer.live.app import MapApp
    from hypermap.viewer.live.document import MapDocument
    from hypermap.viewer.live.page import require_page
    from hypermap.viewer.live.serving import is_local, listen, open_browser, serve, url_of

    require_page()
    app = MapApp(MapDocument(path, is_editable=not read_only), host, is_private=not no_token)
    listening = listen(host, port)
    url = url_of(app, listening)

    def started() -> None:
        say(url)
        note(f"showing {path}; Ctrl-C ends")
        if not is_local(host):
            rights = "see" if read_only else "see and change"
            who = "reach this machine" + ("" if no_token else " and knows the token")
            note(f"everyone who can {who} can {rights} the map")
        if browser:
            open_browser(app, listening)

    signal.signal(signal.SIGTERM, _interrupt)
    try:
        serve(app, listening, started)
    except KeyboardInterrupt:
        pass
    finally:
        listening.close()
    if app.document.is_unsaved:
        note(f"{app.document.file.path}: changes made in the browser were not saved and are lost")


def _write(path: Path, html: Path, force: bool) -> None:
    """Write the page and the map as one file."""
    from hypermap.formats import open_map
    from hypermap.viewer.live.export import export_page

    check_output(html, force)
    done = export_page(open_map(path), path, html)
    for line in done.notes:
        note(line)
    note(f"saved {html}, {done.size / 1e6:.1f} MB")


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
