"""Pixels that fly between two surfaces are left out, and all others stay."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.flying_pixels import without_flying
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.segmentation import segment
from hypermap.simulation.depth_noise import DepthNoise
from hypermap.simulation.render import Rendering

SHAPE = (60, 80)


def edge() -> np.ndarray:
    """A thing at 1 m before a wall at 3 m."""
    depth = np.full(SHAPE, 3.0, dtype=np.float32)
    depth[20:50, 30:50] = 1.0
    return depth


def kept(depth: np.ndarray, support: int = 4) -> np.ndarray:
    whole = np.array([[0, 0, *depth.shape[::-1]]], dtype=np.float32)
    return without_flying(depth, np.isfinite(depth), whole, 0.002, support)


def flying_at(rows: slice, column: int = 29) -> np.ndarray:
    """The same with pixels halfway between both, at the left side of the thing."""
    depth = edge()
    depth[rows, column] = 2.0
    return depth


def test_pixels_between_two_surfaces_fly_where_there_are_many() -> None:
    depth = flying_at(slice(22, 48, 2))
    assert np.argwhere(~kept(depth)).tolist() == [[row, 29] for row in range(22, 48, 2)]
    assert kept(depth, support=0).all()
    assert kept(flying_at(slice(35, 36))).all()  # one among a hundred at an edge is a thin thing


def test_most_of_many_flying_pixels_go_and_hardly_anything_else() -> None:
    true = edge()
    view = Rendering(
        true,
        np.zeros((*SHAPE, 3), np.uint8),
        np.full(SHAPE, -1, np.int32),
        np.zeros(SHAPE, np.float32),
    )
    noise = DepthNoise(disparity_step=0, edge_loss=0, flying=0.5)
    measured = noise.measure(view, np.random.default_rng(0))
    flies = np.minimum(np.abs(measured - 1), np.abs(measured - 3)) > 0.2
    lost = ~kept(measured)
    assert flies.sum() > 50
    assert lost[flies].mean() > 0.8
    assert lost[~flies].mean() < 0.02


@pytest.mark.parametrize("size", [1, 2])
def test_thin_and_small_things_stay(size: int) -> None:
    depth = np.full(SHAPE, 3.0, dtype=np.float32)
    depth[30 : 30 + size, 10:70] = 1.0  # a thin bar
    depth[10 : 10 + size, 40 : 40 + size] = 0.8  # a speck
    assert kept(depth).all()


def test_a_slanted_floor_stays() -> None:
    # A camera 1.2 m above the floor that looks ahead, of a Kinect at 320 x 240, from 1 to 5 m.
    depth = np.broadcast_to(1.2 * 262.5 / np.linspace(63, 315, 252)[:, np.newaxis], (252, 80))
    assert kept(depth.astype(np.float32)).all()


def test_the_top_of_a_table_seen_from_a_little_above_it_stays() -> None:
    # Its rows lie 8 to 30 cm apart, more than noise explains.
    true = np.broadcast_to(0.46 * 262.5 / np.linspace(27, 40, 14)[:, np.newaxis], (14, 80))
    depth = true.astype(np.float32)
    assert (np.abs(np.diff(depth[:, 0])) > 4 * 0.002 * depth[1:, 0] ** 2).all()
    assert kept(depth).all()
    noisy = depth + np.random.default_rng(0).normal(size=depth.shape) * 0.001 * depth**2
    assert kept(noisy.astype(np.float32)).mean() > 0.97


def test_only_boxes_are_looked_at_and_they_may_reach_past_the_image() -> None:
    depth = flying_at(slice(22, 48, 2))
    depth[22:48:2, 50] = 2.0
    boxes = np.array([[-9, -9, 40, 99], [np.nan] * 4], dtype=np.float32)
    lost = ~without_flying(depth, np.isfinite(depth), boxes, 0.002, 4)
    assert np.argwhere(lost).tolist() == [[row, 29] for row in range(22, 48, 2)]
    assert without_flying(depth, np.isfinite(depth), boxes[:0], 0.002, 4).all()


def test_no_flying_pixel_counts_as_a_point_of_a_thing() -> None:
    depth = flying_at(slice(22, 48, 2))
    depth[depth == 2.0] = 1.024  # so near that it would pass for a part of the thing
    camera = Camera.from_intrinsics(60, 60, 40, 30, width=80, height=60)
    frame = RgbdFrame(0.0, depth, camera, np.eye(4))
    box = Detections.of([[28, 18, 52, 52]], ["cup"])

    def pixels(config: PerceptionConfig) -> int:
        (cut,) = segment(frame, np.isfinite(depth), box, config)
        return len(cut.points_xyz)

    assert pixels(PerceptionConfig()) == 30 * 20
    assert pixels(PerceptionConfig(min_support=0)) == 30 * 20 + 13
    assert PerceptionConfig.thesis().min_support == 0
