"""Lets the tests of this folder import their helpers `shots` and `bag_builder`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

collect_ignore = ["ros_player.py"]  # a program for ROS's Python, which doctest would import
