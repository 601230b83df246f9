"""An estimated map over the true one, with matches, misses and false positives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from hypermap.colors import Color
from hypermap.core.arrays import as_objects
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import valid_copies
from hypermap.evaluation.closest import centroids
from hypermap.evaluation.maps import MapObjects
from hypermap.evaluation.metrics import Evaluation, Finds
from hypermap.formats.atomic import write_file
from hypermap.viewer.picture import Drawing, Shapes, check_suffix, compose

FOUND, MISSED = "found", "missed"  # what becomes of a true object
RIGHT, DUPLICATE, FALSE = "right", "duplicate", "false"  # and what an estimated one is
# Apart from each other also for color-blind people.
COLORS: dict[str, Color] = {
    FOUND: (0.1, 0.1, 0.1),
    MISSED: (0.85, 0.0, 0.25),
    RIGHT: (0.0, 0.62, 0.45),
    DUPLICATE: (0.34, 0.5, 0.95),
    FALSE: (0.95, 0.6, 0.0),
}


def render_comparison(
    ground_truth_map: Hypermap,
    ground_truth: MapObjects,
    estimate: MapObjects,
    evaluation: Evaluation,
    path: str | Path,
    *,
    title: str = "",
    size: int = 1400,
) -> None:
    """Draw the true objects as outlines over the estimated ones, and save it as PNG or SVG.

    A line joins the centroids of a true object and of its match, with the dot at the estimate.
    Finds are those at the first threshold of the evaluation; their IoU is next to their names.

    Args:
        ground_truth_map: whose occupancy is the ground of the picture.
        ground_truth: its objects.
        estimate: the estimated objects, in the same frame.
        evaluation: of the estimate.
        path: where to save; the suffix chooses the format.
        title: first line of the picture.
        size: pixels of the longer side of the map in a PNG.

    Raises:
        HypermapError: If the suffix is another.
    """
    path = Path(path)
    check_suffix(path)
    drawing = compose_comparison(ground_truth_map, ground_truth, estimate, evaluation, title)
    from hypermap.viewer.drawing import draw  # loads matplotlib

    write_file(path, draw(drawing, path.suffix[1:].lower(), size))


def compose_comparison(
    ground_truth_map: Hypermap,
    ground_truth: MapObjects,
    estimate: MapObjects,
    evaluation: Evaluation,
    title: str = "",
) -> Drawing:
    """Return what `render_comparison` draws."""
    finds = evaluation.finds[0]
    parts = (_estimated(estimate, finds), _true(ground_truth, finds))
    around = shapely.box(*shapely.total_bounds(np.concatenate([part.shapes for part in parts])))
    shown = [
        layer.name
        for layer in ground_truth_map.layers
        if isinstance(layer, OccupancyLayer | SemanticLayer)
    ]
    ours, theirs = centroids(estimate.objects), centroids(ground_truth.objects)
    links = [(theirs[match.ground_truth], ours[match.estimate]) for match in finds.matches]
    return replace(
        compose(ground_truth_map, layers=shown, area=around),
        shapes=parts,
        colors=COLORS,
        title=title,
        subtitle=_subtitle(ground_truth, estimate, finds),
        links=np.array(links).reshape(-1, 2, 2),
    )


def _true(truth: MapObjects, finds: Finds) -> Shapes:
    ious = {match.ground_truth: match.iou for match in finds.matches}
    states = [FOUND if j in ious else MISSED for j in range(len(truth.objects))]
    labels = [
        f"{thing.name} {ious[j]:.2f}" if j in ious else f"{thing.name} missed"
        for j, thing in enumerate(truth.objects)
    ]
    return replace(_shapes("ground truth", truth, states, labels), are_outlines=True)


def _estimated(estimate: MapObjects, finds: Finds) -> Shapes:
    right = {match.estimate for match in finds.matches}
    states = [
        RIGHT if i in right else DUPLICATE if i in finds.duplicates else FALSE
        for i in range(len(estimate.objects))
    ]
    words = {DUPLICATE: "twice", FALSE: "false"}
    labels = [
        f"{thing.name} {words[state]}" if state in words else ""  # the true one is labeled
        for thing, state in zip(estimate.objects, states, strict=True)
    ]
    return _shapes("estimate", estimate, states, labels)


def _shapes(
    heading: str, things: MapObjects, states: Sequence[str], labels: Sequence[str]
) -> Shapes:
    shapes = valid_copies(as_objects(thing.footprint for thing in things.objects))
    order = np.argsort(-shapely.area(shapes), kind="stable")
    return Shapes(heading, as_objects(states)[order], shapes[order], as_objects(labels)[order])


def _subtitle(truth: MapObjects, estimate: MapObjects, finds: Finds) -> str:
    found = len(finds.matches)
    return (
        f"{found} of {len(truth.objects)} found, {found} of {len(estimate.objects)} right "
        f"(same class, IoU ≥ {finds.min_iou:g}, one to one), frame {truth.frame_id}"
    )
