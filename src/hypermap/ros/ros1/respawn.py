"""What a node that roslaunch starts again finds of its earlier life.

roslaunch sets parameters once, before the first start. Those that a node takes from the parameter
server, so that no other run reads them, would be missing in its next life (`respawn`).
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping, Sequence
from typing import Any

from hypermap.ros.ros1.libraries import rospy

RESPAWN = "respawn"
"""The private parameter in which a node's parameters wait for its next life."""


class Respawn:
    """Keeps parameters for the node's next life, under the same roslaunch alone.

    They wait on the parameter server, with the process of roslaunch that they are for.

    Args:
        words: arguments of the program; roslaunch adds `__log:=`.

    Attributes:
        parameters: the private parameter in which they wait, for a roscore that was restarted.
    """

    def __init__(self, words: Sequence[str]) -> None:
        is_launched = any(word.startswith("__log:=") for word in words)
        self._launcher = f"{socket.gethostname()} {os.getppid()}" if is_launched else ""
        self.parameters: dict[str, Any] = {}

    def taken(self) -> dict[str, Any]:
        """Return what the node's earlier life has kept, and take it from the parameter server."""
        self.parameters = {}
        kept = rospy.get_param(f"~{RESPAWN}", None)
        if kept is None:
            return {}
        rospy.delete_param(f"~{RESPAWN}")
        is_ours = isinstance(kept, Mapping) and bool(self._launcher)
        if not is_ours or kept.get("launcher") != self._launcher:
            return {}
        return dict(kept.get("values", {}))

    def keep(self, values: Mapping[str, Any]) -> None:
        """Keep parameters; without roslaunch, nothing is kept."""
        if self._launcher and values:
            self.parameters = {RESPAWN: {"launcher": self._launcher, "values": dict(values)}}
            rospy.set_param(f"~{RESPAWN}", self.parameters[RESPAWN])
