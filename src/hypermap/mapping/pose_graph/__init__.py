"""Corrects poses without a map: matches frames to each other, and closes loops.

Start at `correction`: it collects a `View` of each keyframe, the upright surfaces in its depth
image. `Building` matches views (`matching`), consecutive ones and those of places to which the
camera came back, and keeps the relative poses in a `PoseGraph`.
"""

from hypermap.mapping.pose_graph.correction import (
    CorrectedPoses,
    CorrectedRecording,
    correct_poses,
)

__all__ = ["CorrectedPoses", "CorrectedRecording", "correct_poses"]
