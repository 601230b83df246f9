from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hypermap.core.trajectory import pose_from_rpy, transform_points
from hypermap.perception.footprints import footprint
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.outline import outer_points

CAMERA = Camera.from_intrinsics(100, 100, 79.5, 59.5, 160, 120)
POSE = pose_from_rpy(0.3, -0.2, 1.2, -2.0, 0.1, 0.7)  # looks ahead and down
VOXEL = 0.01


@pytest.mark.parametrize("step", [1, 3])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("is_cloud", [False, True])
def test_the_outer_points_have_the_footprint_of_all(seed: int, step: int, is_cloud: bool) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1, 1 + seed, (120, 160)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.2] = np.nan
    frame, valid = RgbdFrame(0.0, depth, CAMERA, POSE), np.isfinite(depth)
    if is_cloud:
        cloud = frame.points() * rng.uniform(0.99, 1.01, (120, 160, 3)).astype(np.float32)
        frame = replace(frame, cloud=cloud)
    outer = outer_points(frame, valid, POSE, VOXEL, step)
    every = frame.points(step)[valid[::step, ::step]]
    assert len(outer) < 0.8 * len(every)
    expected = footprint(transform_points(POSE, every), VOXEL)
    assert footprint(transform_points(POSE, outer), VOXEL).wkb == expected.wkb


@pytest.mark.parametrize("pixels", [0, 1, 2])
def test_all_of_too_few_points_are_outer_ones(pixels: int) -> None:
    depth = np.full((120, 160), np.nan, np.float32)
    depth[60, 70 : 70 + pixels] = 2.0
    frame = RgbdFrame(0.0, depth, CAMERA, POSE)
    assert len(outer_points(frame, np.isfinite(depth), POSE, VOXEL)) == pixels
