"""Corrects poses without a map: frames are matched to each other, and loops are closed.

Start at `correction`: it collects a `View` of each keyframe, what its depth image shows of upright
surfaces; `Building` matches them (`matching`), those that were taken one after the other and those
of places to which the camera came back, and keeps the relative poses in a `PoseGraph`.
"""

from hypermap.mapping.pose_graph.correction import (
    CorrectedPoses,
    CorrectedRecording,
    correct_poses,
)

__all__ = ["CorrectedPoses", "CorrectedRecording", "correct_poses"]
