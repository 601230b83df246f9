"""Options of all commands that run nodes: middleware, parameters, ROS arguments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from hypermap.cli.options import port_option
from hypermap.core.errors import HypermapError
from hypermap.simple_yaml import parse_simple_yaml

if TYPE_CHECKING:
    from hypermap.ros.nodes import Address, Middleware
    from hypermap.ros.port import Value

_ROS = "hypermap.ros_arguments"
_MIDDLEWARE = "Middleware"

Ros1 = Annotated[bool, typer.Option("--ros1", rich_help_panel=_MIDDLEWARE, help="Use ROS 1.")]
Ros2 = Annotated[bool, typer.Option("--ros2", rich_help_panel=_MIDDLEWARE, help="Use ROS 2.")]
Foxglove = Annotated[
    bool,
    typer.Option(
        "--foxglove",
        rich_help_panel=_MIDDLEWARE,
        help="Run without ROS: a WebSocket server for Foxglove and Lichtblick.",
    ),
]
Host = Annotated[
    str | None,
    typer.Option(
        rich_help_panel=_MIDDLEWARE,
        metavar="ADDRESS",
        show_default="127.0.0.1",
        help="Address to listen on: with --foxglove; 0.0.0.0 accepts other machines.",
    ),
]
Port = Annotated[int | None, port_option("8765", "with --foxglove", _MIDDLEWARE)]
AllowEdits = Annotated[
    bool,
    typer.Option(
        "--allow-edits",
        rich_help_panel=_MIDDLEWARE,
        help="Let clients change the map: publish, clear, load and store, with --foxglove; by "
        "default they can only view and query.",
    ),
]
AllowOrigin = Annotated[
    list[str] | None,
    typer.Option(
        metavar="URL",
        rich_help_panel=_MIDDLEWARE,
        show_default=False,
        help="Also accept this website, with --foxglove; may be repeated. Foxglove, "
        "desktop apps and local sites are always accepted.",
    ),
]
Params = Annotated[
    list[str] | None,
    typer.Option(
        "--param",
        metavar="NAME=VALUE",
        show_default=False,
        help="Set a parameter of the node; may be repeated.",
    ),
]


class NodeCommand(TyperCommand):
    """A command that leaves the arguments that are meant for ROS to ROS."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the arguments for ROS aside, and parse the others."""
        from hypermap.ros.nodes import split_arguments

        own, ctx.meta[_ROS] = split_arguments(args)
        return super().parse_args(ctx, own)


def ros_arguments(context: typer.Context) -> list[str]:
    """Return the arguments that are meant for ROS."""
    arguments: list[str] = context.meta[_ROS]
    return arguments


def chosen_middleware(ros1: bool, ros2: bool, foxglove: bool) -> Middleware:
    """Return the middleware that was chosen; "auto" for none.

    Raises:
        HypermapError: If several were.
    """
    chosen: list[Middleware] = []
    if ros1:
        chosen.append("ros1")
    if ros2:
        chosen.append("ros2")
    if foxglove:
        chosen.append("foxglove")
    if len(chosen) > 1:
        raise HypermapError(f"give one of {', '.join(f'--{name}' for name in chosen)}")
    return chosen[0] if chosen else "auto"


def address_of(
    host: str | None,
    port: int | None,
    middleware: Middleware,
    allow_edits: bool = False,
    allow_origin: Sequence[str] | None = None,
) -> Address:
    """Return where to listen, and what whom is allowed there.

    Raises:
        HypermapError: If any of that was given, but not for Foxglove.
    """
    from hypermap.ros.nodes import Address

    is_given = host is not None or port is not None or allow_edits or bool(allow_origin)
    if middleware != "foxglove" and is_given:
        raise HypermapError("--host, --port, --allow-edits and --allow-origin need --foxglove")
    default = Address()
    return Address(
        default.host if host is None else host,
        default.port if port is None else port,
        allow_edits,
        tuple(allow_origin or ()),
    )


def parse_params(pairs: Sequence[str] | None) -> dict[str, Value]:
    """Return the parameters out of "NAME=VALUE"; values are YAML, as on ROS's command line.

    Raises:
        HypermapError: If a pair is none, or the value is neither a text, a number, true or false,
            nor a list of texts.
    """
    values: dict[str, Value] = {}
    for pair in pairs or ():
        name, equals, text = pair.partition("=")
        if not (equals and name.isidentifier()):
            raise HypermapError(f"--param {pair!r}: give NAME=VALUE, as label_height=0.5")
        values[name] = _value(pair, text)
    return values


def _value(pair: str, text: str) -> Value:
    try:
        value = parse_simple_yaml(text)
    except ValueError:
        return text
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, list) and all(isinstance(item, str) for item in value):
        return value
    if isinstance(value, (dict, list)):
        raise HypermapError(
            f"--param {pair!r}: a value is a text, a number, true, false or a list of texts"
        )
    return text  # what YAML takes for a date, or for nothing
