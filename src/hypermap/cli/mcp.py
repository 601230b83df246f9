"""`hypermap mcp`: serve a map to language-model agents."""

from __future__ import annotations

import contextlib
import os
import secrets
import sys
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import MapPath, Port, TaxonomyFile, name_of
from hypermap.cli.robot_options import RobotRadius
from hypermap.cli.signals import until_signal
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError
from hypermap.ros.signals import on_end_signals

if TYPE_CHECKING:
    from hypermap.agents.open_map import OpenMap


def command(
    path: MapPath,
    allow_edits: Annotated[
        bool,
        typer.Option(
            "--allow-edits", help="Let clients change the map: with tools that edit and save it."
        ),
    ] = False,
    http: Annotated[
        bool,
        typer.Option("--http", help="Serve by streamable HTTP instead of standard input/output."),
    ] = False,
    port: Port = None,
    token: Annotated[
        str | None,
        typer.Option(
            "--token",
            metavar="TOKEN",
            envvar="HYPERMAP_MCP_TOKEN",
            show_default="a new one",
            help="Secret that clients must know.",
        ),
    ] = None,
    taxonomy: TaxonomyFile = None,
    robot_radius: RobotRadius = None,
) -> None:
    """Serve a map to language-model agents by the Model Context Protocol (MCP).

    Agents get tools to find objects, the nearest one, what is at a point, rooms, paths, changes,
    answers to questions in English, and pictures. The map is reloaded when its file changes.
    With --http, the server is only accessible from this machine, with a token.

    Examples:
        hypermap mcp office.hmap
        hypermap mcp office.hmap --allow-edits
        hypermap mcp office.hmap --http --port 8100
    """
    from hypermap.agents.looking import Looking
    from hypermap.agents.mcp_server import serve_stdio, server_of
    from hypermap.agents.open_map import OpenMap
    from hypermap.agents.toolbox import tools_of

    opened = OpenMap(path, allow_edits)
    looking = Looking(opened.current, robot_radius or 0.0, taxonomy)
    server = server_of(tools_of(opened, looking, allow_edits), looking)
    if not http and (port is not None or token is not None):
        raise HypermapError("--port and --token need --http")
    if http:
        from hypermap.agents.http import serve_http

        secret = secrets.token_urlsafe(24) if token is None else token

        def started(url: str) -> None:
            note(f"serving {name_of(path)} at {url}; press Ctrl-C to stop")
            if token is None:
                note(f"clients send the header Authorization: Bearer {secret}")

        with until_signal():
            serve_http(server, port, secret, started)
        return
    with _ended_at_once(opened):
        if sys.stdin.isatty():
            note("waiting for an agent on standard input; clients start this command themselves")
        serve_stdio(server)


@contextlib.contextmanager
def _ended_at_once(opened: OpenMap) -> Iterator[None]:
    """Let signals end the program between two edits, though it is waiting for input.

    The thread that reads standard input cannot be interrupted, and Python would wait for it.
    """

    def end(_number: int, _frame: FrameType | None) -> None:
        with opened.between_edits():
            os._exit(0)  # as servers normally end

    with on_end_signals(end):
        yield
