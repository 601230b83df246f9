"""How topics are named: those of a layer, and those that users name."""

from __future__ import annotations

import re

ROOM_GRAPH = "room_graph"
"""Topic of the doors and the graph of rooms."""
FRONTIERS = "frontiers"
"""Topic of the semantic mapper that says where a robot should look next."""


def topic_name(layer: str, suffix: str) -> str:
    """Return the name of a layer's topic or service, private to the node.

    Signs that ROS does not allow in names become `_`. A name that would then begin with a digit,
    which ROS 2 refuses, or with `_`, by which it hides topics, begins with "layer"; a layer whose
    own name begins with `_` stays hidden.

    >>> topic_name("occupancy", "map"), topic_name("2nd floor", "semmap")
    ('occupancy_map', 'layer_2nd_floor_semmap')
    >>> topic_name("Äpfel", "semmap"), topic_name("_mine", "map")
    ('layer_pfel_semmap', '_mine_map')
    """
    name = re.sub(r"[^A-Za-z0-9_]", "_", layer)
    if name[0].isdigit():
        name = f"layer_{name}"
    elif name[0] == "_" and layer[0] != "_":
        name = f"layer{name}"
    return f"{name}_{suffix}"


def named_by_user(name: str, node_name: str) -> str:
    """Return the full name of a topic that a user has named, as ROS resolves it.

    >>> named_by_user("depth/image_raw", "/robot1/mapper"), named_by_user("~in", "/robot1/mapper")
    ('/robot1/depth/image_raw', '/robot1/mapper/in')
    """
    if not name or name.startswith("/"):
        return name
    if name.startswith("~"):
        return f"{node_name}/{name[1:].lstrip('/')}"
    return f"{node_name.rpartition('/')[0]}/{name}"
