"""The server's response with the evidence for an object, and the same in a page of one file."""

from __future__ import annotations

import dataclasses
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.viewer.live.embedded_evidence import embed_evidence
from hypermap.viewer.live.object_evidence import NO_EVIDENCE, NONE_HERE, describe_evidence

from .live_tools import Window, serving
from .seen_map import CAMERAS_XY, CHAIR_LOOKS, HAS_NONE, SCORES, STAMPS, START, seen_map
from .small_map import CHAIR, DESK, saved_small_map


def shape_of(polygons: Any) -> Any:
    return shapely.MultiPolygon([(rings[0], rings[1:]) for rings in polygons])


def saved(folder: Path, hypermap: Hypermap | None = None) -> Path:
    path = folder / "seen.hmap"
    save_map(hypermap or seen_map(), path)
    return path


def asked(path: Path, number: int, layer: str = "semantic", expected: int = 200) -> Any:
    with serving(path) as client:
        return Window(client).get(f"/api/objects/{layer}/{number}/evidence", expected)


def test_every_look_at_an_object_is_reported_in_the_order_of_time(tmp_path: Path) -> None:
    answer = asked(saved(tmp_path), CHAIR)
    looks = answer["observations"]
    assert [look["stamp"] for look in looks] == STAMPS.tolist()
    assert [look["score"] for look in looks] == SCORES.tolist()
    assert answer["start"] == START
    assert answer["seen"] == 4
    for look, shape, camera in zip(looks, CHAIR_LOOKS, CAMERAS_XY, strict=True):
        assert shape_of(look["polygons"]).equals(shape)
        assert look["area"] == pytest.approx(shape.area)
        assert look["camera"] == pytest.approx(camera)
        assert look["distance"] == pytest.approx(shape.distance(shapely.Point(camera)), abs=1e-4)
        ahead = np.subtract((7.0, 5.0), camera)
        assert look["yaw"] == pytest.approx(np.arctan2(ahead[1], ahead[0]), abs=1e-4)


def test_every_method_is_compared_with_the_shape_in_the_map(tmp_path: Path) -> None:
    fused = {one["method"]: one for one in asked(saved(tmp_path), CHAIR)["fused"]}
    assert next(iter(fused)) == "votes"  # that of the map comes first
    assert [one["is_own"] for one in fused.values()] == [True, False, False]
    hull = fused["convex_hull"]
    assert shape_of(hull["polygons"]).equals(shapely.box(6.5, 4.5, 8.0, 5.5))
    assert (hull["area"], hull["jaccard"]) == pytest.approx((1.5, 1 / 1.5), abs=1e-4)
    best = fused["best_shape"]  # the mean of all middles is 7.0, that of the whole looks
    assert shape_of(best["polygons"]).equals(CHAIR_LOOKS[0])
    assert (best["area"], best["jaccard"]) == (1.0, 1.0)
    votes = shape_of(fused["votes"]["polygons"])
    in_map = shapely.box(6.5, 4.5, 7.5, 5.5)
    expected = votes.intersection(in_map).area / votes.union(in_map).area
    assert fused["votes"]["jaccard"] == pytest.approx(expected, abs=1e-3)


def test_the_answer_is_in_the_base_frame(tmp_path: Path) -> None:
    plain = asked(saved(tmp_path), CHAIR)
    turned = asked(saved(tmp_path, seen_map(is_turned=True)), CHAIR)
    for one, other in zip(plain["observations"], turned["observations"], strict=True):
        x, y = one["camera"]
        assert other["camera"] == pytest.approx([1 - y, x])
        assert other["yaw"] - one["yaw"] == pytest.approx(np.pi / 2, abs=1e-4)
        moved = shapely.transform(
            shape_of(one["polygons"]), lambda xy: np.column_stack([1 - xy[:, 1], xy[:, 0]])
        )
        assert shape_of(other["polygons"]).equals_exact(moved, 1e-3, normalize=True)
        assert other["distance"] == one["distance"]
    for one, other in zip(plain["fused"], turned["fused"], strict=True):
        assert (one["method"], one["area"], one["jaccard"]) == (
            other["method"],
            other["area"],
            other["jaccard"],
        )


