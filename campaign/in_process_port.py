"""The middleware without a network: what Foxglove's port does with bytes, in this process."""

# ruff: noqa: D102  (`Port` says what they do)

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hypermap.core.arrays import FloatArray
from hypermap.core.errors import FrameError
from hypermap.ros import typestore
from hypermap.ros.callbacks import Closing
from hypermap.ros.parameters import checked
from hypermap.ros.typestore import decode, encode, message_class, request_class, response_class

_LINES = 10  # of the log that are kept


class _Closable(Closing):
    """A publisher to whom nobody listens, a subscription, a service or a timer."""

    listeners = 1

    def __init__(self, close: Callable[[], object] = lambda: None) -> None:
        super().__init__(close)

    def publish(self, message: Any) -> None:
        encode(message)


class InProcessPort:
    """A port that hands bytes to a node as Foxglove's does, without a network between.

    Attributes:
        services: of the node; each takes a request, and returns the response, as CDR.
        topics: that the node listens to; each takes a message as CDR.
        clock: what time it is [ns].
        lines: what the node logged last.
        levels: how many lines it logged at each level.
    """

    node_name = "/hypermap"
    is_shut_down = False

    def __init__(self, **parameters: Any) -> None:
        """Open a port for a node, with the values of its parameters that are not the defaults."""
        self.services: dict[str, Callable[[bytes], bytes]] = {}
        self.topics: dict[str, Callable[[bytes], None]] = {}
        self.clock = 1_600_000_000_000_000_000
        self.lines: list[tuple[str, str]] = []
        self.levels: Counter[str] = Counter()
        self._parameters = parameters
        self._timers: list[Callable[[], None]] = []

    def tick(self) -> None:
        """Let the node's timers run once."""
        for callback in list(self._timers):
            callback()

    # What the node asks

    def message(self, type_name: str) -> type[Any]:
        return message_class(type_name)

    def response(self, type_name: str) -> type[Any]:
        return response_class(type_name)

    def publisher(self, *_: Any, **__: Any) -> _Closable:
        return _Closable()

    def subscribe(self, topic: str, type_name: str, callback: Any, **_: Any) -> _Closable:
        self.topics[topic] = lambda data: callback(decode(data, message_class(type_name)))
        return _Closable(lambda: self.topics.pop(topic, None))

    def service(self, name: str, type_name: str, handler: Any, *_: Any) -> _Closable:
        self.services[name] = lambda data: encode(handler(decode(data, request_class(type_name))))
        return _Closable(lambda: self.services.pop(name, None))

    def timer(self, _: float, callback: Callable[[], None]) -> _Closable:
        self._timers.append(callback)
        return _Closable(lambda: self._timers.remove(callback))

    def now(self) -> int:
        return self.clock

    def stamp(self, nanoseconds: int) -> Any:
        return typestore.stamp(nanoseconds)

    def static_transforms(self, transforms: Any) -> None:
        pass

    def lookup(self, target: str, source: str, stamp: int | None = None, *_: Any) -> FloatArray:
        if target == source:
            return np.eye(4)
        raise FrameError(f"no way leads from {source!r} to {target!r} at {stamp}")

    def forget_transforms(self) -> None:
        pass

    def parameters(self, parameters: Sequence[Any], *_: Any) -> dict[str, Any]:
        given = self._parameters
        return {p.name: checked(p, given.get(p.name, p.default)) for p in parameters}

    def origins(self) -> dict[str, str]:
        return {}

    def log(self, level: str, text: str) -> None:
        text.encode()  # as a terminal and /rosout do
        self.lines = [*self.lines[1 - _LINES :], (level, text)]
        self.levels[level] += 1
