"""A node of the real ROS 2 for the tests: it does what each line of its input says, in JSON."""

from __future__ import annotations

import contextlib
import json
import sys
import threading
import time
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosidl_runtime_py import message_to_ordereddict, set_message_fields
from rosidl_runtime_py.utilities import get_message, get_service

WAIT = 60.0  # s


class Client:
    """Each public method is something that can be asked for."""

    def __init__(self) -> None:
        rclpy.init()
        self._node = rclpy.create_node("tests")
        self._heard: dict[str, list[Any]] = {}
        self._open: dict[str, Any] = {}
        self._news = threading.Condition()
        threading.Thread(target=self._spin, daemon=True).start()

    def _spin(self) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        with contextlib.suppress(ExternalShutdownException):
            executor.spin()

    def call(self, service: str, type: str, **request: Any) -> Any:  # noqa: A002
        """Call a service and return its response."""
        kind = get_service(type)
        if service not in self._open:
            self._open[service] = self._node.create_client(kind, service)
        client = self._open[service]
        if not client.wait_for_service(WAIT):
            raise TimeoutError(f"there is no service {service}")
        filled = kind.Request()
        set_message_fields(filled, request)
        answered = threading.Event()
        future = client.call_async(filled)
        future.add_done_callback(lambda _: answered.set())
        if not answered.wait(WAIT):
            raise TimeoutError(f"{service} does not answer")
        return plain(future.result())

    def listen(self, topic: str, type: str, latched: bool = False) -> None:  # noqa: A002
        """Hear a topic from now on."""

        def note(message: Any) -> None:
            with self._news:
                self._heard[topic].append(message)
                self._news.notify_all()

        self._heard[topic] = []
        self._open[f"subscription {topic}"] = self._node.create_subscription(
            get_message(type), topic, note, _qos(latched)
        )

    def heard(self, topic: str, count: int = 1) -> Any:
        """Return what was heard, once it is as much as this, and forget it."""
        with self._news:
            if not self._news.wait_for(lambda: len(self._heard[topic]) >= count, WAIT):
                raise TimeoutError(f"{len(self._heard[topic])} of {count} messages on {topic}")
            messages, self._heard[topic] = self._heard[topic], []
        return [plain(message) for message in messages]

    def publish(self, topic: str, type: str, latched: bool = False, **fields: Any) -> None:  # noqa: A002
        """Publish a message, once somebody listens if it is not latched."""
        kind = get_message(type)
        if topic not in self._open:
            self._open[topic] = self._node.create_publisher(kind, topic, _qos(latched))
        message = kind()
        set_message_fields(message, fields)
        if not latched:
            end = time.monotonic() + WAIT
            while self._open[topic].get_subscription_count() == 0:
                if time.monotonic() > end:
                    raise TimeoutError(f"nobody listens to {topic}")
                time.sleep(0.02)
        self._open[topic].publish(message)

    def bond(self, name: str) -> None:
        """Form a bond as nav2's manager does, with the package bondpy."""
        from bondpy.bondpy import Bond

        made = self._open["bond"] = Bond(self._node, "bond", name)
        made.heartbeat_period = 0.1
        made.start()
        if not made.wait_until_formed(Duration(seconds=WAIT)):
            raise TimeoutError("the bond is not formed")

    def is_bond_broken(self) -> bool:
        """Whether that bond has ended."""
        return bool(self._open["bond"].is_broken())

    def names(self) -> Any:
        """Return the topics and services that there are, with their types, and the nodes."""
        return {
            "topics": dict(self._node.get_topic_names_and_types()),
            "services": dict(self._node.get_service_names_and_types()),
            "nodes": [
                f"{space.rstrip('/')}/{name}"
                for name, space in self._node.get_node_names_and_namespaces()
            ],
        }


def _qos(latched: bool) -> Any:
    durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=100, durability=durability, reliability=ReliabilityPolicy.RELIABLE)


def plain(message: Any) -> Any:
    """Return a message as JSON has it; bytes become numbers."""

    def value(found: Any) -> Any:
        if isinstance(found, dict):
            return {key: value(item) for key, item in found.items()}
        if isinstance(found, (list, tuple)):
            return [value(item) for item in found]
        return list(found) if isinstance(found, bytes) else found

    return value(message_to_ordereddict(message))


def main() -> None:
    client = Client()
    for line in sys.stdin:
        what = json.loads(line)
        try:
            answer = {"answer": getattr(client, what.pop("do"))(**what)}
        except Exception as error:
            answer = {"error": repr(error)}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
