"""A WebSocket server for Foxglove and Lichtblick as a port of our nodes: no ROS is needed.

Messages are those of ROS 2: encoding `cdr`, schemas `ros2msg`.
Source: the Foxglove WebSocket protocol, by Foxglove's SDK.
"""

from __future__ import annotations

import contextlib
import logging
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FrameError, HypermapError, MissingExtra
from hypermap.recordings.messages.transforms import TransformLog
from hypermap.ros import typestore
from hypermap.ros.callbacks import Closing, guarded
from hypermap.ros.log_text import log_text
from hypermap.ros.parameters import check_names, checked
from hypermap.ros.port import Closable, Level, Message, Parameter, Publisher, Value
from hypermap.ros.signals import end_signals
from hypermap.ros.throttle import Throttle

try:
    import foxglove
    from foxglove.websocket import Capability

    from hypermap.ros.foxglove.listener import Listener, Settings
    from hypermap.ros.foxglove.topics import (
        CDR,
        ChannelPublisher,
        Inbox,
        message_schema,
        schema_of,
    )
    from hypermap.web.gate import Gate, hidden_address
except ImportError:
    raise MissingExtra("the server for Foxglove", "foxglove") from None

_LOOK_PERIOD = 0.2  # s
# Services that change a map or a file.
_EDITING = {"load_map", "store_map", "save_map", "clear", "find_rooms"}
_LEVELS: dict[Level, tuple[int, int]] = {  # of Python, of rcl_interfaces/Log
    "debug": (logging.DEBUG, 10),
    "info": (logging.INFO, 20),
    "warning": (logging.WARNING, 30),
    "error": (logging.ERROR, 40),
}


