"""Classes of ROS 2 messages and services, as their packages were built."""

from __future__ import annotations

import importlib
import os
from functools import cache
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.ros.definitions import PACKAGE


def message_class(type_name: str) -> type[Any]:
    """Return the class of a message, as of "nav_msgs/OccupancyGrid".

    Raises:
        HypermapError: If its package is not there.
    """
    return _class(type_name, "msg")


def service_class(type_name: str) -> type[Any]:
    """Return the class of a service, as of "nav_msgs/GetMap"; raises like `message_class`."""
    return _class(type_name, "srv")


@cache
def _class(type_name: str, kind: str) -> type[Any]:
    package, _, name = type_name.partition("/")
    try:
        found: type[Any] = getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError) as error:
        raise HypermapError(
            f"the ROS 2 type {type_name} is missing ({error}); {_remedy(package)}"
        ) from None
    return found


def _remedy(package: str) -> str:
    if package == PACKAGE:
        return (
            f"build it from Hypermap's folder ros/{PACKAGE}: colcon build --packages-select "
            f"{PACKAGE} in a workspace, then source its install/setup.bash"
        )
    if package == "darknet_ros_msgs":
        return (
            "build it from source, or set detections_type to vision_msgs/Detection2DArray "
            "(--detections-type vision)"
        )
    distribution = os.environ.get("ROS_DISTRO", "DISTRO")
    return f"apt-get install ros-{distribution}-{package.replace('_', '-')}"
