"""How well objects in one place match, whatever their class."""

from __future__ import annotations

import pytest
import shapely

from hypermap.mapping.footprint_iou import footprint_ious
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.track_shapes import TrackShapes


@pytest.mark.parametrize(
    ("heights", "ious"),
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
def test_what_shares_less_than_half_of_the_height_does_not_match(
    heights: tuple[float, float], ious: float
) -> None:
    known = TrackShapes()
    known.append(0, PreparedPolygon.of(shapely.box(9, 9, 10, 10)), (0.5, 1.5))
    known.append(1, PreparedPolygon.of(shapely.box(1, 0, 3, 1)), (0.5, 1.5))
    shape = PreparedPolygon.of(shapely.box(0, 0, 2, 1))
    assert footprint_ious(shape, heights, known, [1, 0]) == pytest.approx([ious, 0.0])
