"""An evaluation as plain data for JSON and CSV, with its rule, threshold and inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeAlias

from hypermap.evaluation.comparison import Comparison
from hypermap.evaluation.maps import MapObjects
from hypermap.evaluation.matching import DUPLICATE_SHARE
from hypermap.evaluation.metrics import Evaluation, Score
from hypermap.evaluation.significance import MOST_EXACT
from hypermap.spreadsheet import as_csv

Data: TypeAlias = dict[str, Any]

RULES = {
    "count": "all objects of all semantic layers; rooms are none",
    "closest": "each true object next to the estimated one of its class with the nearest centroid, "
    "moved so that the centroids coincide; means over the true objects whose class the estimate "
    "has (thesis, 2019; IoU is the Jaccard index)",
    "matched": "one to one within a class, with the largest sum of IoU; a true object without a "
    "match has an IoU of 0; distance and area are means over the matches, area as a share of the "
    "true one",
    "found": "one to one within a class, among pairs of at least that IoU; a duplicate has no "
    f"match but shares {DUPLICATE_SHARE:.0%} of the smaller area with an object found already; all "
    "others without a match are false; panoptic quality (PQ) is F1 times the mean IoU of the finds",
    "comparison": "Wilcoxon signed-rank test, paired by true object, one-sided: better than the "
    f"other? Zero differences dropped; exact up to {MOST_EXACT} others, then the normal "
    "distribution with corrections for ties and continuity",
}
COLUMNS = (
    "estimate",
    "ground_truth",
    "against",
    "scope",
    "class",
    "layer",
    "object",
    "rule",
    "min_iou",
    "measure",
    "unit",
    "value",
)
_UNITS = {"distance": "m"}


@dataclass(frozen=True, eq=False)
class EvaluationRun:
    """An estimated map and how it was measured."""

    objects: MapObjects
    evaluation: Evaluation


def report(
    ground_truth: MapObjects,
    estimate: EvaluationRun,
    against: EvaluationRun | None = None,
    comparisons: Sequence[Comparison] = (),
) -> Data:
    """Return all figures as JSON values; None if undefined.

    Args:
        ground_truth: the true objects.
        estimate: what was measured against them.
        against: the other estimate, if there is one.
        comparisons: of the two estimates.
    """
    data = {
        "ground_truth": _inputs(ground_truth),
        "frame_id": ground_truth.frame_id,
        "rules": {k: text for k, text in RULES.items() if k != "comparison" or against is not None},
        **_run_data(ground_truth, estimate),
    }
    if against is not None:
        data["against"] = _run_data(ground_truth, against)
        data["comparison"] = [asdict(comparison) for comparison in comparisons]
    return data


def csv_text(data: Data) -> str:
    """Return a report as CSV, a row for each figure; the value is empty if undefined."""
    inputs = {"ground_truth": data["ground_truth"]["map"], "estimate": data["estimate"]["map"]}
    rows = [{**inputs, **row} for row in _rows(data)]
    if "against" in data:
        other = data["against"]["estimate"]["map"]
        rows += [{**inputs, "estimate": other, **row} for row in _rows(data["against"])]
        for comparison in data["comparison"]:
            compared = _comparison_rows(comparison)
            rows += [{**inputs, "against": other, **row} for row in compared]
    return as_csv(COLUMNS, ([row.get(column) for column in COLUMNS] for row in rows))


def _inputs(objects: MapObjects) -> Data:
    return {
        "map": objects.name,
        "objects": len(objects.objects),
        "repaired": objects.repaired,
        "unread": objects.unread,
    }


def _run_data(ground_truth: MapObjects, run: EvaluationRun) -> Data:
    evaluation = run.evaluation
    overall = _score(evaluation.overall)
    for found, quality in zip(overall["found"], evaluation.class_mean_quality(), strict=True):
        found["class_mean_panoptic_quality"] = quality
    return {
        "estimate": _inputs(run.objects),
        "all": overall,
        "classes": {name: _score(score) for name, score in evaluation.classes.items()},
        "objects": _objects(ground_truth, run),
    }


def _score(score: Score) -> Data:
    return {
        "count": {"true": score.true, "estimated": score.estimated},
        "closest": {
            "compared": score.compared,
            "iou": score.shape_iou,
            "distance": score.shape_distance,
        },
        "matched": {
            "iou": score.iou,
            "distance": score.centroid_distance,
            "area_error": score.area_error,
            "area_bias": score.area_bias,
        },
        "found": [
            {
                **asdict(detection),
                "precision": detection.precision,
                "recall": detection.recall,
                "f1": detection.f1,
                "panoptic_quality": detection.panoptic_quality,
            }
            for detection in score.detection
        ],
    }


def _objects(ground_truth: MapObjects, run: EvaluationRun) -> list[Data]:
    """Return the true objects, each with the estimated ones that it was compared with."""
    ids = [thing.id for thing in run.objects.objects]
    closest = {c.ground_truth: c for c in run.evaluation.closest}
    matches = {m.ground_truth: m for m in run.evaluation.matches}
    rows = []
    for j, (thing, layer) in enumerate(zip(ground_truth.objects, ground_truth.layers, strict=True)):
        row: Data = {"layer": layer, "id": thing.id, "name": thing.name}
        row["closest"], row["matched"] = None, {"estimate": None, "iou": 0.0}
        if j in closest:
            c = closest[j]
            row["closest"] = {"estimate": ids[c.estimate], "iou": c.iou, "distance": c.distance}
        if j in matches:
            m = matches[j]
            row["matched"] = {"estimate": ids[m.estimate], "iou": m.iou}
        rows.append(row)
    return rows


def _rows(run: Data) -> Iterator[Data]:
    for row in _score_rows(run["all"]):
        yield {"scope": "all", **row}
    for name, score in run["classes"].items():
        for row in _score_rows(score):
            yield {"scope": "class", "class": name, **row}
    for thing in run["objects"]:
        which = {"class": thing["name"], "layer": thing["layer"], "object": thing["id"]}
        for rule in ("closest", "matched"):
            for row in _figures(rule, thing[rule] or {}):
                yield {"scope": "object", **which, **row}


def _score_rows(score: Data) -> Iterator[Data]:
    for rule in ("count", "closest", "matched"):
        yield from _figures(rule, score[rule])
    for found in score["found"]:
        figures = {measure: value for measure, value in found.items() if measure != "min_iou"}
        for row in _figures("found", figures):
            yield {"min_iou": found["min_iou"], **row}


def _comparison_rows(comparison: Data) -> Iterator[Data]:
    test = comparison["test"]
    figures = {"better": comparison["better"], "worse": comparison["worse"], **test}
    for name, value in figures.items():
        measure = f"{comparison['measure']}: {name}"
        yield {"scope": "all", "rule": comparison["rule"], "measure": measure, "value": value}


def _figures(rule: str, figures: Mapping[str, Any]) -> Iterator[Data]:
    for measure, value in figures.items():
        unit = _UNITS.get(measure, "")
        yield {"rule": rule, "measure": measure, "unit": unit, "value": value}
