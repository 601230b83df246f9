"""How the topics and services of a layer are named."""

from __future__ import annotations

import re


def topic_name(layer: str, suffix: str) -> str:
    """Return the name of a layer's topic or service, private to the node.

    Signs that ROS does not allow in names become `_`, and a name that starts with a digit gets one
    in front, which ROS 2 wants.

    >>> topic_name("occupancy", "map"), topic_name("2nd floor", "semmap")
    ('occupancy_map', '_2nd_floor_semmap')
    """
    name = re.sub(r"[^A-Za-z0-9_]", "_", layer)
    return f"_{name}_{suffix}" if name[0].isdigit() else f"{name}_{suffix}"
