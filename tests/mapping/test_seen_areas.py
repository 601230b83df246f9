"""The areas that frames have seen."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hypermap.core.trajectory import pose_from_rpy
from hypermap.mapping.seen_areas import _round_ground, seen_areas
from hypermap.perception.depth_view import DepthView, ground_ring
from hypermap.perception.frame import Camera
from hypermap.perception.observation import Observation

HULL = shapely.box(0.00001, 0, 1, 1)


def view(
    reach: NDArray[np.float64], x: float = 0.3, y: float = -0.7, yaw: float = 0.4
) -> DepthView:
    height, width = reach.shape
    camera = Camera(np.array([[0.8 * width, 0, width / 2], [0, 60, 30], [0, 0, 1]]), width, height)
    pose = pose_from_rpy(x, y, 1.2, -np.pi / 2, 0, yaw)
    return DepthView(camera, pose, reach.astype(np.float32))


def rounded(area: shapely.Geometry) -> shapely.Geometry:
    return shapely.transform(area, lambda xy: np.round(xy * 4096) / 4096)


def seen(one: DepthView) -> shapely.Geometry:
    observation = Observation(0.0, one.map_T_camera, (), HULL, one)
    return seen_areas([observation], "hidden")[0].geometry


@settings(deadline=None, max_examples=300)
@given(
    seed=st.integers(0, 10_000),
    nearest=st.sampled_from([0.0005, 0.002, 0.01, 0.1, 1.0]),
    farthest=st.sampled_from([0.0, 0.0003, 0.002, 0.02, 0.5, 5.0]),
    width=st.sampled_from([2, 3, 20, 80]),
    place=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-4, 4)),
)
def test_areas_are_rounded_as_long_as_they_stay_valid(
    seed: int, nearest: float, farthest: float, width: int, place: tuple[float, float, float]
) -> None:
    reach = nearest + farthest * np.random.default_rng(seed).uniform(0, 1, (6, width)) ** 3
    one = view(reach, *place)
    expected = rounded(one.ground)
    expected = expected if expected.is_valid else one.ground
    found = seen(one)
    assert shapely.get_coordinates(found).tolist() == shapely.get_coordinates(expected).tolist()
    assert shapely.to_wkb(found) == shapely.to_wkb(expected)


def test_usual_ground_is_told_to_be_valid_without_geometry() -> None:
    ends = np.random.default_rng(1).uniform(1, 5, 80)  # which jump from column to column
    one = view(np.vstack([ends, ends / 5 + 0.7]))
    ring = ground_ring(one)
    assert ring is not None
    assert _round_ground(ring, one.map_T_camera, 4096)


def test_rings_that_cross_themselves_are_not_told_to_be_valid() -> None:
    one = view(np.random.default_rng(1).uniform(1, 4, (60, 80)))
    for moved in range(160):
        ring = ground_ring(one)
        assert ring is not None
        ring[moved] = ring[(moved + 57) % 160]
        ring[160] = ring[0]
        if not shapely.Polygon(ring).is_valid:
            assert not _round_ground(ring, one.map_T_camera, 4096)


@pytest.mark.parametrize("kind", ["no view", "looking down", "outside"])
def test_other_areas_are_rounded_too(kind: str) -> None:
    one = view(np.full((6, 8), 2.0))
    if kind == "looking down":
        one = DepthView(one.camera, pose_from_rpy(0, 0, 1, np.pi, 0, 0), one.reach)
    each = Observation(0.0, one.map_T_camera, (), HULL, None if kind == "no view" else one)
    (area,) = seen_areas([each], "outside" if kind == "outside" else "hidden")
    assert area.geometry.equals_exact(shapely.box(0, 0, 1, 1), 0)
