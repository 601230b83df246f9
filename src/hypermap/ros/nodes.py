"""The nodes as programs: their middleware, and their life from start to end.

Every error that an operator can cause is a HypermapError; `hypermap serve` and `hypermap live`
print it as one line.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.ros.mapper.semantic_mapper import SemanticMapper
    from hypermap.ros.port import Node, Parameter, Port, Value
    from hypermap.ros.server.following import Source
    from hypermap.ros.server.map_server import MapServer

Middleware = Literal["auto", "ros1", "ros2", "foxglove"]
_NO_ROS = (
    "neither ROS 1 nor ROS 2 is here: source the setup.bash of one, on Debian 12 install "
    "python3-rospy and python3-tf2-ros, or do without ROS by --foxglove"
)


@dataclass(frozen=True)
class Address:
    """Where a WebSocket server listens; of use with Foxglove alone.

    Attributes:
        host: its own address; 127.0.0.1 is for programs on the same machine alone.
        port: its port; 0 for any that is free.
        allow_edits: whether clients may change the map and files.
        origins: of websites that are let in, next to those of the apps and of this machine.
    """

    host: str = "127.0.0.1"
    port: int = 8765
    allow_edits: bool = False
    origins: tuple[str, ...] = ()


def run_map_server(
    argv: Sequence[str] = (),
    *,
    middleware: Middleware = "auto",
    values: Mapping[str, Value] | None = None,
    address: Address | None = None,
    beside: Callable[[MapServer], AbstractContextManager[None]] | None = None,
    source: Source | None = None,
) -> None:
    """Serve a map until Ctrl-C, SIGTERM or the middleware ends it.

    Args:
        argv: at most one map, and ROS arguments (`__name:=office`, `_file:=lab.hmap`,
            `--ros-args -r __ns:=/robot`) in any order.
        middleware: what to run on; "auto" takes the ROS that is there.
        values: parameters of the node; they come before what the middleware knows of them.
        address: where to listen with Foxglove.
        beside: makes a context in which the node runs, such as that of another server of its map.
        source: a map that others change, instead of one that is named.

    Raises:
        HypermapError: If the middleware is missing, an argument or parameter is wrong, or the map
            cannot be read.
    """
    from hypermap.ros.server.map_server import MapServer

    own, ros = split_arguments(argv)
    if len(own) > 1:
        raise HypermapError(f"the map server takes one map, not {len(own)}: {' '.join(own)}")
    with usual_end(), opened_port(MapServer, ros, middleware, dict(values or {}), address) as port:
        server = MapServer(port, own[0] if own else None, source)
        with nullcontext() if beside is None else beside(server):
            run_node(port, server)


def run_semantic_mapper(
    argv: Sequence[str] = (),
    *,
    middleware: Middleware = "auto",
    values: Mapping[str, Value] | None = None,
    address: Address | None = None,
) -> None:
    """Map what a robot's camera sees until Ctrl-C, SIGTERM or the middleware ends it.

    Arguments and errors are those of `run_map_server`; there is no map to name.
    """
    from hypermap.ros.mapper.semantic_mapper import SemanticMapper

    own, ros = split_arguments(argv)
    if own:
        raise HypermapError(f"the semantic mapper does not know the argument {own[0]!r}")
    with (
        usual_end(),
        opened_port(SemanticMapper, ros, middleware, dict(values or {}), address) as port,
    ):
        run_node(port, SemanticMapper(port))


def run_first_mapper(argv: Sequence[str] = ()) -> None:
    """Run the semantic mapper with the parameters of 2019; see `run_semantic_mapper`."""
    from hypermap.ros.mapper.first_mapper import FirstMapper

    own, ros = split_arguments(argv)
    if own:
        raise HypermapError(f"the semantic mapper does not know the argument {own[0]!r}")
    with usual_end(), opened_port(FirstMapper, ros, "ros1", {}) as port:
        run_node(port, FirstMapper(port))


def split_arguments(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return our own arguments and those that are meant for ROS.

    >>> split_arguments(["lab.hmap", "__name:=lab", "--ros-args", "-r", "a:=b", "--", "x"])
    (['lab.hmap', 'x'], ['__name:=lab', '--ros-args', '-r', 'a:=b', '--'])
    """
    own: list[str] = []
    ros: list[str] = []
    within = False
    for word in argv:
        if within or word == "--ros-args":
            ros.append(word)
            within = word != "--"
        else:
            (ros if ":=" in word else own).append(word)
    return own, ros


def found_middleware() -> Literal["ros1", "ros2"]:
    """Return the ROS that is there: that of `ROS_VERSION`, or else that which Python can import.

    Raises:
        HypermapError: If there is none.
    """
    version = os.environ.get("ROS_VERSION", "")
    if version in ("1", "2"):
        return "ros1" if version == "1" else "ros2"
    with contextlib.suppress(HypermapError, ImportError):
        import hypermap.ros.ros1.libraries  # noqa: F401 - whether it is there

        return "ros1"
    if importlib.util.find_spec("rclpy") is not None:
        return "ros2"
    raise HypermapError(_NO_ROS)


