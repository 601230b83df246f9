"""What a node needs from its middleware: a ROS 1 or ROS 2 node, or Foxglove.

Names of topics and services are private to the node unless they start with "/". Callbacks and
handlers may be called from several threads at once: what they share guards itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Level = Literal["debug", "info", "warning", "error"]
Value = bool | int | float | str | Sequence[str]
Message = Any  # of the middleware's own class


@dataclass(frozen=True)
class Parameter:
    """A setting of a node that its operator may give.

    Attributes:
        name: its name; private to the node.
        default: its value if none is given; its type is that of the parameter.
        description: what it does, in one sentence.
        minimum: smallest number allowed.
        maximum: largest number allowed.
        choices: the texts allowed; empty for any.
        changes: whether it may be changed while the node runs.
        once: whether a value holds for one run alone. The parameter server of ROS 1, which outlives
            nodes, forgets it as soon as it is read.
    """

    name: str
    default: Value
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    changes: bool = False
    once: bool = False


class Closable(Protocol):
    """Something that lasts until it is closed: a subscription, a service, a timer."""

    def close(self) -> None:
        """End it; closing twice does no harm."""
        ...


class Publisher(Closable, Protocol):
    """Publishes messages of one type on one topic."""

    @property
    def listeners(self) -> int:
        """How many subscribers there are."""
        ...

    def publish(self, message: Message) -> None:
        """Send a message; a latched topic keeps it for those that come later."""
        ...


class Port(Protocol):
    """The middleware, as a node sees it."""

    @property
    def node_name(self) -> str:
        """The node's full name, as "/hypermap_server"."""
        ...

    # Types

    def message(self, type_name: str) -> type[Any]:
        """Return the class of a message, as of "nav_msgs/OccupancyGrid".

        Raises:
            MissingExtra: If its package is not installed.
        """
        ...

    def response(self, type_name: str) -> type[Any]:
        """Return the class of a service's response, as of "nav_msgs/GetMap"."""
        ...

    # Communication

    def publisher(self, topic: str, type_name: str, *, latched: bool = False) -> Publisher:
        """Publish on a topic."""
        ...

    def topic_type(self, topic: str) -> str | None:
        """Return the type of a topic's messages, if the middleware knows it by now."""
        ...

    def subscribe(
        self,
        topic: str,
        type_name: str,
        callback: Callable[[Message], None],
        *,
        latched: bool = False,
        queue: int = 1,
    ) -> Closable:
        """Call back with each message of a topic.

        Args:
            topic: its name.
            type_name: type of its messages.
            callback: takes a message. What it raises is logged; the node goes on.
            latched: whether the publisher latches its last message. In ROS 2 this decides whether
                that message is received.
            queue: how many messages wait; older ones are dropped.
        """
        ...

    def service(
        self,
        name: str,
        type_name: str,
        handler: Callable[[Message], Message],
        failed: Callable[[str], Message],
    ) -> Closable:
        """Offer a service.

        Args:
            name: its name.
            type_name: its type.
            handler: takes the request and returns the response. A HypermapError that it raises is
                logged and reaches the caller as the service's error, if the middleware has
                service errors.
            failed: makes the response that carries an error's text as well as it can, for a
                middleware whose services cannot fail: ROS 2.
        """
        ...

    def timer(self, period: float, callback: Callable[[], None]) -> Closable:
        """Call back every `period` seconds."""
        ...

    # Frames and time

    def now(self) -> int:
        """Return the time [ns], of the simulator if there is one."""
        ...

    def stamp(self, nanoseconds: int) -> Message:
        """Return a time as messages carry it."""
        ...

    def static_transforms(self, transforms: Sequence[Message]) -> None:
        """Make `geometry_msgs/TransformStamped` known to everyone, now and later.

        Transforms that were given in an earlier call and not in this one are forgotten where the
        middleware can forget.
        """
        ...

    def lookup(
        self, target: str, source: str, stamp: int | None = None, timeout: float = 0.0
    ) -> NDArray[np.float64]:
        """Return `target_T_source`, shape (4, 4), as tf knows it.

        Args:
            target: a frame.
            source: a frame.
            stamp: when [ns]; None for the latest.
            timeout: seconds to wait for it.

        Raises:
            FrameError: If tf does not know it, or not at that time.
        """
        ...

    def forget_transforms(self) -> None:
        """Forget where moving frames were, which tf would hold against what comes.

        It takes nothing that is much older than the newest it knows: call this after the clock
        has jumped back. Fixed frames stay.
        """
        ...

    # The node itself

    def parameters(
        self,
        parameters: Sequence[Parameter],
        on_change: Callable[[Mapping[str, Value]], None] | None = None,
    ) -> dict[str, Value]:
        """Declare parameters and return their values.

        Args:
            parameters: all of a node.
            on_change: called with the new values of those that changed while the node runs.

        Raises:
            HypermapError: If a value is of a different type, or not allowed.
        """
        ...

    def origins(self) -> Mapping[str, str]:
        """Return where the values of parameters were given, in words, for those that were."""
        ...

    def log(self, level: Level, text: str) -> None:
        """Write a line to the node's log."""
        ...

    @property
    def is_shut_down(self) -> bool:
        """Whether the node is to end."""
        ...

    def spin(self) -> None:
        """Return when the node should end: on Ctrl-C, on `shut_down`, or on request."""
        ...

    def shut_down(self) -> None:
        """End the node."""
        ...


class Node(Protocol):
    """One of our nodes, made on a port; ROS 2 calls these as its lifecycle does."""

    def configure(self) -> None:
        """Read the parameters and load what they name.

        Raises:
            HypermapError: If a parameter or a file is wrong; the node is as it was before.
        """
        ...

    def activate(self) -> None:
        """Publish, serve and subscribe."""
        ...

    def deactivate(self) -> None:
        """Stop that; what was loaded stays."""
        ...

    def cleanup(self) -> None:
        """Forget what was loaded."""
        ...
