"""Evidence as a table: what the evidence map kept, and what each fusion makes of it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import shapely

from hypermap.core.evidence import EvidenceTable
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.mapping import EvidenceMap, map_recording, profile
from hypermap.mapping.config import to_dict
from hypermap.mapping.evidence_table import config_of, fused_shapes
from hypermap.mapping.fusion import FUSIONS
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.testing import assert_same_evidence

EVERYWHERE = shapely.box(-10, -10, 10, 10)


def frame(stamp: float, *shapes: tuple[str, shapely.Polygon]) -> Observation:
    pose = np.eye(4)
    pose[:2, 3] = stamp, 2 * stamp
    seen = tuple(ObservedObject(name, 0.8, shape, 0.1, 0.9) for name, shape in shapes)
    return Observation(stamp, pose, seen, EVERYWHERE)


def a_table_and_a_chair() -> EvidenceMap:
    evidence = EvidenceMap(profile("default").evidence)
    table, chair = shapely.box(0, 0, 2, 1), shapely.box(4, 0, 4.5, 0.5)
    for stamp in range(4):
        evidence.update(frame(float(stamp), ("table", table), ("chair", chair)))
    return evidence


def evidence_in(layer: SemanticLayer) -> EvidenceTable:
    kept = layer.evidence()
    assert kept is not None
    return kept


def jaccard(one: shapely.Polygon, other: shapely.Polygon) -> float:
    return float(one.intersection(other).area / one.union(other).area)


def test_a_layer_comes_with_all_that_the_map_kept() -> None:
    evidence = a_table_and_a_chair()
    layer = evidence.layer()
    table = evidence_in(layer)
    assert len(table) == 8
    assert len(table.stamps) == 4  # each frame once, though it shows two things
    for item in layer.objects():
        assert item.id is not None
        own = layer.evidence_of(item.id)
        kept = evidence.evidence(item.id)
        assert own.stamps[own.views].tolist() == [one.stamp for one in kept]
        assert own.poses[own.views, :2, 3].tolist() == [[s, 2 * s] for s in own.stamps[own.views]]
        assert own.heights.tolist() == [[0.1, 0.9]] * 4
        for shape, one in zip(own.footprints, kept, strict=True):
            assert shape.equals(one.footprint)
        assert all(area.equals(EVERYWHERE) for area in own.areas)


def test_a_layer_keeps_what_was_known_when_it_was_made() -> None:
    evidence = a_table_and_a_chair()
    layer = evidence.layer()
    evidence.update(frame(9.0, ("table", shapely.box(0, 0, 2, 1))))
    assert evidence_in(layer).stamps.max() == 3.0
    assert evidence_in(evidence.layer()).stamps.max() == 9.0


def test_objects_that_are_not_published_leave_no_evidence() -> None:
    evidence = a_table_and_a_chair()
    evidence.update(frame(5.0, ("cup", shapely.box(8, 8, 8.1, 8.1))))
    layer = evidence.layer()
    assert set(evidence_in(layer).object_ids.tolist()) == set(layer.ids.tolist())


@pytest.mark.parametrize("name", ["default", "thesis"])
def test_a_saved_map_gives_the_shapes_again_that_are_in_it(tmp_path: Path, name: str) -> None:
    recording = SimulatedRecording(demo_world(), rate=0.5)
    made = map_recording(recording, detections_from_recording(), profile(name))
    save_map(made, tmp_path / "map.hmap")
    hypermap = open_map(tmp_path / "map.hmap")
    layer, before = hypermap["semantic"], made["semantic"]
    assert isinstance(layer, SemanticLayer)
    assert isinstance(before, SemanticLayer)
    assert_same_evidence(layer.evidence(), before.evidence())
    config = config_of(hypermap.metadata)
    assert config == profile(name).evidence
    assert len(layer) >= 5
    differing = 0
    for item in layer.objects():
        assert item.id is not None
        own = layer.evidence_of(item.id)
        assert len(own) == item.attributes["evidence"]
        fused = fused_shapes(own, config, item.name)
        assert list(fused) == list(FUSIONS)
        # Kept shapes are rounded to 0.1 mm, and the ground seen to 5 mm: one cell may change.
        assert jaccard(fused[config.fusion], item.footprint) > 0.85
        assert fused["convex_hull"].buffer(1e-3).covers(fused["best_shape"])
        differing += jaccard(fused["convex_hull"], item.footprint) < 0.95
    assert differing > 0


def test_there_is_no_shape_of_nothing() -> None:
    with pytest.raises(ValueError, match="no evidence"):
        fused_shapes(EvidenceTable.empty(), profile("default").evidence)


def test_the_settings_of_a_map_are_read_from_its_metadata() -> None:
    default = profile("default")
    changed = dataclasses.replace(
        default, evidence=dataclasses.replace(default.evidence, vote_share=0.7)
    )
    assert config_of({"config": to_dict(changed)}).vote_share == 0.7
    for unknown in ({}, {"config": "mine"}, {"config": {"evidence": {"fusion": "magic"}}}):
        assert config_of(unknown) == default.evidence
