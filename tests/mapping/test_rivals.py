"""How alike objects in one place are, whatever their class."""

from __future__ import annotations

import pytest
import shapely

from hypermap.mapping.known_shapes import KnownShapes
from hypermap.mapping.outlines import Outline
from hypermap.mapping.rivals import likeness


@pytest.mark.parametrize(
    ("heights", "alike"),
    [
        ((0.5, 1.5), 1 / 3),  # as high
        ((0.0, 2.0), 1 / 3),  # they share half of their height
        ((1.0, 1.5), 1 / 3),
        ((0.0, 2.1), 0.0),
        ((0.5, 0.9), 0.0),
        ((1.1, 2.0), 0.0),
        ((1.5, 2.0), 0.0),  # above
        ((2.0, 3.0), 0.0),
        ((-0.5, 0.5), 0.0),  # below
    ],
)
def test_what_shares_less_than_half_of_the_height_is_no_rival(
    heights: tuple[float, float], alike: float
) -> None:
    known = KnownShapes()
    known.append(0, Outline.of(shapely.box(9, 9, 10, 10)), (0.5, 1.5))
    known.append(1, Outline.of(shapely.box(1, 0, 3, 1)), (0.5, 1.5))
    shape = Outline.of(shapely.box(0, 0, 2, 1))
    assert likeness(shape, heights, known, [1, 0]) == pytest.approx([alike, 0.0])
