"""Topics of a Foxglove WebSocket server, in both directions, and how they describe their types."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import foxglove

from hypermap.ros.callbacks import Closing
from hypermap.ros.port import Level, Message
from hypermap.ros.typestore import decode, definition, encode, message_class

CDR = "cdr"
_ROS2MSG = "ros2msg"
Log = Callable[[Level, str], None]


class Inbox:
    """Takes the messages of a topic to a callback, in a thread of its own.

    Args:
        topic: the topic's full name.
        type_name: type of its messages.
        callback: takes a message; what it raises is logged.
        queue: how many messages wait; older ones are dropped.
        log: takes a level and a line.
    """

    def __init__(
        self,
        topic: str,
        type_name: str,
        callback: Callable[[Message], None],
        queue: int,
        log: Log,
    ) -> None:
        self.topic = topic
        self.cls = message_class(type_name)
        self._callback = callback
        self._log = log
        self._waiting: deque[bytes] = deque(maxlen=queue)
        self._changed = threading.Condition()
        self._is_open = True
        threading.Thread(target=self._work, name=f"topic {topic}", daemon=True).start()

    def put(self, data: bytes) -> None:
        """Add a message to those that wait."""
        with self._changed:
            self._waiting.append(data)
            self._changed.notify()

    def close(self) -> None:
        """Let no more messages through."""
        with self._changed:
            self._is_open = False
            self._changed.notify()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or not self._is_open)
                if not self._is_open:
                    return
                data = self._waiting.popleft()
            try:
                self._callback(decode(data, self.cls))
            except Exception as error:  # a client may send anything; the node goes on
                self._log("error", f"a message on {self.topic} is left out: {error}")


class ChannelPublisher(Closing):
    """Publishes the messages of a channel.

    A latched message is sent again by a thread of ours, so that those of the server never wait.

    Args:
        channel: where.
        latched: whether the last message is sent again when a subscriber comes.
        sender: the thread that does so.

    Attributes:
        listeners: how many subscribers there are.
    """

    def __init__(
        self, channel: foxglove.Channel, latched: bool, sender: ThreadPoolExecutor
    ) -> None:
        super().__init__(channel.close)
        self._channel = channel
        self._latched = latched
        self._sender = sender
        self._lock = threading.Lock()
        self._last: bytes | None = None
        self.listeners = 0

    def publish(self, message: Message) -> None:
        """Send a message."""
        data = encode(message)
        with self._lock:
            self._last = data if self._latched else None
            self._channel.log(data)

    def count(self, change: int) -> None:
        """Handle a subscriber that comes or goes; called by a thread of the server."""
        self.listeners += change
        if change > 0 and self._latched:
            self._sender.submit(self._send_again)

    def _send_again(self) -> None:
        with self._lock:
            if self._last is not None:
                self._channel.log(self._last)


def schema_of(cls: type[Any], name: str) -> foxglove.Schema:
    """Return how a channel describes its type."""
    text = definition(cls)
    return foxglove.Schema(name=name, encoding=_ROS2MSG, data=text.encode())


def message_schema(cls: type[Any], name: str) -> foxglove.MessageSchema:
    """Return how a service describes its request or response."""
    return foxglove.MessageSchema(encoding=CDR, schema=schema_of(cls, name))
