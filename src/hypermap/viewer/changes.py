"""What changed between two maps, as a picture with arrows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.colors import Color
from hypermap.core.arrays import FloatArray, as_objects
from hypermap.core.history import (
    ADDED,
    CORRECTED,
    EDITED,
    EXPIRED,
    FIRST_SEEN,
    GONE,
    MOVED,
    NOT_REVISITED,
    RENAMED,
    RESHAPED,
    Change,
)
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.evaluation.changes import Changes
from hypermap.evaluation.closest import centroids
from hypermap.formats.atomic import write_file
from hypermap.text import counted
from hypermap.viewer.picture import Drawing, Shapes, check_suffix, compose

# Apart from each other also for color-blind people.
COLORS: dict[str, Color] = {
    ADDED: (0.0, 0.62, 0.45),
    GONE: (0.85, 0.0, 0.25),
    EXPIRED: (0.55, 0.25, 0.3),
    MOVED: (0.0, 0.45, 0.7),
    RESHAPED: (0.8, 0.47, 0.65),
    RENAMED: (0.95, 0.6, 0.0),
    EDITED: (0.8, 0.75, 0.2),
    FIRST_SEEN: (0.55, 0.75, 0.65),
    NOT_REVISITED: (0.6, 0.6, 0.6),
    CORRECTED: (0.35, 0.7, 0.9),
}


def render_changes(
    hypermap: Hypermap,
    changes: Changes,
    path: str | Path,
    *,
    title: str = "",
    size: int = 1400,
    is_over_time: bool = False,
) -> None:
    """Draw what changed over the occupancy of the earlier map, and save it as PNG or SVG.

    Shapes as they were are outlines, shapes as they are now are filled. An arrow leads from where
    an object was to where it is.

    Args:
        hypermap: the earlier map.
        changes: in its base frame.
        path: where to save; the suffix chooses the format.
        title: first line of the picture.
        size: pixels of the longer side of the map in a PNG.
        is_over_time: whether the changes are those of one map, oldest first, of which some may have
            changed again; shapes that are no longer so are not filled.

    Raises:
        HypermapError: If the suffix is another, or there is nothing to draw.
    """
    path = Path(path)
    check_suffix(path)
    drawing = _compose(hypermap, changes, title, is_over_time)
    from hypermap.viewer.drawing import draw  # loads matplotlib

    write_file(path, draw(drawing, path.suffix[1:].lower(), size))


def _compose(hypermap: Hypermap, changes: Changes, title: str, is_over_time: bool) -> Drawing:
    grids = [layer for layer in hypermap if isinstance(layer, OccupancyLayer)]
    base = hypermap.base_frame
    shown = [one for change in changes.changes for one in (change.before, change.after) if one]
    things = SemanticLayer("changes", base, [replace(one, id=None) for one in shown])
    pairs = [(c.before, c.after) for c in changes.changes if c.kind == MOVED]
    arrows = [_arrow(one, other) for one, other in pairs if one and other]
    count = counted(len(changes.changes), "change")
    latest = {(change.layer, change.object.id): change for change in changes.changes}.values()
    shapes = _after(latest if is_over_time else changes.changes), _before(changes)
    return replace(
        compose(Hypermap([*grids, things], hypermap.frames), title=title),
        shapes=tuple(part for part in shapes if len(part.names)),
        colors=COLORS,
        subtitle=f"{count}, {counted(changes.unchanged, 'object')} unchanged, frame {base}",
        arrows=np.array(arrows, dtype=np.float64).reshape(-1, 2, 2),
    )


def _arrow(before: SemanticObject, after: SemanticObject) -> FloatArray:
    """Return the ends of an arrow, shape (2, 2), from a center to the edge of a shape.

    Its tip would be below the label in the center of the shape.
    """
    ends = centroids([before, after])
    (shape,) = valid_copies(as_objects([after.footprint]))
    outside = shapely.get_coordinates(shapely.difference(shapely.linestrings(ends), shape))
    return ends if len(outside) == 0 else np.stack([ends[0], outside[-1]])


def _after(changes: Iterable[Change]) -> Shapes:
    parts = []
    for change in changes:
        if change.after is not None:
            label = change.after.name
            if change.before is not None and change.kind == RENAMED:
                label = f"{change.before.name}: now {label}"
            parts.append((change.kind, label, change.after.footprint))
    return _shapes("as it is now", parts)


def _before(changes: Changes) -> Shapes:
    parts = []
    for change in changes.changes:
        if change.before is not None and change.kind != RENAMED:
            label = change.before.name if change.after is None else ""
            parts.append((change.kind, label, change.before.footprint))
    return replace(_shapes("as it was", parts), are_outlines=True)


def _shapes(heading: str, parts: Sequence[tuple[str, str, BaseGeometry]]) -> Shapes:
    shapes = valid_copies(as_objects(shape for _, _, shape in parts))
    order = np.argsort(-shapely.area(shapes), kind="stable")
    kinds, labels = as_objects([part[0] for part in parts]), as_objects([part[1] for part in parts])
    return Shapes(heading, kinds[order], shapes[order], labels[order])