@contextmanager
def usual_end() -> Iterator[None]:
    """End the context on an interrupt as if it had ended by itself: nodes usually end that way."""
    try:
        yield
    except KeyboardInterrupt:
        # CPython remembers an interrupt that came within exec(), as when a dataclass is imported,
        # and would end by SIGINT whatever we return; the next exec() lets it forget.
        exec("")


@contextmanager
def opened_port(
    node: type[MapServer] | type[SemanticMapper],
    ros_arguments: Sequence[str],
    middleware: Middleware,
    values: Mapping[str, Value],
    address: Address | None = None,
) -> Iterator[Port]:
    """Yield the middleware for a node, and shut it down in the end.

    It takes signals already: one that comes before the node runs is for `usual_end`.

    Args:
        node: the node's class: its name, unless the ROS arguments give it another, and parameters.
        ros_arguments: what `split_arguments` gave for ROS.
        middleware: what to run on.
        values: parameters of the node that come before others.
        address: where to listen with Foxglove.

    Raises:
        HypermapError: If the middleware is missing or does not answer, or the node has no such
            parameter.
    """
    port = _port(node, ros_arguments, middleware, values, address)
    try:
        yield port
    finally:
        port.shut_down()


def _port(
    node: type[MapServer] | type[SemanticMapper],
    ros_arguments: Sequence[str],
    middleware: Middleware,
    values: Mapping[str, Value],
    address: Address | None,
) -> Port:
    from hypermap.ros.parameters import check_names

    name = node.NAME
    check_names(values, node.PARAMETERS)
    chosen = found_middleware() if middleware == "auto" else middleware
    if chosen == "ros1":
        from hypermap.ros.ros1.port import Ros1Port

        private = [f"_{key}:={_yaml(value)}" for key, value in values.items()]
        return Ros1Port(name, [name, *private_texts(ros_arguments, node.PARAMETERS), *private])
    if chosen == "ros2":
        from hypermap.ros.ros2.port import Ros2Port

        pairs = [word for key, value in values.items() for word in ("-p", f"{key}:={_yaml(value)}")]
        own = ["--ros-args", *pairs, "--"] if pairs else []
        return Ros2Port(name, [name, *ros_arguments, *own])
    if ros_arguments:
        raise HypermapError(
            f"{ros_arguments[0]!r} is an argument for ROS; without ROS, give --param NAME=VALUE"
        )
    from hypermap.ros.foxglove.port import FoxglovePort

    where = address or Address()
    return FoxglovePort(
        name,
        values,
        host=where.host,
        port=where.port,
        allow_edits=where.allow_edits,
        origins=where.origins,
    )


def run_node(port: Port, node: Node) -> None:
    """Let a node live: from its configuration until the middleware ends it.

    A port that manages the life of its node, as that of ROS 2 does, has a method `manage`, which
    takes the node and brings it to life as the middleware's users expect it. Where a callback of it
    does not end (`is_stuck`), the program ends all the same.
    """
    try:
        with usual_end():
            _live(port, node)
    finally:
        port.shut_down()
        if getattr(port, "is_stuck", False):
            from hypermap.ros.ros2.ending import end_program_soon

            end_program_soon()


def _live(port: Port, node: Node) -> None:
    manage = getattr(port, "manage", None)
    if manage is not None:
        manage(node)
        port.spin()
        return
    node.configure()
    try:
        node.activate()
        port.spin()
    finally:
        node.deactivate()
        node.cleanup()


def private_texts(arguments: Sequence[str], parameters: Sequence[Parameter]) -> list[str]:
    """Return arguments of ROS 1 in which texts stay as they are: rospy reads them as YAML.

    Raises:
        HypermapError: If one of them is a private parameter that the node has not.

    >>> from hypermap.ros.port import Parameter
    >>> file = Parameter("file", "", "A map.")
    >>> private_texts(["__name:=a", "_file:=room #2: x.hmap", "b:=c"], [file])
    ['__name:=a', '_file:="room #2: x.hmap"', 'b:=c']
    """
    from hypermap.ros.parameters import check_names

    texts = {parameter.name for parameter in parameters if isinstance(parameter.default, str)}
    found = []
    for word in arguments:
        key, _, value = word.partition(":=")
        if key.startswith("_") and not key.startswith("__"):
            check_names([key[1:]], parameters)
            if key[1:] in texts and value and value[0] not in "\"'":
                word = f"{key}:={_yaml(value)}"
        found.append(word)
    return found


def _yaml(value: Value) -> str:
    """Return a value as ROS reads it on its command line: JSON is YAML, and quotes texts."""
    return json.dumps(value if isinstance(value, (bool, int, float, str)) else list(value))
