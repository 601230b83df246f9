"""The roscore from a node's view: whether it runs, and whether it still knows the node."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import threading
import xmlrpc.client
from collections.abc import Callable, Mapping
from http.client import HTTPException
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

from hypermap.core.errors import HypermapError
from hypermap.ros.ros1.libraries import registration, rosgraph, rospy

_PERIOD = 1.0  # s between two looks
_ANSWER_TIME = 3.0  # s until a roscore counts as missing
_NO_ANSWER = (OSError, HTTPException, xmlrpc.client.Error, rosgraph.MasterException)
_log = logging.getLogger(__name__)


def require_master() -> None:
    """Return if there is a roscore.

    Raises:
        HypermapError: If none answers; `rospy.init_node` would wait for one forever.
    """
    uri = os.environ.get("ROS_MASTER_URI", "")
    try:
        uri = rosgraph.get_master_uri()
        place = urlsplit(uri)
        with socket.create_connection((place.hostname, place.port or 11311), _ANSWER_TIME):
            pass
        if rosgraph.is_master_online(uri):
            return
        problem = "what answers there is not a roscore"
    except (*_NO_ANSWER, ValueError) as error:
        problem = str(error)
    raise HypermapError(
        f"no roscore at ROS_MASTER_URI={uri or '(not set)'} ({problem}); "
        "start one with: roscore; or set ROS_MASTER_URI to where it runs"
    )


def why_unreachable(node_uri: str, master_uri: str) -> str | None:
    """Return why other nodes do not reach one by the address that it names; None if they may.

    The node itself notices nothing of it: it reaches the roscore, which tells others the address.
    """
    host, port = urlsplit(node_uri).hostname or "", urlsplit(node_uri).port or 0
    try:
        with socket.create_connection((host, port), _ANSWER_TIME) as own:
            address = own.getpeername()[0]
        master = socket.getaddrinfo(urlsplit(master_uri).hostname, None)[0][4][0]
    except (OSError, UnicodeError) as error:  # a name may be none at all, such as "a..b"
        return f"{host} is no address of this machine ({error})"
    if ip_address(address).is_loopback and not ip_address(master).is_loopback:
        return f"{host} is this machine for itself alone, and the roscore is at {master}"
    return None


def owns_its_name() -> bool:
    """Return whether the roscore knows no other node under this node's name."""
    try:
        uri = rosgraph.Master(rospy.get_name()).lookupNode(rospy.get_name())
    except rosgraph.MasterError:
        return True
    return bool(uri == rospy.get_node_uri())


class MasterWatch:
    """Looks at the roscore every now and then, in a thread of its own.

    A roscore that was started again knows nothing of its nodes. The watch then registers all
    topics, subscriptions and services of this node, and sets its parameters, once more. At first it
    warns if other nodes do not reach this one.

    Args:
        on_parameters: called with the private parameters of the node at each look.
        lost: returns those to set again on a roscore that has forgotten them.
        on_replaced: called when another node has registered under this node's name.
    """

    def __init__(
        self,
        on_parameters: Callable[[Mapping[str, Any]], None],
        lost: Callable[[], Mapping[str, Any]],
        on_replaced: Callable[[], None],
    ) -> None:
        self._on_parameters = on_parameters
        self._lost = lost
        self._on_replaced = on_replaced
        self._master = rosgraph.Master(rospy.get_name())
        self._run_id = self._get("/run_id")
        self._is_away = False
        self._is_registered = True
        self._ends = threading.Event()
        threading.Thread(target=self._run, name="roscore watch", daemon=True).start()

    def close(self) -> None:
        """Look no more."""
        self._ends.set()

    def _run(self) -> None:
        reason = why_unreachable(rospy.get_node_uri(), rosgraph.get_master_uri())
        if reason is not None and not rospy.is_shutdown():
            _log.warning(
                "other nodes do not reach this one: %s; set ROS_IP to its address in the network "
                "of the roscore",
                reason,
            )
        while not self._ends.wait(_PERIOD) and not rospy.is_shutdown():
            self._try_to_look()

    def _try_to_look(self) -> None:
        try:
            self._look()
        except _NO_ANSWER as error:
            if not self._is_away and not rospy.is_shutdown():
                _log.warning("the roscore does not answer (%s); waiting for it", error)
            self._is_away = True
        except Exception:
            _log.exception("while looking at the roscore")

    def _look(self) -> None:
        run_id = self._get("/run_id")
        uri = self._node_uri()
        self._is_away = False
        if uri not in (None, rospy.get_node_uri()):
            _log.error("another node has started under the name %s", rospy.get_name())
            self._on_replaced()
            return
        was_restarted = None not in (run_id, self._run_id) and run_id != self._run_id
        if uri is None or was_restarted or not self._is_registered:
            self._is_registered = False
            self._register()
            self._is_registered, self._run_id = True, run_id
            _log.warning("the roscore was started again; registered with it again")
        self._run_id = run_id or self._run_id
        self._on_parameters(self._get(rospy.get_name()) or {})

    def _node_uri(self) -> str | None:
        try:
            return str(self._master.lookupNode(rospy.get_name()))
        except rosgraph.MasterError:
            return None

    def _get(self, parameter: str) -> Any:
        try:
            return self._master.getParam(parameter)
        except rosgraph.MasterError:  # not set
            return None

    def _register(self) -> None:
        there = self._get(rospy.get_name()) or {}
        for name, value in self._lost().items():
            if name not in there:
                self._master.setParam(f"{rospy.get_name()}/{name}", value)
        uri = rospy.get_node_uri()
        topics = registration.get_topic_manager()
        with topics.lock:
            published, subscribed = topics.get_publications(), topics.get_subscriptions()
        for topic, kind in published:
            self._master.registerPublisher(topic, kind, uri)
        for topic, kind in subscribed:
            publishers = self._master.registerSubscriber(topic, kind, uri)
            for listener in registration.get_registration_listeners().listeners:
                with contextlib.suppress(AttributeError):  # only rospy's own manager connects
                    listener.publisher_update(topic, publishers)
        for service, service_uri in registration.get_service_manager().get_services():
            self._master.registerService(service, service_uri, uri)
