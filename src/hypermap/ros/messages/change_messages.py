"""Changes of objects as messages."""

from __future__ import annotations

import math

from hypermap.core.history import Change, Revision
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticObject
from hypermap.history import placed
from hypermap.ros.messages.geometry_messages import Types, point
from hypermap.ros.port import Message


def change_message(revision: Revision, change: Change, hypermap: Hypermap, types: Types) -> Message:
    """Return a change as `hypermap_msgs/ObjectChange`, in the base frame of the map.

    Places of a layer that is not in the map any more, or has no place, are in its own frame.
    """
    change = placed(hypermap, change)
    before, after = change.before, change.after
    return types.message("hypermap_msgs/ObjectChange")(
        version=revision.version,
        time=_or_nan(revision.time),
        cause=revision.cause,
        drive=revision.drive,
        kind=change.kind,
        layer=change.layer,
        id=change.object.id or 0,
        name_before="" if before is None else before.name,
        name="" if after is None else after.name,
        before=_place(before or change.object, types),
        after=_place(change.object, types),
        distance=_or_nan(change.distance),
        confidence=_or_nan(change.confidence),
    )


def _place(item: SemanticObject, types: Types) -> Message:
    center = item.footprint.centroid
    return point(center.x, center.y, types)


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
