from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from hypermap.perception.detectors.placement import (
    Placement,
    centered,
    sample_bilinear,
    stretched,
    top_left,
)

sizes = st.tuples(st.integers(1, 700), st.integers(1, 700))
placements = st.builds(
    lambda place, image_size, input_size: place(image_size, input_size),
    st.sampled_from([top_left, centered, stretched]),
    sizes,
    sizes,
)


@pytest.mark.parametrize(
    ("place", "image_size", "expected"),
    [
        (top_left, (640, 480), ((416, 312), 0, 0)),
        (top_left, (480, 640), ((312, 416), 0, 0)),
        (top_left, (208, 104), ((416, 208), 0, 0)),
        (centered, (640, 480), ((416, 312), 0, 52)),
        (centered, (480, 640), ((312, 416), 52, 0)),
        (centered, (416, 415), ((416, 415), 0, 0)),  # the odd row of gray lies below
        (stretched, (640, 480), ((416, 416), 0, 0)),
        (top_left, (10000, 1), ((416, 1), 0, 0)),
    ],
)
def test_an_image_is_placed_as_the_networks_expect(
    place: object, image_size: tuple[int, int], expected: tuple[tuple[int, int], int, int]
) -> None:
    placement = place(image_size, (416, 416))
    assert (placement.size, placement.left, placement.top) == expected


@given(placements)
def test_the_image_lies_inside_the_input(placement: Placement) -> None:
    assert 0 <= placement.left <= placement.left + placement.size[0] <= placement.input_size[0]
    assert 0 <= placement.top <= placement.top + placement.size[1] <= placement.input_size[1]


@given(placements, st.floats(0, 1), st.floats(0, 1))
def test_a_box_comes_back_from_the_input_to_where_it_was(
    placement: Placement, x: float, y: float
) -> None:
    width, height = placement.image_size
    columns, rows = placement.to_input(np.array([0, x * width]), np.array([0, y * height]))
    box = np.array([[columns[0], rows[0], columns[1], rows[1]]])
    np.testing.assert_allclose(placement.to_image(box), [[0, 0, x * width, y * height]], atol=1e-3)


def test_boxes_are_cut_off_at_the_edges_of_the_image() -> None:
    placement = centered((128, 96), (64, 64))
    boxes = placement.to_image(np.array([[-10.0, 0, 100, 64], [70, 60, 80, 64]]))
    assert boxes.tolist() == [[0, 0, 128, 96], [128, 96, 128, 96]]


def test_around_the_image_there_is_gray() -> None:
    filled = centered((4, 2), (8, 8)).fill(np.full((2, 4, 3), 7, np.uint8))
    assert filled.dtype == np.float32
    assert (filled[2:6] == 7).all()
    assert (filled[:2] == 114).all()
    assert (filled[6:] == 114).all()


def test_an_image_that_needs_no_resizing_stays_as_it_is() -> None:
    image = np.random.default_rng(1).integers(0, 256, (31, 17, 3)).astype(np.uint8)
    np.testing.assert_array_equal(top_left((17, 31), (17, 31)).fill(image), image)


def test_a_plane_stays_a_plane_under_interpolation() -> None:
    rows, columns = np.indices((20, 30)).astype(float)
    asked_rows, asked_columns = np.array([0.3, 7.75, 19]), np.array([0, 12.5, 28.9])
    sampled = sample_bilinear(3 * rows - 2 * columns, asked_rows, asked_columns)
    np.testing.assert_allclose(
        sampled, 3 * asked_rows[:, np.newaxis] - 2 * asked_columns, atol=1e-5
    )


@pytest.mark.parametrize("size", [(416, 312), (100, 333), (1000, 900)])
def test_resizing_agrees_with_pillow_sampling_the_image_between_four_pixels(
    size: tuple[int, int],
) -> None:
    image = np.random.default_rng(2).integers(0, 256, (480, 640, 3)).astype(np.uint8)
    expected = Image.fromarray(image).transform(
        size,
        Image.Transform.AFFINE,
        (640 / size[0], 0, 0, 0, 480 / size[1], 0),
        Image.Resampling.BILINEAR,
    )
    filled = stretched((640, 480), size).fill(image)
    assert np.abs(filled - np.asarray(expected, float)).max() <= 1.01  # Pillow cuts fractions off
