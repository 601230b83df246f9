"""The middleware without a network: what Foxglove's port does with bytes, in this process."""

# ruff: noqa: D102  (`Port` says what they do)

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from hypermap.core.errors import FrameError
from hypermap.ros import typestore
from hypermap.ros.typestore import decode, encode, message_class, request_class, response_class


class _Silent:
    """A publisher to whom nobody listens, or a subscription."""

    listeners = 1

    def publish(self, message: Any) -> None:
        encode(message)

    def close(self) -> None:
        pass


class InProcessPort:
    """A port that hands bytes to a node as Foxglove's does, without a network between.

    Attributes:
        services: of the node; each takes a request, and returns the response, as CDR.
        topics: that the node listens to; each takes a message as CDR.
        lines: what the node logged last.
    """

    node_name = "/hypermap_server"
    is_shut_down = False

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.services: dict[str, Callable[[bytes], bytes]] = {}
        self.topics: dict[str, Callable[[bytes], None]] = {}
        self.lines: list[tuple[str, str]] = []
        self._values = values

    def message(self, type_name: str) -> type[Any]:
        return message_class(type_name)

    def response(self, type_name: str) -> type[Any]:
        return response_class(type_name)

    def publisher(self, *_: Any, **__: Any) -> _Silent:
        return _Silent()

    def subscribe(self, topic: str, type_name: str, callback: Any, **_: Any) -> _Silent:
        self.topics[topic] = lambda data: callback(decode(data, message_class(type_name)))
        return _Silent()

    def service(self, name: str, type_name: str, handler: Any, *_: Any) -> _Silent:
        self.services[name] = lambda data: encode(handler(decode(data, request_class(type_name))))
        return _Silent()

    def timer(self, *_: Any) -> _Silent:
        return _Silent()

    def now(self) -> int:
        return 1_600_000_000_000_000_000

    def stamp(self, nanoseconds: int) -> Any:
        return typestore.stamp(nanoseconds)

    def static_transforms(self, transforms: Any) -> None:
        pass

    def lookup(self, target: str, source: str, *_: Any) -> Any:
        raise FrameError(f"no way leads from {source!r} to {target!r}")

    def forget_transforms(self) -> None:
        pass

    def parameters(self, parameters: Any, *_: Any) -> dict[str, Any]:
        return {p.name: self._values.get(p.name, p.default) for p in parameters}

    def origins(self) -> dict[str, str]:
        return {}

    def log(self, level: str, text: str) -> None:
        text.encode()  # as a terminal and /rosout do
        self.lines = [*self.lines[-9:], (level, text)]
