"""`hypermap serve`: the map server, as a node of ROS 1 or ROS 2, or for Foxglove without ROS."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.node_options import (
    AllowEdits,
    AllowOrigin,
    Foxglove,
    Host,
    NodeCommand,
    Params,
    Port,
    Ros1,
    Ros2,
    address_of,
    chosen_middleware,
    parse_params,
    ros_arguments,
)
from hypermap.cli.store_options import followed_site
from hypermap.cli.terminal import note
from hypermap.core.errors import FileMissing
from hypermap.text import is_address

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.ros.server.map_server import MapServer

COMMAND_CLASS = NodeCommand


def command(
    context: typer.Context,
    path: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MAP]",
            readable=False,
            show_default=False,
            help="The map to serve: a file, or a site of a store, which is served with all later "
            "changes; by default the one in the parameters.",
        ),
    ] = None,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    foxglove: Foxglove = False,
    host: Host = None,
    port: Port = None,
    allow_edits: AllowEdits = False,
    allow_origin: AllowOrigin = None,
    map_directory: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            readable=False,
            show_default=False,
            help="Let clients load and store maps in this folder only.",
        ),
    ] = None,
    mcp: Annotated[
        bool,
        typer.Option(
            "--mcp",
            help="Also serve the map to language-model agents on this machine, by MCP over HTTP; "
            "HYPERMAP_MCP_TOKEN can set the secret that they need.",
        ),
    ] = False,
    view: Annotated[
        bool,
        typer.Option(
            "--view",
            help="Watch the map in the browser: as it is served, with a button for automap. The "
            "page is for this machine; its address is printed.",
        ),
    ] = False,
    param: Params = None,
) -> None:
    """Serve a map to robots and viewers: topics, services and transforms, until Ctrl-C.

    The node hypermap_server publishes all layers and answers queries. It runs on the ROS that was
    sourced. --foxglove needs no ROS: its clients can view and query the map, and edit it with
    --allow-edits. At a terminal, you can type the commands of hypermap shell. ROS arguments
    (NAME:=VALUE, --ros-args ...) are passed to ROS.

    Examples:
        hypermap serve lab.hmap
        hypermap serve lab.hmap --foxglove
        hypermap serve lab.hmap --mcp
        hypermap serve lab.hmap --view
        hypermap serve "postgresql://me@db.example/maps?site=lab"
        hypermap serve lab.hmap --map-directory maps --param label_height=0.5
        hypermap serve lab.hmap --ros2 --ros-args -r __ns:=/robot
    """
    from hypermap.ros.nodes import run_map_server

    values = parse_params(param)
    if map_directory is not None:
        if not map_directory.is_dir():
            raise FileMissing(f"--map-directory {map_directory}: there is no such folder")
        values["map_directory"] = str(map_directory.absolute())
    is_stored = is_address(path)
    if path is not None and not is_stored and not path.exists():
        raise FileMissing(f"{path}: there is no such file")
    middleware = chosen_middleware(ros1, ros2, foxglove)
    own = [] if path is None or is_stored else [str(path)]
    with followed_site(path) if is_stored else nullcontext() as source:
        run_map_server(
            [*own, *ros_arguments(context)],
            middleware=middleware,
            values=values,
            address=address_of(host, port, middleware, allow_edits, allow_origin),
            beside=lambda server: _beside(server, mcp, view),
            source=source,
        )


@contextmanager
def _beside(server: MapServer, mcp: bool, view: bool) -> Iterator[None]:
    """Serve the node's map to agents and browsers, too, as far as that is wanted."""
    with ExitStack() as stack:
        if mcp:
            stack.enter_context(_agents(lambda: server.hypermap))
        if view:
            stack.enter_context(_page(server))
        yield


@contextmanager
def _page(server: MapServer) -> Iterator[None]:
    """Show the node's map on a page, on which areas can be chosen that are to be mapped."""
    from hypermap.viewer.live.app import MapApp
    from hypermap.viewer.live.followed_map import FollowedMap
    from hypermap.viewer.live.page import require_page
    from hypermap.viewer.live.serving import listen, serving, url_of

    require_page()
    app = MapApp(FollowedMap(server), areas=server)
    with listen("127.0.0.1", None) as listening, serving(app, listening):
        note(f"showing the map at {url_of(app, listening)}")
        yield


def _agents(current: Callable[[], Hypermap]) -> AbstractContextManager[None]:
    """Return a context in which agents are answered, too."""
    from hypermap.agents.http import served_beside
    from hypermap.agents.looking import Looking
    from hypermap.agents.mcp_server import server_of
    from hypermap.agents.toolbox import tools_to_look

    looking = Looking(current)
    server = server_of(tools_to_look(looking), looking)
    given = os.environ.get("HYPERMAP_MCP_TOKEN")
    token = given or secrets.token_urlsafe(24)

    def started(url: str) -> None:
        note(f"serving agents at {url}")
        if given is None:
            note(f"they send the header Authorization: Bearer {token}")

    return served_beside(server, None, token, started)
