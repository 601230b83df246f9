"""A client of the Foxglove WebSocket protocol, as plain as can be: for tests alone.

Source: the Foxglove WebSocket protocol specification.
"""

from __future__ import annotations

import itertools
import json
import struct
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any

from websockets.sync.client import connect

from hypermap.ros.typestore import decode, encode, message_class, request_class, response_class

PATIENCE = 120.0  # s; the machine may be busy


class ServiceFailed(Exception):
    """The server has answered with a failure."""


class Client:
    """A connection; everything that comes is kept."""

    def __init__(self, url: str) -> None:
        self.texts: list[dict[str, Any]] = []
        self.messages: list[tuple[int, bytes]] = []  # id of the subscription, CDR
        self.stamps: list[int] = []  # of the messages, ns
        self.answers: dict[int, bytes] = {}  # by id of the call
        self._ids = itertools.count(1)
        self._topics: dict[int, str] = {}
        self._channel_ids: dict[int, int] = {}
        self._stack = ExitStack()
        self._socket = self._stack.enter_context(
            connect(
                url,
                subprotocols=["foxglove.sdk.v1"],
                max_size=None,
                open_timeout=PATIENCE,
                ping_interval=None,  # an answer may come late
            )
        )

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._stack.close()

    def wait(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE) -> Any:
        """Receive until a condition holds, be it of the server, and return what it returned."""
        end = time.monotonic() + timeout
        while not (answer := condition()):
            if time.monotonic() > end:
                raise AssertionError(f"no {what} after {timeout:g} s: {self.texts}")
            with suppress(TimeoutError):
                self._receive(0.05)
        return answer

    def settle(self, seconds: float = 0.3) -> None:
        """Receive until nothing has come for a while."""
        try:
            while True:
                self._receive(seconds)
        except TimeoutError:
            return

    def of(self, op: str) -> list[dict[str, Any]]:
        return [text for text in self.texts if text["op"] == op]

    def info(self) -> dict[str, Any]:
        return self.wait(lambda: self.of("serverInfo"), "serverInfo")[0]

    @property
    def channels(self) -> dict[str, dict[str, Any]]:
        """Channels by topic, without those that the server has taken back."""
        found: dict[str, dict[str, Any]] = {}
        for text in self.texts:
            if text["op"] == "advertise":
                found |= {channel["topic"]: channel for channel in text["channels"]}
            elif text["op"] == "unadvertise":
                found = {t: c for t, c in found.items() if c["id"] not in text["channelIds"]}
        return found

    @property
    def services(self) -> dict[str, dict[str, Any]]:
        """Services by name, without those that the server has taken back."""
        found: dict[str, dict[str, Any]] = {}
        for text in self.texts:
            if text["op"] == "advertiseServices":
                found |= {service["name"]: service for service in text["services"]}
            elif text["op"] == "unadvertiseServices":
                found = {n: s for n, s in found.items() if s["id"] not in text["serviceIds"]}
        return found

    def subscribe(self, topic: str) -> int:
        channel = self.wait(lambda: self.channels.get(topic), f"channel {topic}")
        number = next(self._ids)
        self._topics[number], self._channel_ids[number] = channel["schemaName"], channel["id"]
        self.send(op="subscribe", subscriptions=[{"id": number, "channelId": channel["id"]}])
        return number

    def _subscribe_again(self, text: dict[str, Any]) -> None:
        """Bear with the library: for a moment it does not know a channel that it has advertised."""
        for number, channel in self._channel_ids.items():
            if text["op"] == "status" and text["message"] == f"Unknown channel ID: {channel}":
                time.sleep(0.05)
                self.send(op="subscribe", subscriptions=[{"id": number, "channelId": channel}])

    def unsubscribe(self, number: int) -> None:
        self.send(op="unsubscribe", subscriptionIds=[number])

    def received(self, number: int) -> list[Any]:
        """Return the messages of a subscription so far."""
        cls = message_class(self._topics[number])
        return [decode(data, cls) for one, data in self.messages if one == number]

    def next(self, number: int, count: int = 1) -> Any:
        """Return the message `count` of a subscription, from 1."""
        return self.wait(lambda: self.received(number)[count - 1 :], f"message {count}")[0]

    def call(self, name: str, type_name: str, **fields: Any) -> Any:
        """Call a service and return its response."""
        return self.call_raw(name, type_name, encode(request_class(type_name)(**fields)))

    def call_raw(self, name: str, type_name: str, data: bytes, encoding: str = "cdr") -> Any:
        service = self.wait(lambda: self.services.get(name), f"service {name}")
        number, kind = next(self._ids), encoding.encode()
        head = struct.pack("<BIII", 2, service["id"], number, len(kind))
        self._socket.send(head + kind + data)

        def answer() -> Any:
            failures = [t for t in self.of("serviceCallFailure") if t["callId"] == number]
            if failures:
                raise ServiceFailed(failures[0]["message"])
            return self.answers.get(number)

        return decode(self.wait(answer, f"answer of {name}"), response_class(type_name))

    def advertise(self, topic: str, schema: str, encoding: str = "cdr") -> int:
        number = next(self._ids)
        channel = {"id": number, "topic": topic, "encoding": encoding, "schemaName": schema}
        self.send(op="advertise", channels=[channel])
        return number

    def publish(self, number: int, message: Any) -> None:
        self.publish_raw(number, encode(message))

    def publish_raw(self, number: int, data: bytes) -> None:
        self._socket.send(struct.pack("<BI", 1, number) + data)

    def parameters(self, *names: str) -> dict[str, Any]:
        return self._asked(op="getParameters", parameterNames=list(names))

    def set_parameters(self, **values: Any) -> dict[str, Any]:
        changes = [{"name": n.replace("__", "."), "value": v} for n, v in values.items()]
        return self._asked(op="setParameters", parameters=changes)

    def _asked(self, **text: Any) -> dict[str, Any]:
        number = str(next(self._ids))
        self.send(id=number, **text)
        answers = self.wait(
            lambda: [t for t in self.of("parameterValues") if t.get("id") == number], "parameters"
        )
        return {item["name"]: item.get("value") for item in answers[0]["parameters"]}

    def send(self, **text: Any) -> None:
        self._socket.send(json.dumps(text))

    def _receive(self, timeout: float) -> None:
        data = self._socket.recv(timeout=max(timeout, 0.0))
        if isinstance(data, str):
            self.texts.append(json.loads(data))
            self._subscribe_again(self.texts[-1])
        elif data[0] == 1:  # message: subscription, time [ns]
            number, stamp = struct.unpack_from("<IQ", data, 1)
            self.messages.append((number, data[13:]))
            self.stamps.append(stamp)
        elif data[0] == 3:  # answer: service, call, length of the encoding's name
            _, number, length = struct.unpack_from("<III", data, 1)
            self.answers[number] = data[13 + length :]
