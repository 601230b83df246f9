"""The past of the open map: its versions, what each of them changed, and the map as it was."""

from __future__ import annotations

import threading
import time
from collections import Counter, OrderedDict
from typing import Any

from hypermap.core.arrays import as_objects
from hypermap.core.frames import Pose2D
from hypermap.core.history import Change, Revision
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.objects import SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.core.value_layer import ValueLayer
from hypermap.history import at_version, grown
from hypermap.history.placed import pose_of_layer
from hypermap.values.past import why_undated
from hypermap.viewer.changes import COLORS
from hypermap.viewer.live.description import hex_color
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.shapes import polygons_in_base

MOST_CHANGES = 500
"""How many changes of a version are listed at most."""

_MAPS_KEPT = 8
_DECIMALS = 4  # of meters


class Past:
    """The open map as it was; the versions requested last are kept."""

    def __init__(self) -> None:
        self._kept: OrderedDict[int, Hypermap] = OrderedDict()
        self._present: Hypermap | None = None
        self._lock = threading.Lock()

    def map_at(self, hypermap: Hypermap, version: int) -> Hypermap:
        """Return the map as it was in a version.

        Args:
            hypermap: the present map, with unsaved edits.
            version: of its history.

        Raises:
            HypermapError: If the map keeps no history, or it does not reach back so far.
        """
        with self._lock:
            if self._present is not hypermap:
                self._present = hypermap
                self._kept.clear()
            if version not in self._kept:
                self._kept[version] = at_version(grown(hypermap, time.time()), version)
            self._kept.move_to_end(version)
            if len(self._kept) > _MAPS_KEPT:
                self._kept.popitem(last=False)
            return self._kept[version]


def has_past(layer: Layer, kind: str) -> bool:
    """Return whether a layer of a former version is shown as it was then.

    Args:
        layer: of the map as it was.
        kind: how it is drawn.
    """
    return why_undated(layer) is None if isinstance(layer, ValueLayer) else kind == "shapes"


def timeline(hypermap: Hypermap) -> dict[str, Any]:
    """Return the versions of a map that can be shown, oldest first, as documented in docs/view.md.

    The first one is there for what it was; of the others, only those that changed an object are.
    """
    versions = [
        {
            "version": revision.version,
            "time": revision.time,
            "cause": revision.cause,
            "drive": revision.drive,
            "changes": _counts(revision),
        }
        for number, revision in enumerate(_known(hypermap))
        if revision.changes or number == 0
    ]
    return {"versions": versions, "colors": {kind: hex_color(c) for kind, c in COLORS.items()}}


def changes_of(hypermap: Hypermap, version: int) -> dict[str, Any]:
    """Return what changed from the version before to this one, in the base frame.

    Raises:
        Refused: If the history does not know this version.
    """
    found = [revision for revision in _known(hypermap) if revision.version == version]
    if not found:
        raise Refused(f"the history has no version {version}", 404)
    changes = found[0].worth_showing()
    shown = [_shown(hypermap, change) for change in changes[:MOST_CHANGES]]
    return {
        "total": len(changes),
        "doubtful": len(found[0].changes) - len(changes),
        "changes": [change for change in shown if change is not None],
    }


def _counts(revision: Revision) -> dict[str, int]:
    """Return how many changes there are of each kind, and how many are doubtful."""
    shown = revision.worth_showing()
    counts = dict(Counter(change.kind for change in shown))
    doubtful = len(revision.changes) - len(shown)
    return counts | ({"doubtful": doubtful} if doubtful else {})


def _known(hypermap: Hypermap) -> list[Revision]:
    """Return the revisions after the last loss: to what was before, nothing leads back."""
    revisions = [] if hypermap.history is None else hypermap.history.revisions()
    losses = [i for i, revision in enumerate(revisions) if revision.follows_loss]
    return revisions[losses[-1] :] if losses else revisions


def _shown(hypermap: Hypermap, change: Change) -> dict[str, Any] | None:
    """Return a change as the page shows it; None if its layer is not there, or has no place."""
    pose = pose_of_layer(hypermap, change)
    if pose is None:
        return None
    return {
        "kind": change.kind,
        "layer": change.layer,
        "id": change.object.id,
        "distance": change.distance,
        "confidence": change.confidence,
        "before": _end(change.before, pose),
        "after": _end(change.after, pose),
    }


def _end(item: SemanticObject | None, base_T_layer: Pose2D) -> dict[str, Any] | None:
    """Return the name, the center and the shape of an object before or after a change."""
    if item is None:
        return None
    shapes = valid_copies(as_objects([item.footprint]))
    center = base_T_layer.apply(shapes[0].centroid.coords)[0]
    polygons = polygons_in_base(shapes, base_T_layer, _DECIMALS)[0]
    return {"name": item.name, "at": center.round(_DECIMALS).tolist(), "polygons": polygons}
