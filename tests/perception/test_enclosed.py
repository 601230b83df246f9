"""Objects in front of what runs on past their boxes: scenes of boxes, ray-cast with noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.segmentation import segment, valid_pixels
from hypermap.perception.surfaces import find_surfaces

HEIGHT, WIDTH = 240, 320
CAMERA = Camera.from_intrinsics(262.5, 262.5, 159.5, 119.5, WIDTH, HEIGHT)
NOTHING = -1

# Corners xmin, ymin, zmin, xmax, ymax, zmax in the optical frame: x right, y down, z forward.
Box = tuple[float, float, float, float, float, float]
FLOOR: Box = (-9, 1.0, 0, 9, 1.1, 9)
WALL: Box = (-9, -9, 2.5, 9, 9, 2.6)
TABLE: Box = (-0.8, 0.30, 1.2, 0.8, 0.34, 2.2)
CUP: Box = (0.10, 0.18, 1.45, 0.19, 0.2995, 1.54)
FAR_CUP: Box = (0.10, 0.20, 1.90, 0.18, 0.2995, 1.98)
NEXT_CUP: Box = (0.18, 0.20, 1.91, 0.26, 0.2995, 1.99)
SEAT: Box = (-0.25, 0.55, 1.6, 0.2, 0.60, 2.05)
BACK: Box = (-0.25, 0.10, 2.0, 0.2, 0.55, 2.05)
LEGS: tuple[Box, ...] = tuple(
    (x, 0.6, z, x + 0.04, 1.0, z + 0.04) for x in (-0.25, 0.16) for z in (1.6, 2.01)
)
CHAIR = (SEAT, BACK, *LEGS)


def look(*bodies: Box, seed: int = 1) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    """Return the depth of a scene, as noisy as a Kinect's, and which body each pixel shows."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    rays = np.stack([(u - 159.5) / 262.5, (v - 119.5) / 262.5, np.ones(u.shape)], axis=-1)
    depths = np.full((len(bodies) + 1, HEIGHT, WIDTH), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for depth, body in zip(depths[1:], np.array(bodies), strict=True):
            hits = np.sort(np.stack([body[:3] / rays, body[3:] / rays]), axis=0)
            enter, leave = hits[0].max(axis=-1), hits[1].min(axis=-1)
            depth[:] = np.where((enter < leave) & (enter > 0), enter, np.inf)
    shown = depths.argmin(axis=0) - 1
    z = np.where(shown == NOTHING, np.nan, depths.min(axis=0))
    noise = np.random.default_rng(seed).normal(0, 0.0015, z.shape)
    return (z + noise * z**2).astype(np.float32), shown


def box_of(mask: NDArray[np.bool_], looseness: float = 0.0) -> list[float]:
    """Return the box around some pixels, larger by a share of its size."""
    rows, columns = np.nonzero(mask)
    xmin, ymin, xmax, ymax = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    dx, dy = looseness / 2 * (xmax - xmin), looseness / 2 * (ymax - ymin)
    return [xmin - dx, ymin - dy, xmax + dx, ymax + dy]


def cut(
    depth: NDArray[np.float32], boxes: list[list[float]], **settings: float
) -> dict[int, NDArray[np.bool_]]:
    """Return the pixels that each detection was left with."""
    frame = RgbdFrame(0.0, depth, CAMERA, np.eye(4))
    config = replace(PerceptionConfig(), **settings)  # type: ignore[arg-type]
    detections = Detections.of(boxes, ["thing"] * len(boxes))
    masks = {}
    valid = valid_pixels(frame, config)
    for found in segment(frame, valid, detections, config):
        masks[found.detection] = np.zeros(depth.shape, dtype=bool)
        masks[found.detection].ravel()[found.pixels] = True
    return masks


def shares(found: NDArray[np.bool_], true: NDArray[np.bool_]) -> tuple[float, float]:
    """Return which share of the object was found, and which share of what was found is true."""
    both = np.count_nonzero(found & true)
    return both / np.count_nonzero(true), both / np.count_nonzero(found)


@pytest.mark.parametrize("looseness", [0.0, 0.2])
def test_a_cup_on_a_table_is_cut_out_of_table_and_wall(looseness: float) -> None:
    depth, shown = look(FLOOR, WALL, TABLE, CUP)
    cup = shown == 3
    found, precision = shares(cut(depth, [box_of(cup, looseness)])[0], cup)
    assert found > 0.8  # its foot is as near to the table as the noise is large
    assert precision > 0.98


@pytest.mark.parametrize("looseness", [0.0, 0.2])
def test_a_chair_before_a_wall_keeps_seat_back_and_legs(looseness: float) -> None:
    depth, shown = look(FLOOR, WALL, *CHAIR)
    chair = shown >= 2
    found, precision = shares(cut(depth, [box_of(chair, looseness)])[0], chair)
    assert found > 0.85
    assert precision > 0.95


def test_a_thing_in_two_boxes_belongs_to_the_smaller_one() -> None:
    depth, shown = look(FLOOR, WALL, TABLE, CUP)
    table, cup = shown == 2, shown == 3
    found = cut(depth, [box_of(table | cup), box_of(cup)])
    assert shares(found[0], table)[0] > 0.95
    assert not (found[0] & found[1]).any()
    # Without a box of its own the cup cannot be distinguished from the table that it stands on.
    assert np.count_nonzero(cut(depth, [box_of(table | cup)])[0] & cup) > 0.8 * cup.sum()


def test_a_thing_far_away_with_the_smaller_box_takes_nothing_of_the_chair_in_front() -> None:
    depth, shown = look(*CHAIR, (-1.45, 0.0, 7.0, 1.35, 2.0, 7.1))  # too far to be measured well
    chair, far = (shown >= 0) & (shown < len(CHAIR)), shown == len(CHAIR)
    boxes = [box_of(chair), box_of(far)]
    sizes = [(right - left) * (bottom - top) for left, top, right, bottom in boxes]
    assert sizes[1] < sizes[0]
    found = cut(depth, boxes)
    assert shares(found[0], chair)[0] > 0.85
    assert 1 not in found


@pytest.mark.parametrize("looseness", [0.0, 0.1])
def test_cups_that_touch_are_cut_apart_by_their_boxes(looseness: float) -> None:
    depth, shown = look(FLOOR, WALL, TABLE, FAR_CUP, NEXT_CUP)
    boxes = [box_of(shown == body, looseness) for body in (3, 4)]
    found = cut(depth, boxes)
    for number, body in enumerate((3, 4)):
        share, precision = shares(found[number], shown == body)
        assert share > 0.8
        assert precision > 0.85
    assert cut(depth, boxes, max_cut=0) == {}  # neither box encloses the surface of both


def test_one_cup_of_two_that_touch_is_cut_out_of_both() -> None:
    depth, shown = look(FLOOR, WALL, TABLE, FAR_CUP, NEXT_CUP)
    (found,) = cut(depth, [box_of(shown == 3)]).values()
    assert shares(found, shown == 3) == pytest.approx((0.9, 0.95), abs=0.1)


def test_a_table_does_not_keep_the_cups_that_are_cut_out_of_it() -> None:
    depth, shown = look(FLOOR, WALL, TABLE, FAR_CUP, NEXT_CUP)
    found = cut(depth, [box_of(shown >= 2), box_of(shown == 3), box_of(shown == 4)])
    assert shares(found[0], shown == 2)[0] > 0.95
    assert not (found[0] & (found[1] | found[2])).any()


def test_a_thing_that_the_image_cuts_off_is_still_a_thing() -> None:
    depth, shown = look(FLOOR, WALL, (-1.2, 0.0, 1.5, -0.7, 1.0, 1.9))
    found, precision = shares(cut(depth, [box_of(shown == 2)])[0], shown == 2)
    assert (found, precision) == pytest.approx((1, 1), abs=0.05)


def test_a_thing_before_what_is_too_far_to_be_measured_has_a_border_of_its_own() -> None:
    low = (-0.3, 0.0, 1.5, 0.3, 0.4, 1.9)
    before = (-0.9, 0.2, 1.2, 0.9, 1.0, 1.25)
    depth, shown = look(low, before)
    assert shares(cut(depth, [box_of(shown == 0)])[0], shown == 0) == pytest.approx((1, 1), abs=0.1)


def test_a_thing_in_a_window_before_what_is_farther_than_max_depth_is_a_thing() -> None:
    sides = [(x, -9, 1.2, x + 9, 9, 1.25) for x in (-9.5, 0.5)]
    ends = [(-9, y, 1.2, 9, y + 9, 1.25) for y in (-9.4, 0.3)]
    thing, far = (-0.2, 0.1, 2.0, 0.2, 0.9, 2.2), (-9, -9, 6, 9, 9, 6.1)
    depth, shown = look(thing, far, *sides, *ends)  # the lower end hides a part of the thing
    found = cut(depth, [box_of(shown == 0)])[0]
    assert shares(found, shown == 0) == pytest.approx((1, 1), abs=0.05)


def test_the_wall_behind_a_dark_thing_is_not_a_part_of_it() -> None:
    left, right = (-0.4, -0.2, 1.5, -0.1, 1.0, 1.6), (0.1, -0.2, 1.5, 0.4, 1.0, 1.6)
    top = (-0.4, -0.3, 1.5, 0.4, -0.2, 1.6)
    depth, shown = look(FLOOR, WALL, left, right, top)
    rows, columns = np.indices(depth.shape)
    gate = shown >= 2
    depth[gate & ~((rows % 12 < 6) & (columns % 12 < 6))] = np.nan  # a quarter of it has depth
    found = cut(depth, [box_of(gate)])[0]
    assert shares(found, gate & np.isfinite(depth)) == pytest.approx((1, 1), abs=0.05)


def test_a_wall_between_two_things_is_none_of_them() -> None:
    left, right = (-0.4, -0.2, 1.5, -0.1, 1.0, 1.6), (0.1, -0.2, 1.5, 0.4, 1.0, 1.6)
    top = (-0.4, -0.3, 1.5, 0.4, -0.2, 1.6)  # a gate, through which one sees a piece of the wall
    depth, shown = look(FLOOR, WALL, left, right, top)
    found, precision = shares(cut(depth, [box_of(shown >= 2)])[0], shown >= 2)
    assert found > 0.95
    assert precision > 0.98


def test_a_thing_far_behind_another_in_the_same_box_is_left_out() -> None:
    near, far = (-0.3, 0.0, 1.0, 0.3, 0.3, 1.1), (-0.1, -0.2, 2.0, 0.1, 0.1, 2.1)
    depth, shown = look(FLOOR, WALL, near, far)
    found = cut(depth, [box_of(shown >= 2)])[0]
    assert shares(found, shown == 2) == pytest.approx((1, 1), abs=0.03)


def test_what_hides_the_middle_of_a_thing_is_not_a_part_of_it() -> None:
    hidden = (-0.3, 0.0, 1.6, 0.3, 0.3, 1.7)  # one sees its left and its right end
    upper, lower = (-0.14, -0.02, 1.1, 0.14, 0.18, 1.15), (-0.14, 0.18, 1.2, 0.14, 0.6, 1.25)
    depth, shown = look(FLOOR, WALL, hidden, upper, lower)
    behind = shown == 2
    found = cut(depth, [box_of(shown >= 3), box_of(behind)])
    assert shares(found[1], behind) == pytest.approx((1, 1), abs=0.05)
    assert shares(found[0], shown == 4) == pytest.approx((1, 1), abs=0.05)


def test_a_book_on_a_table_is_what_its_box_cuts_out_of_the_table() -> None:
    depth, _ = look(FLOOR, WALL, TABLE)
    book = [140.0, 165.0, 180.0, 180.0]
    (found,) = cut(depth, [book]).values()
    assert box_of(found) == book


def test_what_is_in_front_of_a_thing_beyond_max_depth_is_not_the_thing() -> None:
    depth, shown = look(FLOOR, (-9, -9, 6, 9, 9, 6.1), TABLE)
    depth[20:34, 150:210] = 1.5  # two things side by side that touch, too small for a plane
    far = shown == 1
    far[20:34, 150:210] = False
    rim = int(np.flatnonzero((shown == 2).any(axis=1))[0])
    boxes = [[60.0, rim - 45, 100, rim + 15], [150.0, 4, 180, 34]]
    assert [cut(depth, [box]) for box in boxes] == [{}, {}]
    depth[far] = np.nan  # if nothing farther is measured, it may be the part that is
    assert [len(cut(depth, [box])) for box in boxes] == [1, 1]


def test_what_fills_little_of_a_box_is_not_the_thing_in_it() -> None:
    depth, shown = look(FLOOR, WALL, (0.0, 0.0, 1.5, 0.1, 0.1, 1.6))
    poster = [110.0, 70.0, 210.0, 170.0]
    assert cut(depth, [poster]) == {}
    assert shares(cut(depth, [poster], min_fit=0)[0], shown == 2) == pytest.approx((1, 1), abs=0.1)
    depth[shown < 2] = np.nan  # of a dark thing, little may be measured
    assert len(cut(depth, [poster])) == 1


def test_a_thing_that_touches_another_is_found_behind_what_fills_little_of_its_box() -> None:
    left_jar, right_jar = (-0.1, 0.1, 1.9, 0.1, 0.2995, 1.98), (0.1, 0.1, 1.91, 0.3, 0.2995, 1.99)
    depth, shown = look(TABLE, left_jar, right_jar, (-0.06, 0.12, 1.5, -0.03, 0.15, 1.51))
    jar = (shown == 1) | (shown == 3)
    assert shares(cut(depth, [box_of(jar)])[0], shown == 1) == pytest.approx((1, 1), abs=0.1)
    left = int(box_of(jar)[0])  # at the border, the fit says little: the thing may go on there
    assert cut(np.roll(depth, -left, axis=1), [box_of(np.roll(jar, -left, axis=1))]) == {}


def test_a_thing_that_touches_another_is_found_behind_what_is_scattered_over_its_box() -> None:
    left_jar, right_jar = (-0.1, 0.1, 1.9, 0.1, 0.2995, 1.98), (0.1, 0.1, 1.91, 0.3, 0.2995, 1.99)
    depth, shown = look(TABLE, left_jar, right_jar)
    left, top, right, bottom = (int(end) for end in box_of(shown == 1))
    steps = range(0, min(right - left, bottom - top), 2)
    for step in steps:
        depth[top + step, left + step] = 1.5
    assert len(steps) < 0.05 * np.count_nonzero(shown == 1)
    (found,) = cut(depth, [[left, top, right, bottom]]).values()
    assert shares(found, shown == 1) == pytest.approx((1, 1), abs=0.1)


def test_what_is_scattered_over_a_large_box_is_not_also_the_things_in_small_ones() -> None:
    depth, shown = look(
        FLOOR, WALL, TABLE, FAR_CUP, NEXT_CUP, (-0.5, -0.4, 1.9, -0.47, -0.37, 1.92)
    )
    cups, (left, top, *_) = [box_of(shown == 3), box_of(shown == 4)], box_of(shown == 5)
    large = [left - 3, top - 3, cups[1][2] + 30, cups[1][3] + 30]
    assert 300 < cut(depth, [large])[0].sum() < 0.05 * (large[2] - large[0]) * (large[3] - large[1])
    found = cut(depth, [*cups, large])
    assert set(found) >= {0, 1}
    assert np.sum([*found.values()], axis=0).max() == 1


def test_front_and_back_of_a_bowl_are_one_thing_and_a_box_farther_behind_is_not() -> None:
    front = (-0.15, 0.10, 1.0, 0.15, 0.25, 1.02)
    for behind, is_part in ((1.15, True), (1.3, False)):
        back = (-0.15 * behind, -0.04 * behind, behind, 0.15 * behind, 0.2, behind + 0.02)
        depth, shown = look(FLOOR, WALL, front, back)
        (found,) = cut(depth, [box_of(shown >= 2)]).values()
        assert [shares(found, shown == part)[0] > 0.9 for part in (2, 3)].count(True) == 1 + is_part


def test_things_before_one_another_are_apart_by_less_where_the_camera_is_near() -> None:
    def surfaces_of(depth: float) -> int:
        image = np.full((HEIGHT, WIDTH), np.nan, np.float32)
        image[100:106, 100:140], image[106:112, 100:140] = depth, depth - 0.025
        surfaces = find_surfaces(image, np.isfinite(image), CAMERA, PerceptionConfig())
        return len(surfaces.sizes)

    assert surfaces_of(0.6) == 2  # as wide as 11 pixels
    assert surfaces_of(1.6) == 1  # as wide as 4 pixels: may be a slope


def test_a_box_with_nothing_but_background_of_several_surfaces_has_no_object() -> None:
    depth, shown = look(FLOOR, WALL)
    corner = np.flatnonzero(shown[:, 50] == 0)[0]  # the first row of the floor
    assert cut(depth, [[100, corner - 30, 200, corner + 30]]) == {}


def test_planes_are_found_as_they_are() -> None:
    depth, shown = look(FLOOR, WALL)
    frame = RgbdFrame(0.0, depth, CAMERA, np.eye(4))
    config = PerceptionConfig()
    surfaces = find_surfaces(frame.depth, valid_pixels(frame, config), CAMERA, config)
    assert surfaces.planes == 2
    for body in (0, 1):
        largest = np.bincount(surfaces.labels[shown == body]).max()
        assert largest > 0.95 * np.count_nonzero(shown == body)
    assert surfaces.sizes.sum() == shown.size


def test_what_is_on_no_plane_hangs_together_up_to_two_pixels_apart() -> None:
    rng = np.random.default_rng(4)
    camera = Camera.from_intrinsics(600, 600, 19.5, 9.5, 40, 20)  # blocks are larger than the image
    config = PerceptionConfig()
    for _ in range(30):
        depth = rng.choice([1.0, 1.02, 1.2, 1.22, 2.0], (20, 40)).astype(np.float32)
        depth[rng.random(depth.shape) < rng.uniform(0.3, 0.8)] = np.nan
        found = find_surfaces(depth, np.isfinite(depth), camera, config)
        np.testing.assert_array_equal(found.labels, hanging_together(depth))
        assert found.sizes.tolist() == np.bincount(found.labels[found.labels >= 0]).tolist()


def hanging_together(depth: NDArray[np.float32]) -> NDArray[np.intp]:
    """Return the surfaces in the order of their first pixels; jumps end them from 10 cm on."""
    labels = np.full(depth.shape, -1)
    for label, seed in enumerate(zip(*np.nonzero(np.isfinite(depth)), strict=True)):
        if labels[seed] >= 0:
            continue
        labels[seed], waiting = label, [seed]
        while waiting:
            row, col = waiting.pop()
            near = np.s_[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3]
            joins = (labels[near] < 0) & (np.abs(depth[near] - depth[row, col]) < 0.1)
            labels[near][joins] = label
            waiting += [(r + near[0].start, c + near[1].start) for r, c in np.argwhere(joins)]
    return np.where(
        labels < 0, -1, np.unique(labels, return_inverse=True)[1].reshape(labels.shape) - 1
    )


def test_an_image_smaller_than_a_block_is_no_trouble() -> None:
    camera = Camera.from_intrinsics(262.5, 262.5, 2, 2, 5, 5)
    frame = RgbdFrame(0.0, np.ones((5, 5), np.float32), camera, np.eye(4))
    config = PerceptionConfig()
    surfaces = find_surfaces(frame.depth, valid_pixels(frame, config), camera, config)
    assert (surfaces.planes, surfaces.sizes.tolist()) == (0, [25])
