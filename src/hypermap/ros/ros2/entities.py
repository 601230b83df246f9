"""What a ROS 2 node opens by name: publishers, subscriptions, services."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from rclpy.exceptions import NameValidationException

from hypermap.core.errors import HypermapError
from hypermap.ros.callbacks import Closing
from hypermap.ros.port import Message


class RclpyPublisher(Closing):
    """A publisher of rclpy as our nodes see it."""

    def __init__(self, node: Any, publisher: Any) -> None:
        super().__init__(lambda: node.destroy_publisher(publisher))
        self._publisher = publisher

    @property
    def listeners(self) -> int:
        """How many subscribers there are."""
        return int(self._publisher.get_subscription_count())

    def publish(self, message: Message) -> None:
        """Send a message; once closed, it goes nowhere: a callback may run a little longer."""
        if self._close is not None:
            self._publisher.publish(message)


def resolved(name: str) -> str:
    """Return a name as rclpy takes it: private to the node unless it starts with "/"."""
    return name if name.startswith("/") else f"~/{name}"


@contextlib.contextmanager
def valid(name: str) -> Iterator[None]:
    """Turn the refusal of a name into an error of its user."""
    try:
        yield
    except NameValidationException as error:
        reason = str(error).splitlines()[0].rstrip(":")
        raise HypermapError(f"ROS 2 does not allow the name {name!r}: {reason}") from None
