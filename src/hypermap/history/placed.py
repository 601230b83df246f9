"""Changes in the base frame of a map, whatever frame their layers are in."""

from __future__ import annotations

from dataclasses import replace

from hypermap.core.errors import FrameError
from hypermap.core.history import Change
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticObject


def placed(hypermap: Hypermap, change: Change) -> Change:
    """Return a change with its objects in the base frame of the map.

    Those of a layer that is not in the map any more, or has no place in it, stay in its frame.
    """
    if change.layer not in hypermap:
        return change
    try:
        pose = hypermap.frames.lookup(hypermap.base_frame, hypermap[change.layer].frame_id)
    except FrameError:
        return change
    if pose.is_identity:
        return change

    def moved(item: SemanticObject | None) -> SemanticObject | None:
        return item and replace(item, footprint=pose.apply_geometry(item.footprint))

    return replace(change, before=moved(change.before), after=moved(change.after))