class FoxglovePort:
    """A node that Foxglove and Lichtblick reach without ROS.

    A latched topic is sent again when someone subscribes to it, to all its subscribers. Frames are
    those alone that the node itself makes known.

    Args:
        name: the node's name.
        values: parameters of the node.
        host: address to listen on; 127.0.0.1 is for programs on this machine alone.
        port: port to listen on; 0 for any that is free.
        allow_edits: whether clients may publish, and call services that change the map or files.
        origins: of websites that are let in, in addition to Foxglove's own and those of this
            machine.

    Raises:
        HypermapError: If it cannot listen there.
    """

    def __init__(
        self,
        name: str,
        values: Mapping[str, Value] | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 8765,
        allow_edits: bool = False,
        origins: Sequence[str] = (),
    ) -> None:
        self._name = f"/{name.strip('/')}"
        self._host = host
        self._logger = _terminal(self._name)
        self._throttle = Throttle(self.log)
        self._given = dict(values or {})
        self._transforms = TransformLog()
        self._tf_static: Publisher | None = None
        self._lock = threading.Lock()
        self._is_stopped = False
        self._is_ending = False  # no event: a handler of signals could wait for its lock
        self._is_spinning = False
        self._handlers: dict[int, Any] = {}
        self._sender = ThreadPoolExecutor(1, thread_name_prefix="latched")
        self._context = foxglove.Context()
        self._listener = Listener(f"{self._name}.", self.log)
        self._rosout: Publisher | None = None
        self._allow_edits = allow_edits
        hidden = hidden_address()
        self._server = self._start_server(hidden)
        self._gate = self._open_gate(port, (hidden, self._server.port), origins)
        self._handle_signals()
        self._rosout = self.publisher("/rosout", "rcl_interfaces/Log")
        self.log("info", f"open {self.url} in Foxglove or Lichtblick (Foxglove WebSocket)")

    def _start_server(self, host: str) -> Any:
        """Return the SDK's server, on any free port of an address that is not disclosed."""
        can = [Capability.Parameters, Capability.Services]
        try:
            return foxglove.start_server(
                name=f"Hypermap {self._name}",
                host=host,
                port=0,
                capabilities=[*can, Capability.ClientPublish] if self._allow_edits else can,
                supported_encodings=[CDR],
                server_listener=self._listener,
                context=self._context,
            )
        except RuntimeError as error:
            raise HypermapError(f"the server for Foxglove does not start: {error}") from None

    def _open_gate(self, port: int, behind: tuple[str, int], origins: Sequence[str]) -> Gate:
        """Return the gate in front of the server, on the address and port that clients use."""
        try:
            return Gate(self._host, port, behind, origins, self._refused)
        except (OSError, OverflowError) as error:
            self._server.stop()
            reason = getattr(error, "strerror", None) or error
            raise HypermapError(
                f"cannot listen on {self._host}, port {port}: {reason}; give another --port or "
                "--host"
            ) from None

    def _refused(self, reason: str) -> None:
        """Log why a connection was refused, but seldom: anybody can open as many as they like."""
        kind = reason[:12]  # what comes before any name that the client has given
        self._throttle.log("warning", kind, reason)

    @property
    def url(self) -> str:
        """Where to connect to, as "ws://127.0.0.1:8765"."""
        return f"ws://{self._host}:{self._gate.port}"

    @property
    def node_name(self) -> str:
        """The node's full name."""
        return self._name

    # Types

    def message(self, type_name: str) -> type[Any]:
        """Return the class of a message."""
        return typestore.message_class(type_name)

    def response(self, type_name: str) -> type[Any]:
        """Return the class of a service's response."""
        return typestore.response_class(type_name)

    # Communication

    def publisher(self, topic: str, type_name: str, *, latched: bool = False) -> Publisher:
        """Publish on a topic."""
        cls = typestore.message_class(type_name)
        schema = schema_of(cls, cls.__msgtype__)
        channel = foxglove.Channel(
            self._resolved(topic), schema=schema, message_encoding=CDR, context=self._context
        )
        publisher = ChannelPublisher(channel, latched, self._sender)
        self._listener.watch(channel.id(), publisher.count)
        return publisher

    def topic_type(self, topic: str) -> str | None:  # noqa: ARG002 - clients say it as they come
        """Return None: topics that clients publish have no type before they do."""
        return None

    def subscribe(
        self,
        topic: str,
        type_name: str,
        callback: Callable[[Message], None],
        *,
        latched: bool = False,  # noqa: ARG002 - clients keep nothing for later
        queue: int = 1,
    ) -> Closable:
        """Call back with each message of a topic."""
        box = Inbox(self._resolved(topic), type_name, callback, queue, self.log)
        self._listener.inboxes.append(box)

        def close() -> None:
            box.close()
            self._listener.inboxes.remove(box)

        return Closing(close)

    def service(
        self,
        name: str,
        type_name: str,
        handler: Callable[[Message], Message],
        failed: Callable[[str], Message],  # noqa: ARG002 - these services can fail
    ) -> Closable:
        """Offer a service."""
        full = self._resolved(name)
        request = typestore.request_class(type_name)
        response = typestore.response_class(type_name)
        service_type = type_name.replace("/srv/", "/").replace("/", "/srv/")

        def handle(call: foxglove.ServiceRequest) -> bytes:
            try:
                if name in _EDITING and not self._allow_edits:
                    raise HypermapError(
                        "clients are read-only: start the node with --allow-edits to let them "
                        "change the map and files"
                    )
                if call.encoding != CDR:
                    raise HypermapError(f"the request is {call.encoding!r}, not {CDR!r}")
                return typestore.encode(handler(typestore.decode(call.payload, request)))
            except HypermapError as error:
                self.log("error", f"{full}: {error}")
                raise
            except Exception:
                self.log("error", f"{full}: {traceback.format_exc()}")
                raise

        schema = foxglove.ServiceSchema(
            service_type,
            request=message_schema(request, f"{service_type}_Request"),
            response=message_schema(response, f"{service_type}_Response"),
        )
        service = foxglove.Service(full, schema=schema, handler=handle)
        self._while_it_runs(lambda: self._server.add_services([service]))
        return Closing(lambda: self._while_it_runs(lambda: self._server.remove_services([full])))

    def timer(self, period: float, callback: Callable[[], None]) -> Closable:
        """Call back every `period` seconds."""
        ended = threading.Event()

        def work() -> None:
            while not ended.wait(period):
                guarded(self.log, "in a timer", callback)

        threading.Thread(target=work, name="timer", daemon=True).start()
        return Closing(ended.set)

    # Frames and time

    def now(self) -> int:
        """Return the time [ns]."""
        return time.time_ns()

    def stamp(self, nanoseconds: int) -> Message:
        """Return a time as messages carry it."""
        return typestore.stamp(nanoseconds)

    def static_transforms(self, transforms: Sequence[Message]) -> None:
        """Make transforms known to everyone."""
        message = self.message("tf2_msgs/TFMessage")(transforms=list(transforms))
        known = TransformLog()
        known.add(message, is_static=True)
        self._transforms = known
        if self._tf_static is None:
            self._tf_static = self.publisher("/tf_static", "tf2_msgs/TFMessage", latched=True)
        self._tf_static.publish(message)

    def lookup(
        self,
        target: str,
        source: str,
        stamp: int | None = None,  # noqa: ARG002 - what is known does not move
        timeout: float = 0.0,  # noqa: ARG002 - nothing more can come
    ) -> NDArray[np.float64]:
        """Return `target_T_source`, shape (4, 4)."""
        if target == source:
            return np.eye(4)
        try:
            frames, _ = self._transforms.frames(max_gap=0.0)
            pose: NDArray[np.float64] = frames.motion(target, source).at([0.0])[0]
        except FrameError as error:
            raise FrameError(f"no transform from {source!r} to {target!r}: {error}") from None
        return pose

    def forget_transforms(self) -> None:
        """Do nothing: what is known does not move."""

    # The node itself

    def parameters(
        self,
        parameters: Sequence[Parameter],
        on_change: Callable[[Mapping[str, Value]], None] | None = None,
    ) -> dict[str, Value]:
        """Declare parameters and return their values."""
        known = {parameter.name: parameter for parameter in parameters}
        check_names(self._given, parameters)
        values = {
            name: checked(parameter, self._given.get(name, parameter.default))
            for name, parameter in known.items()
        }
        self._listener.settings = Settings(known, values, on_change)
        return dict(values)

    def origins(self) -> Mapping[str, str]:
        """Return where the values of parameters were given, in words."""
        return dict.fromkeys(self._given, "as an argument")

    def log(self, level: Level, text: str) -> None:
        """Write a line to the node's log and to /rosout."""
        text = log_text(text)
        of_python, of_ros = _LEVELS[level]
        self._logger.log(of_python, "%s", text)
        if self._rosout is not None and self._rosout.listeners:
            line = self.message("rcl_interfaces/Log")(
                stamp=self.stamp(self.now()), level=of_ros, name=self._name, msg=text
            )
            self._rosout.publish(line)

    @property
    def is_shut_down(self) -> bool:
        """Whether the node is to end."""
        return self._is_ending

    def spin(self) -> None:
        """Return when the node is to end."""
        self._is_spinning = True
        while not self._is_ending:
            time.sleep(_LOOK_PERIOD)
        self._is_spinning = False

    def shut_down(self) -> None:
        """End the node and the connections of its clients."""
        self._is_ending = True
        with self._lock:
            was_stopped, self._is_stopped = self._is_stopped, True
        if not was_stopped:
            self._server.stop()
            self._gate.close()
            self._sender.shutdown(wait=False, cancel_futures=True)
        if threading.current_thread() is threading.main_thread():
            while self._handlers:
                signal.signal(*self._handlers.popitem())

    def _handle_signals(self) -> None:
        """Let signals end the node, also while it still starts."""

        def end(_number: int, _frame: FrameType | None) -> None:
            self._is_ending = True
            if not self._is_spinning:
                raise KeyboardInterrupt

        if threading.current_thread() is threading.main_thread():
            for number in end_signals():
                self._handlers[number] = signal.signal(number, end)

    def _while_it_runs(self, change: Callable[[], None]) -> None:
        """Change the services, unless the server ends: it cannot do both at once."""
        with self._lock:
            if not self._is_stopped:
                change()

    def _resolved(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._name}/{name}"


class _StandardError(logging.Handler):
    """Writes lines where standard error is at that time."""

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError, ValueError):  # closed
            sys.stderr.write(self.format(record) + "\n")
            sys.stderr.flush()


def _terminal(name: str) -> logging.Logger:
    """Return what writes the log of a node on standard error, as rospy and rclpy do."""
    handler = _StandardError()
    handler.setFormatter(logging.Formatter("[%(levelname)s] [%(name)s]: %(message)s"))
    logger = logging.getLogger(name)
    logger.handlers = [handler]
    logger.setLevel(logging.INFO)
    logger.propagate = False
    return logger
