"""The state of a node as a message for `/diagnostics`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from hypermap.ros.messages.geometry_messages import Message, Types

TYPE = "diagnostic_msgs/DiagnosticArray"


def status_array(
    level: Literal["OK", "WARN", "ERROR"],
    name: str,
    message: str,
    values: Iterable[tuple[str, str]],
    types: Types,
    stamp: int,
) -> Message:
    """Return a `diagnostic_msgs/DiagnosticArray` of one status.

    Args:
        level: how the node fares.
        name: who reports on what, as "/semantic_mapper: mapping".
        message: that in a sentence.
        values: names of figures, and the figures.
        types: makes messages and their stamps.
        stamp: time of the report [ns].
    """
    kind = types.message("diagnostic_msgs/DiagnosticStatus")
    pair = types.message("diagnostic_msgs/KeyValue")
    status = kind()
    # Its constants are numbers in ROS 1 and bytes in ROS 2, and so is the field.
    status.level = getattr(kind, level)
    status.name = name.lstrip("/")
    status.message = message
    status.hardware_id = "none"
    status.values = [pair(key=key, value=value) for key, value in values]
    array = types.message(TYPE)()
    array.header.stamp = types.stamp(stamp)
    array.status = [status]
    return array
