"""What was seen from one side becomes as deep as things of its class are."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely import affinity

from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import FREE, OCCUPIED, OccupancyLayer
from hypermap.mapping.completion import completed, free_share
from hypermap.mapping.config import load_config, profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_table import evidence_table, fused_shapes
from hypermap.perception.observation import Observation, ObservedObject

FRONT = shapely.box(3.0, 1.0, 3.1, 3.0)  # the front of a shelf, seen from the left
FROM_LEFT = np.array([[0.0, 1.0], [0.5, 2.0], [0.0, 3.0]])
NO_RECTANGLE = shapely.Polygon(
    [(3.48238739884257e-310, 3.4795004210353e-310), (3.4822220290093e-310, 2.2e-236), (0.02, 0.01)]
)
ALL_AROUND = np.array([[0.0, 2.0], [6.0, 2.0], [3.0, 5.0], [3.0, -1.0]])


def test_a_front_grows_away_from_the_cameras() -> None:
    assert completed(FRONT, "shelf", FROM_LEFT).bounds == pytest.approx((3.0, 1.0, 3.5, 3.0))
    from_right = np.array([[6.0, 2.0]])
    assert completed(FRONT, "shelf", from_right).bounds == pytest.approx((2.6, 1.0, 3.1, 3.0))


@pytest.mark.parametrize(
    ("shape", "name", "cameras"),
    [
        (FRONT, "shelf", ALL_AROUND),  # nothing is hidden
        (FRONT, "sculpture", FROM_LEFT),  # who knows
        (shapely.box(3, 1, 3.6, 3), "shelf", FROM_LEFT),  # deep enough
        (FRONT, "shelf", np.array([[3.05, 2.0]])),  # from above
        (shapely.Polygon(), "shelf", FROM_LEFT),
        (NO_RECTANGLE, "shelf", np.array([[0.0, 1.0]])),  # as a damaged file has it
        (shapely.union(FRONT, shapely.box(4, 1, 4.1, 3)), "shelf", FROM_LEFT),
    ],
)
def test_all_else_stays_as_it_is(shape: shapely.Geometry, name: str, cameras: np.ndarray) -> None:
    assert completed(shape, name, cameras) is shape


@given(st.floats(-math.pi, math.pi), st.floats(0.02, 0.6), st.floats(0.7, 3.0))
def test_it_is_as_deep_as_its_class_however_it_stands(
    turn: float, depth: float, width: float
) -> None:
    front = affinity.rotate(shapely.box(2, 0, 2 + depth, width), turn, (0, 0), use_radians=True)
    camera = affinity.rotate(shapely.Point(-1, width / 2), turn, (0, 0), use_radians=True)
    shape = completed(front, "table", shapely.get_coordinates(camera))
    expected = affinity.rotate(shapely.box(2, 0, 2.7, width), turn, (0, 0), use_radians=True)
    if depth < 0.68:
        assert shape.symmetric_difference(expected).area < 1e-6
    assert shape.covers(front.buffer(-1e-9))


def test_it_does_not_grow_over_what_is_known_to_be_free() -> None:
    cells = np.full((80, 120), OCCUPIED, dtype=np.int8)
    cells[:, 65:] = FREE  # from x = 3.25 on
    layer = OccupancyLayer("occupancy", "map", GridGeometry(120, 80, 0.05), cells)
    shape = completed(FRONT, "shelf", FROM_LEFT, partial(free_share, layer))
    assert shape.bounds == pytest.approx((3.0, 1.0, 3.25, 3.0))
    off_the_map = affinity.translate(FRONT, 50)
    assert free_share(layer, off_the_map) == 0.0
    assert free_share(layer, shapely.box(3, 1, 3.5, 3)) == pytest.approx(0.5)


def test_a_published_shelf_is_complete_and_its_track_stays_what_was_seen() -> None:
    area = shapely.box(0, 0, 3.2, 4)
    pose = np.eye(4)
    pose[:2, 3] = 0.5, 2.0
    shelf = ObservedObject("shelf", 0.9, FRONT, 0.0, 2.0)
    depths = {}
    for completion in ("class_depth", "none"):
        config = profile("default").evidence
        evidence = EvidenceMap(type(config)(**{**vars(config), "completion": completion}))
        for stamp in range(5):
            evidence.update(Observation(float(stamp), pose, (shelf,), area, None))
        (thing,) = evidence.objects()
        xmin, _, xmax, _ = thing.footprint.bounds
        depths[completion] = xmax - xmin
        assert evidence.evidence(thing.id)[0].footprint.equals(FRONT)
    assert depths["none"] == pytest.approx(0.1, abs=0.02)
    assert depths["class_depth"] == pytest.approx(0.5, abs=0.02)


def test_a_configuration_has_depths_of_classes_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "depths.yaml"
    path.write_text("evidence: {class_depths: {server rack: 1, Shelf: 0, sofa: 0.4}}\n")
    depths = load_config(path).evidence.class_depths

    def depth_of(name: str) -> float:
        shape = completed(FRONT, name, FROM_LEFT, class_depths=depths)
        return shape.bounds[2] - shape.bounds[0]

    assert depth_of("serverrack") == depth_of("server rack") == pytest.approx(1.0)
    assert depth_of("shelf") == pytest.approx(0.1)  # as it was seen
    assert depth_of("sofa") == pytest.approx(0.4)
    assert depth_of("cupboard") == pytest.approx(0.45)  # as without a file


def test_a_map_is_made_with_the_depths_of_its_configuration() -> None:
    evidence = EvidenceMap(replace(profile("default").evidence, class_depths={"rack": 0.8}))
    pose = np.eye(4)
    pose[:2, 3] = 0.5, 2.0
    rack = ObservedObject("rack", 0.9, FRONT, 0.0, 2.0)
    for stamp in range(5):
        evidence.update(Observation(float(stamp), pose, (rack,), shapely.box(0, 0, 3.2, 4), None))
    (thing,) = evidence.objects()
    xmin, _, xmax, _ = thing.footprint.bounds
    assert xmax - xmin == pytest.approx(0.8, abs=0.02)
    seen = evidence_table({thing.id: evidence.evidence(thing.id)})
    shape = fused_shapes(seen, evidence.config, "rack")["votes"]
    assert shape.bounds[2] - shape.bounds[0] == pytest.approx(0.8, abs=0.02)
