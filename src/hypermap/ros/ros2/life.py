"""The lifecycle of a ROS 2 node, mapped on that of our nodes."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode as RclpyNode
from rclpy.lifecycle import TransitionCallbackReturn

from hypermap.core.errors import HypermapError
from hypermap.ros.port import Level, Node
from hypermap.ros.ros2.bond import Bond

_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class LifecycleNode(RclpyNode):  # type: ignore[misc] # rclpy carries no types here
    """Calls one of our nodes as ROS's lifecycle goes.

    A transition that fails is logged, and leaves the node in the state that it was in.

    Args:
        name: the node's name, unless the program's arguments remap it.
        log: writes a line to the log.
    """

    def __init__(self, name: str, log: Callable[[Level, str], None]) -> None:
        self._ours: Node | None = None
        self._write = log
        self._error: Exception | None = None
        self._starting = False
        self._finalized = False
        self._bond: Bond | None = None
        self._is_configured = self._is_active = False  # ours, also amid a transition
        super().__init__(name)

    def manage(self, node: Node) -> None:
        """Call this node from now on."""
        self._ours = node

    def start(self) -> None:
        """Configure and activate.

        Raises:
            HypermapError: If the node cannot; others are bugs.
        """
        self._starting = True
        try:
            for trigger in (self.trigger_configure, self.trigger_activate):
                if trigger() != _SUCCESS:
                    raise self._error or HypermapError("ROS 2 refuses to start the node")
        finally:
            self._starting = False

    def finish(self) -> None:
        """Let the node end, from whatever state it is in."""
        if self._finalized:
            return
        try:
            self.trigger_shutdown()
        except Exception as error:  # ROS knows no way to the end from amid a transition
            self._write("debug", f"ROS 2 does not shut the node down: {error}")
            self._end()

    def on_configure(self, state: Any) -> Any:  # noqa: ARG002
        """Answer the transition "configure"."""
        return self._outcome("configure")

    def on_activate(self, state: Any) -> Any:  # noqa: ARG002
        """Answer the transition "activate"; what a failed one has begun is undone."""
        outcome = self._outcome("activate")
        if outcome != _SUCCESS:
            error, self._error = self._error, None
            self._outcome("deactivate")
            self._error = error
            return outcome
        try:
            self._bond = Bond(self)
        except HypermapError as error:  # then there is no manager of nav2's, either
            self._write("debug", f"no bond with a lifecycle manager: {error}")
        return outcome

    def on_deactivate(self, state: Any) -> Any:  # noqa: ARG002
        """Answer the transition "deactivate"."""
        self._break_bond()
        return self._outcome("deactivate")

    def on_cleanup(self, state: Any) -> Any:  # noqa: ARG002
        """Answer the transition "cleanup"."""
        return self._outcome("cleanup")

    def on_shutdown(self, state: Any) -> Any:  # noqa: ARG002
        """Answer the transition "shutdown"; nothing keeps it from happening."""
        self._end()
        return _SUCCESS

    def _end(self) -> None:
        self._finalized = True
        self._break_bond()
        if self._is_active:
            self._outcome("deactivate")
        if self._is_configured:
            self._outcome("cleanup")

    def _break_bond(self) -> None:
        bond, self._bond = self._bond, None
        if bond is not None:
            bond.break_()

    def _outcome(self, step: str) -> Any:
        try:
            if self._ours is None:
                raise HypermapError("the node is not ready yet")
            self._is_active |= step == "activate"  # what is undone if it fails
            getattr(self._ours, step)()
            self._is_configured |= step == "configure"
            self._is_active &= step != "deactivate"
            self._is_configured &= step != "cleanup"
        except Exception as error:
            self._error = error
            if not self._starting:
                known = isinstance(error, HypermapError)
                self._write("error", f"{step}: {error if known else traceback.format_exc()}")
            return _FAILURE
        return _SUCCESS
