"""What clients of a Foxglove WebSocket server do: subscribe, publish, read and set parameters."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import foxglove
from foxglove.websocket import ChannelView, Client, ClientChannel, ServerListener

from hypermap.core.errors import HypermapError
from hypermap.ros.foxglove.topics import CDR, Inbox, Log
from hypermap.ros.parameters import checked
from hypermap.ros.port import Parameter, Value


@dataclass
class Settings:
    """The parameters of a node.

    Attributes:
        parameters: those declared, by their names.
        values: their values.
        on_change: called with the new values of parameters that a client has changed.
    """

    parameters: Mapping[str, Parameter]
    values: dict[str, Value]
    on_change: Callable[[Mapping[str, Value]], None] | None = None

    def change(self, name: str, value: Any) -> None:
        """Set a parameter while the node runs.

        Raises:
            HypermapError: If there is none of that name, it may not change now, or the value is
                not allowed; it keeps its value.
        """
        parameter = self.parameters.get(name)
        if parameter is None:
            raise HypermapError(f"there is no parameter {name!r}")
        if not parameter.changes or self.on_change is None:
            raise HypermapError(f"parameter {name!r} can be set only when the node starts")
        before, new = self.values[name], checked(parameter, value)
        if new == before:
            return
        self.values[name] = new
        try:
            self.on_change({name: new})
        except HypermapError:
            self.values[name] = before
            raise


class Listener(ServerListener):
    """Brings what clients do to those whom it concerns.

    The server calls it from its own threads and must not be made to wait.

    Attributes:
        settings: the node's parameters.
        inboxes: who takes messages that clients publish.
    """

    def __init__(self, prefix: str, log: Log) -> None:
        self.settings = Settings({}, {})
        self.inboxes: list[Inbox] = []
        self._watched: dict[int, Callable[[int], None]] = {}
        self._early: dict[int, int] = {}
        self._lock = threading.Lock()
        self._prefix = prefix
        self._log = log
        self._channels: dict[tuple[int, int], ClientChannel] = {}

    # Topics of the node

    def watch(self, channel: int, on_change: Callable[[int], None]) -> None:
        """Tell someone how many subscribers of a channel come or go, from its beginning on.

        Clients may subscribe as soon as there is a channel, so before it has a publisher.
        """
        with self._lock:
            self._watched[channel] = on_change
            if early := self._early.pop(channel, 0):
                on_change(early)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Tell a channel's publisher of one more subscriber."""
        self._count(channel.id, +1)

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Tell a channel's publisher of one less."""
        self._count(channel.id, -1)

    def _count(self, channel: int, change: int) -> None:
        with self._lock:
            on_change = self._watched.get(channel)
            if on_change is None:
                self._early[channel] = self._early.get(channel, 0) + change
            else:
                on_change(change)  # one at a time: the server has many threads

    # Topics of clients

    def on_client_advertise(self, client: Client, channel: ClientChannel) -> None:
        """Remember what a client is to publish, if it can be understood."""
        wanted = [box for box in self.inboxes if box.topic == channel.topic]
        for box in wanted:
            expected = box.cls.__msgtype__
            if channel.encoding != CDR:
                self._log(
                    "error",
                    f"a client wants to publish {channel.topic} as {channel.encoding!r}; {CDR!r} "
                    "alone is understood",
                )
                return
            if channel.schema_name.replace("/msg/", "/") != expected.replace("/msg/", "/"):
                self._log(
                    "error",
                    f"a client wants to publish {channel.schema_name} on {channel.topic}, which "
                    f"takes {expected}",
                )
                return
        self._channels[client.id, channel.id] = channel

    def on_client_unadvertise(self, client: Client, client_channel_id: int) -> None:
        """Forget what a client was to publish."""
        self._channels.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Client, client_channel_id: int, data: bytes) -> None:
        """Take a message to those who wait for it."""
        channel = self._channels.get((client.id, client_channel_id))
        if channel is None:
            return
        for box in tuple(self.inboxes):  # one of them may be closed meanwhile
            if box.topic == channel.topic:
                box.put(data)

    # Parameters

    def on_get_parameters(
        self,
        client: Client,  # noqa: ARG002
        param_names: list[str],
        request_id: str | None = None,  # noqa: ARG002
    ) -> list[foxglove.Parameter]:
        """Return the parameters asked for; all of them where none is named."""
        return self._described(
            param_names or [self._prefix + name for name in self.settings.values]
        )

    def on_set_parameters(
        self,
        client: Client,  # noqa: ARG002
        parameters: list[foxglove.Parameter],
        request_id: str | None = None,  # noqa: ARG002
    ) -> list[foxglove.Parameter]:
        """Set parameters; return them as they are now, whether that went well or not."""
        for parameter in parameters:
            self._set(parameter)
        return self._described([parameter.name for parameter in parameters])

    def _set(self, parameter: foxglove.Parameter) -> None:
        try:
            self.settings.change(self._own_name(parameter.name), parameter.get_value())
        except HypermapError as error:
            self._log("error", str(error))
        except Exception as error:  # the server would only say that something is wrong
            self._log("error", f"parameter {parameter.name} could not be set: {error}")

    def _own_name(self, name: str) -> str:
        return name.removeprefix(self._prefix)

    def _described(self, names: Sequence[str]) -> list[foxglove.Parameter]:
        values = self.settings.values
        found = ((name, values.get(self._own_name(name))) for name in names)
        return [
            foxglove.Parameter(
                name, value=value if isinstance(value, (bool, int, float, str)) else list(value)
            )
            for name, value in found
            if value is not None
        ]
