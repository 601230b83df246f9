"""Images behind a lens are those of a pinhole camera after rectification."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera
from hypermap.perception.lens import PLUMB_BOB, Lens
from hypermap.perception.rectification import Rectification

RAW = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)
BARREL = Lens(PLUMB_BOB, (-0.25, 0.05, 0.001, -0.002, 0.0))


def shown(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the column and row of the raw image that show a direction, by Brown's formula."""
    k1, k2, p1, p2, _ = BARREL.coefficients
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return u * 131.25 + 79.5, v * 131.25 + 59.5


def wall() -> np.ndarray:
    """Return the raw image of a tilted wall, z - 0.3 x + 0.1 y = 2 m, found by search."""
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 1400), np.linspace(-0.7, 0.7, 1100))
    u, v = shown(x, y)
    column, row = np.rint(u).astype(int), np.rint(v).astype(int)
    is_in = (column >= 0) & (column < 160) & (row >= 0) & (row < 120)
    order = np.argsort(-np.hypot(u - column, v - row)[is_in])  # the nearest to a center last
    depth = np.full((120, 160), np.nan, np.float32)
    depth[row[is_in][order], column[is_in][order]] = (2 / (1 - 0.3 * x + 0.1 * y))[is_in][order]
    return depth


@pytest.mark.parametrize("focal", [131.25, 100.0])
def test_a_rectified_wall_is_flat(focal: float) -> None:
    pinhole = Camera.from_intrinsics(focal, focal, 80.0, 58.0, width=160, height=120)
    depth = Rectification(BARREL, RAW, pinhole).depth(wall())
    assert np.isfinite(depth).mean() > 0.7
    v, u = np.mgrid[:120, :160]
    x, y = (u - 80.0) / focal, (v - 58.0) / focal
    off = depth * (1 - 0.3 * x + 0.1 * y) - 2  # half of a pixel is at most 6 mm here
    assert np.nanmax(np.abs(off)) < 0.01


def test_colors_are_where_the_lens_shows_them() -> None:
    v, u = np.mgrid[:120, :160]
    color = np.stack([u, v, u // 2 + v // 2], axis=-1).astype(np.uint8)
    rectified = Rectification(BARREL, RAW, RAW).color(color).astype(int)
    columns, rows = shown((u - 79.5) / 131.25, (v - 59.5) / 131.25)
    np.testing.assert_allclose(rectified[..., 0], columns, atol=0.51)
    np.testing.assert_allclose(rectified[..., 1], rows, atol=0.51)
    wide = Camera.from_intrinsics(60, 60, 79.5, 59.5, width=160, height=120)
    assert (Rectification(BARREL, RAW, wide).color(color)[0, 0] == 0).all()


@settings(max_examples=50)
@given(left=st.floats(-0.5, 0.3), top=st.floats(-0.4, 0.25), width=st.floats(0.05, 0.2))
def test_a_box_around_something_round_is_around_it_afterwards(
    left: float, top: float, width: float
) -> None:
    angle = np.linspace(0, 2 * np.pi, 200)
    x, y = left + width * (1 + np.cos(angle)) / 2, top + width * (1 + np.sin(angle)) / 2
    u, v = shown(x, y)
    raw = [u.min() + 0.5, v.min() + 0.5, u.max() + 0.5, v.max() + 0.5]  # borders, not centers
    (box,) = Rectification(BARREL, RAW, RAW).detections(Detections.of([raw], ["cup"])).xyxy
    sides = np.array([x.min(), y.min(), x.max(), y.max()]) * 131.25 + [80, 60, 80, 60]
    np.testing.assert_allclose(box, sides, atol=0.06 * width * 131.25 + 0.1)


def test_masks_are_rectified_and_boxes_beyond_the_lens_are_left_out() -> None:
    masks = np.zeros((2, 120, 160), bool)
    masks[0, 50:70, 70:90] = True
    lens = Lens(PLUMB_BOB, (-0.9, 0.0, 0.0, 0.0, 0.0))  # shows nothing at more than 0.406
    found = Detections.of([[70, 50, 90, 70], [0, 0, 9, 9]], ["cup", "lamp"], masks=masks)
    rectified = Rectification(lens, RAW, RAW).detections(found)
    assert rectified.names.tolist() == ["cup"]
    assert rectified.masks is not None
    assert rectified.masks.shape == (1, 120, 160)
    rows, columns = rectified.masks[0].nonzero()
    x0, y0, x1, y1 = rectified.xyxy[0]
    assert x0 - 1 <= columns.min() <= columns.max() <= x1
    assert y0 - 1 <= rows.min() <= rows.max() <= y1
    assert rectified.masks[0].sum() == pytest.approx(400, rel=0.1)


def test_of_no_detections_none_are_left() -> None:
    none = Detections.of([], [])
    assert len(Rectification(BARREL, RAW, RAW).detections(none)) == 0


def test_behind_a_lens_that_shows_nothing_all_is_unknown_and_black() -> None:
    blind = Rectification(Lens(PLUMB_BOB, (-1e300, 1e300, 0, 0)), RAW, RAW)
    assert np.isnan(blind.depth(np.ones((120, 160), np.float32))).all()
    assert not blind.color(np.ones((120, 160, 3), np.uint8)).any()
    assert len(blind.detections(Detections.of([[0, 0, 9, 9]], ["cup"]))) == 0


def test_a_rectification_travels_to_other_processes() -> None:
    one = Rectification(BARREL, RAW, RAW)
    other = pickle.loads(pickle.dumps(one))
    np.testing.assert_array_equal(other.depth(wall()), one.depth(wall()))
