"""Changes in the base frame of a map, whatever frame their layers are in."""

from __future__ import annotations

from dataclasses import replace

from hypermap.core.errors import FrameError
from hypermap.core.frames import Pose2D
from hypermap.core.history import Change
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticObject


def pose_of_layer(hypermap: Hypermap, change: Change) -> Pose2D | None:
    """Return the pose of a change's layer in the base frame of the map.

    None if the layer is not in the map any more, or has no place in it.
    """
    if change.layer not in hypermap:
        return None
    try:
        return hypermap.frames.lookup(hypermap.base_frame, hypermap[change.layer].frame_id)
    except FrameError:
        return None


def placed(hypermap: Hypermap, change: Change) -> Change:
    """Return a change with its objects in the base frame of the map.

    Those of a layer without a pose there (`pose_of_layer`) stay in its frame.
    """
    pose = pose_of_layer(hypermap, change)
    if pose is None or pose.is_identity:
        return change

    def moved(item: SemanticObject | None) -> SemanticObject | None:
        return item and replace(item, footprint=pose.apply_geometry(item.footprint))

    return replace(change, before=moved(change.before), after=moved(change.after))
