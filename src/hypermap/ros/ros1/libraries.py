"""Finds the Python libraries of ROS 1 where its packages install them.

Debian installs rospy for the system's Python. A virtual environment of the same Python version can
use it as well, so its folder is looked into last, after the environment's own packages.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from hypermap.core.errors import HypermapError

_DEBIAN = Path("/usr/lib/python3/dist-packages")


def _find() -> None:
    if importlib.util.find_spec("rospy") is not None:
        return
    same_version = Path(f"/usr/bin/python3.{sys.version_info.minor}").exists()
    if same_version and (_DEBIAN / "rospy").is_dir():
        sys.path.append(str(_DEBIAN))
        return
    raise HypermapError(
        "rospy is missing: install ROS 1 (on Debian: apt-get install python3-rospy "
        "python3-tf2-ros), source its setup.bash, and use the Python version that it is for"
    )


_find()

import rosgraph  # noqa: E402
import rospy  # noqa: E402
import rospy.impl.paramserver as paramserver  # noqa: E402
import rospy.impl.registration as registration  # noqa: E402

try:
    import tf2_ros
except ImportError as missing:
    raise HypermapError(
        f"tf2_ros is missing ({missing}): install it, on Debian: apt-get install python3-tf2-ros"
    ) from None
from rospy.client import load_command_line_node_params  # noqa: E402

__all__ = [
    "load_command_line_node_params",
    "paramserver",
    "registration",
    "rosgraph",
    "rospy",
    "tf2_ros",
]
