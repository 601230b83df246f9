"""Motion along bare walls, seen by the texture of the floor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hypermap.mapping.pose_graph.building import Building
from hypermap.mapping.pose_graph.planar import between, planar
from hypermap.mapping.pose_graph.texture import Textures, align
from hypermap.mapping.pose_graph.view import View
from hypermap.perception.frame import RgbdFrame

from .rooms import pose, seen_from

CORRIDOR = ((-20.0, 0.0, 0.0), (40.0, 2.0, 2.5))
ALONG, AHEAD = np.array([1.0, 0.0]), np.array([1.0, 0.0, 0.0])


def carpet(frame: RgbdFrame, contrast: float = 60.0) -> np.ndarray:
    """Return a color image of a floor with a pattern between gray walls."""
    points = frame.points() @ frame.map_T_camera[:3, :3].T + frame.map_T_camera[:3, 3]
    x, y = points[..., 0], points[..., 1]
    pattern = np.sin(9 * x + 4 * y) + np.sin(5 * x - 11 * y + 2)
    bright = np.where(points[..., 2] < 0.2, 130 + contrast / 2 * pattern, 160.0)
    return np.repeat(bright[..., np.newaxis], 3, axis=2).astype(np.uint8)


def textures(frames: list[RgbdFrame], colors: list[np.ndarray | None]) -> list:
    kept = Textures(len(frames))
    for i, (frame, color) in enumerate(zip(frames, colors, strict=True)):
        kept.add(i, View.of(frame), replace(frame, color=color))
    return [kept.of(i) for i in range(len(frames))]


def corridor(*xs: float, yaw_deg: float = 0.0) -> list[RgbdFrame]:
    return [seen_from(pose(x, 1.0, yaw_deg), stamp=x, room=CORRIDOR, boxes=()) for x in xs]


@pytest.mark.parametrize("way", [0.15, 1.0])
@pytest.mark.parametrize("off", [-0.04, 0.03])
def test_a_carpet_tells_how_far_a_camera_has_gone_along_bare_walls(way: float, off: float) -> None:
    frames = corridor(0.3, 0.3 + way)
    first, second = textures(frames, [carpet(frame) for frame in frames])
    true = between(*(planar(frame.map_T_camera) for frame in frames))
    found = align(first, second, true + off * AHEAD, ALONG)
    assert found is not None
    assert found[0] == pytest.approx(true, abs=0.006)
    assert 0.02 <= found[1] < 0.025


def test_a_brighter_image_tells_the_same() -> None:
    frames = corridor(0.3, 0.45)
    dark, bright = carpet(frames[0]), np.minimum(1.3 * carpet(frames[1]), 255).astype(np.uint8)
    true = between(*(planar(frame.map_T_camera) for frame in frames))
    found = align(*textures(frames, [dark, bright]), true + 0.03 * AHEAD, ALONG)
    assert found is not None
    assert found[0] == pytest.approx(true, abs=0.006)


def test_noise_of_a_bare_floor_tells_nothing() -> None:
    """It changes from pixel to pixel, but not alike in both images."""
    frames, rng = corridor(0.3, 0.45), np.random.default_rng(0)
    noise = [np.clip(rng.normal(150, 15, carpet(f).shape), 0, 255).astype(np.uint8) for f in frames]
    true = between(*(planar(frame.map_T_camera) for frame in frames))
    found = align(*textures(frames, noise), true, ALONG)
    assert found is None or found[1] > 0.04
    bare = [np.full_like(one, 150) for one in noise]
    assert align(*textures(frames, bare), true, ALONG) is None


def test_only_the_newest_textures_are_kept_and_none_without_color() -> None:
    kept, frames = Textures(2), corridor(0.0, 0.2, 0.4)
    for i, frame in enumerate(frames):
        kept.add(i, View.of(frame), replace(frame, color=carpet(frame) if i else None))
    assert kept.of(1) is not None
    assert kept.of(1) is kept.of(1)
    with pytest.raises(KeyError):
        kept.of(0)
    kept.add(3, View.of(frames[0]), frames[0])
    assert kept.of(3) is None


def way_along(color_of: Callable[[RgbdFrame], np.ndarray | None], odometry: float) -> float:
    """Return how long 3 m of a bare corridor become [m] in a graph with a share of that way."""
    building = Building()
    for frame in corridor(*np.linspace(0.0, 3.0, 21)):
        counted = frame.map_T_camera.copy()
        counted[0, 3] *= odometry
        moved = replace(frame, map_T_camera=counted, color=color_of(frame))
        building.add(View.of(moved), moved)
    building.finish()
    return float(building.poses[-1, 0] - building.poses[0, 0])


def test_the_texture_of_the_floor_corrects_odometry_along_bare_walls() -> None:
    assert way_along(lambda _: None, 0.96) == pytest.approx(0.96 * 3, abs=0.03)
    assert way_along(carpet, 0.96) == pytest.approx(3, abs=0.02)


def test_dirt_on_the_lens_does_not_stop_the_way() -> None:
    """It is where it was in each image, as if the camera had not moved."""
    dirty = carpet(corridor(0.0)[0])
    assert way_along(lambda _: dirty, 1.0) == pytest.approx(3, abs=0.1)