def test_where_nothing_is_kept_that_is_said(tmp_path: Path) -> None:
    for path, number, reason in (
        (saved_small_map(tmp_path), CHAIR, NO_EVIDENCE),
        (saved(tmp_path), HAS_NONE, NONE_HERE),
    ):
        answer = asked(path, number)
        assert (answer["observations"], answer["fused"], answer["reason"]) == ([], [], reason)


def test_what_is_no_object_is_refused(tmp_path: Path) -> None:
    path = saved(tmp_path)
    assert "no object with id 77" in asked(path, 77, expected=404)["error"]
    assert "'occupancy' has no objects" in asked(path, 1, "occupancy", expected=400)["error"]
    assert "attic" in asked(path, 1, "attic", expected=404)["error"]


def test_damaged_evidence_is_an_error_that_names_the_file(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    save_map(seen_map(), folder)
    (folder / "semantic.evidence.json").write_text("{}")
    assert "semantic.evidence.json: " in asked(folder, CHAIR, expected=400)["error"]
    answer, note = embed_evidence(open_map(folder), open_map(folder)["semantic"])
    assert answer == {}
    assert "is shown without evidence" in note


def test_evidence_stays_with_what_is_changed_and_goes_with_what_is_deleted(tmp_path: Path) -> None:
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        corners = [[6, 4], [8, 4], [8, 6], [6, 6]]
        window.edit(
            {"op": "update", "layer": "semantic", "id": CHAIR, "name": "stool", "polygon": corners},
            {"op": "remove", "layer": "semantic", "id": DESK},
        )
        answer = window.get(f"/api/objects/semantic/{CHAIR}/evidence")
        assert len(answer["observations"]) == 4
        hull = next(one for one in answer["fused"] if one["method"] == "convex_hull")
        assert hull["jaccard"] == pytest.approx(1.5 / 4)  # compared with the new shape
        window.get(f"/api/objects/semantic/{DESK}/evidence", 404)
        window.go("/api/undo")
        assert len(window.get(f"/api/objects/semantic/{DESK}/evidence")["observations"]) == 1
        window.go("/api/redo")
        window.post("/api/save")
    layer = open_map(path)["semantic"]
    assert isinstance(layer, SemanticLayer)
    kept = layer.evidence()
    assert kept is not None
    assert kept.object_ids.tolist() == [CHAIR] * 4
    assert layer.get(CHAIR).name == "stool"


def test_the_shown_command_and_python_give_the_same(tmp_path: Path) -> None:
    path = saved(tmp_path)
    answer = asked(path, CHAIR)
    words = [sys.executable, "-m", *shlex.split(answer["command"]), "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert '"stamp": 165' in done.stdout
    assert done.stdout.count('"method"') == 3
    python = [sys.executable, "-c", answer["python"]]
    lines = subprocess.run(python, capture_output=True, text=True, check=True).stdout.splitlines()
    assert [float(line.split()[0]) for line in lines] == STAMPS.tolist()


def test_a_page_of_one_file_holds_the_evidence_of_as_many_objects_as_fit() -> None:
    hypermap = seen_map()
    whole, note = embed_evidence(hypermap, hypermap["semantic"])
    assert (set(whole), note) == ({str(DESK), str(CHAIR)}, "")
    assert whole[str(CHAIR)] == describe_evidence(hypermap, "semantic", CHAIR)
    part, note = embed_evidence(hypermap, hypermap["semantic"], most=3)
    assert set(part) == {str(DESK)}
    assert note == "layer 'semantic': the evidence for 1 object is not in this file"
    assert embed_evidence(hypermap, hypermap["occupancy"]) == ({}, "")


def test_a_line_as_shape_in_the_map_can_be_compared(tmp_path: Path) -> None:
    hypermap = seen_map()
    layer = hypermap["semantic"]
    assert isinstance(layer, SemanticLayer)
    flat = shapely.Polygon([(0, 0), (1, 0), (2, 0)])
    layer.update(CHAIR, dataclasses.replace(layer.get(CHAIR), footprint=flat))
    answer = asked(saved(tmp_path, hypermap), CHAIR)
    assert [one["jaccard"] for one in answer["fused"]] == [0, 0, 0]
