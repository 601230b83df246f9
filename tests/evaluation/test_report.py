"""Every figure with its rule, threshold and inputs, as data."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import pytest

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.evaluation import compare, evaluate, map_objects
from hypermap.evaluation.report import COLUMNS, RULES, EvaluationRun, csv_text, report
from hypermap.testing import square

TRUE = [square("cup", 0, 0), square("cup", 5, 0), square("sink", 9, 0)]
SEEN = [square("cup", 0.5, 0), square("train", 3, 3)]


def hypermap(things: list[SemanticObject]) -> Hypermap:
    return Hypermap([SemanticLayer("semantic", "map", things)])


def example(has_other: bool = True) -> dict[str, Any]:
    true_map = hypermap(TRUE)
    truth = map_objects(true_map, "truth.hmap")

    def run(things: list[SemanticObject], name: str) -> EvaluationRun:
        objects = map_objects(hypermap(things), name, true_map, truth.name)
        return EvaluationRun(objects, evaluate(objects.objects, truth.objects))

    ours, other = run(SEEN, "ours.hmap"), run(TRUE, "other.hmap")
    if not has_other:
        return report(truth, ours)
    return report(truth, ours, other, compare(ours.evaluation, other.evaluation))


def rows(data: dict[str, Any], **wanted: str) -> list[dict[str, str]]:
    table = csv.DictReader(io.StringIO(csv_text(data)))
    return [row for row in table if all(row[key] == value for key, value in wanted.items())]


def value(data: dict[str, Any], **wanted: str) -> str:
    (row,) = rows(data, **wanted)
    return row["value"]


def test_a_report_names_its_inputs_and_rules() -> None:
    data = example()
    assert data["ground_truth"] == {"map": "truth.hmap", "objects": 3, "repaired": 0, "unread": 0}
    assert data["estimate"] == {"map": "ours.hmap", "objects": 2, "repaired": 0, "unread": 0}
    assert data["against"]["estimate"]["map"] == "other.hmap"
    assert data["frame_id"] == "map"
    assert data["rules"] == RULES


def test_a_report_is_json_without_anything_lost() -> None:
    data = example()
    assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_the_figures_of_all_and_of_a_class() -> None:
    data = example()
    assert data["all"]["count"] == {"true": 3, "estimated": 2}
    closest = {"compared": 2, "iou": pytest.approx(1), "distance": pytest.approx(2.5)}
    assert data["all"]["closest"] == data["classes"]["cup"]["closest"] == closest
    matched = data["classes"]["cup"]["matched"]
    assert matched == pytest.approx(
        {"iou": 1 / 6, "distance": 0.5, "area_error": 0, "area_bias": 0}
    )
    loose, strict = data["classes"]["cup"]["found"]
    assert (loose["min_iou"], strict["min_iou"]) == (0.25, 0.5)
    assert (loose["found"], loose["missed"], loose["precision"], loose["recall"]) == (1, 1, 1, 0.5)
    assert loose["panoptic_quality"] == pytest.approx((1 / 3) / 1.5)


def test_a_class_without_truth_is_not_defined() -> None:
    data = example()
    train = data["classes"]["train"]
    assert train["closest"] == {"compared": 0, "iou": None, "distance": None}
    assert train["matched"]["iou"] is train["found"][0]["f1"] is None
    assert train["found"][0]["false"] == 1
    found = {"class": "train", "rule": "found", "min_iou": "0.25"}
    assert value(data, measure="recall", **found) == ""
    assert value(data, measure="false", **found) == "1"


def test_every_true_object_is_reported_with_what_it_was_measured_by() -> None:
    near, far, sink = example()["objects"]
    assert (near["layer"], near["id"], near["name"]) == ("semantic", 0, "cup")
    assert near["closest"] == pytest.approx({"estimate": 0, "iou": 1, "distance": 0.5})
    assert near["matched"] == pytest.approx({"estimate": 0, "iou": 1 / 3})
    assert far["closest"] == pytest.approx({"estimate": 0, "iou": 1, "distance": 4.5})
    assert far["matched"] == {"estimate": None, "iou": 0}
    assert sink["closest"] is None


def test_the_csv_has_a_row_for_each_figure_with_rule_threshold_and_inputs() -> None:
    data = example()
    table = rows(data)
    assert tuple(table[0]) == COLUMNS
    assert all(row["ground_truth"] == "truth.hmap" and row["rule"] in RULES for row in table)
    assert all((row["rule"] == "found") == (row["min_iou"] != "") for row in table)
    ours = {"estimate": "ours.hmap", "against": "", "scope": "all"}
    assert value(data, **ours, rule="closest", measure="distance") == "2.5"
    assert [r["unit"] for r in rows(data, **ours, measure="distance")] == ["m", "m"]
    assert value(data, **ours, measure="recall", min_iou="0.5") == "0.0"
    assert value(data, estimate="other.hmap", scope="all", measure="f1", min_iou="0.5") == "1.0"
    assert value(data, estimate="ours.hmap", object="1", rule="matched", measure="iou") == "0.0"


def test_the_csv_tells_the_comparison() -> None:
    data = example()
    matched = {"against": "other.hmap", "rule": "matched"}
    # Three true objects, all of which the other map has better: one of eight patterns is as bad.
    assert value(data, **matched, measure="iou: p") == "1.0"
    assert value(data, **matched, measure="iou: worse") == "3"
    assert value(data, **matched, measure="iou: method") == "exact"


def test_without_another_map_there_is_no_comparison() -> None:
    data = example(has_other=False)
    assert not {"against", "comparison"} & data.keys()
    assert "comparison" not in data["rules"]
    assert {row["estimate"] for row in rows(data)} == {"ours.hmap"}
    assert {row["against"] for row in rows(data)} == {""}
