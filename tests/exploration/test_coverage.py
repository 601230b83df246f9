"""What a camera has covered of an area: cells, and what is left, in the base frame."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from hypermap.core.errors import HypermapError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.exploration.coverage import LAYER, AreaToMap

SIDE = 0.1


def floor(pose: Pose2D | None = None) -> Hypermap:
    """A free floor of 10 x 8 m, whose frame lies anywhere in the base frame."""
    cells = np.zeros((80, 100), dtype=np.int8)
    base = OccupancyLayer("first", "map")
    grid = OccupancyLayer("occupancy", "floor", GridGeometry(100, 80, SIDE), cells)
    return Hypermap([base, grid], FrameTree([Transform("map", "floor", pose or Pose2D())]))


@pytest.mark.parametrize("pose", [Pose2D(), Pose2D(3.0, -2.0, math.radians(30))])
def test_what_is_left_of_an_area_is_told_in_the_base_frame(pose):
    hypermap = floor(pose)
    wanted = pose.apply_geometry(shapely.box(2, 2, 8, 6))
    area, layer = AreaToMap.begun(hypermap, wanted)
    hypermap = hypermap.with_layers([*hypermap, layer])
    begun = area.coverage(hypermap)
    assert begun is not None
    assert begun.share == 0
    assert begun.rest.symmetric_difference(wanted).area < 2 * 2 * SIDE * wanted.length

    left_half = pose.apply_geometry(shapely.box(0, 0, 5, 8))
    hypermap = hypermap.with_layer(area.covered(left_half, hypermap, hypermap[LAYER]))
    half = area.coverage(hypermap)
    assert half is not None
    assert half.share == pytest.approx(0.5, abs=0.02)
    assert half.area is wanted
    right_half = pose.apply_geometry(shapely.box(5, 2, 8, 6))
    assert half.rest.symmetric_difference(right_half).area < 2 * SIDE * wanted.length

    everything = wanted.buffer(1)
    hypermap = hypermap.with_layer(area.covered(everything, hypermap, hypermap[LAYER]))
    done = area.coverage(hypermap)
    assert done is not None
    assert (done.share, done.rest.is_empty) == (1, True)


def test_a_map_that_has_lost_the_layer_tells_nothing():
    hypermap = floor()
    area, _ = AreaToMap.begun(hypermap, shapely.box(2, 2, 8, 6))
    assert area.coverage(hypermap) is None
    other = OccupancyLayer(LAYER, "map", GridGeometry(3, 3, SIDE), np.zeros((3, 3), np.int8))
    assert area.coverage(hypermap.with_layers([*hypermap, other])) is None


def test_an_area_off_the_map_is_refused():
    with pytest.raises(HypermapError, match="covers no cell of layer 'occupancy'"):
        AreaToMap.begun(floor(), shapely.box(50, 50, 60, 60))
    with pytest.raises(HypermapError, match="no occupancy layer yet"):
        AreaToMap.begun(Hypermap(), shapely.box(0, 0, 1, 1))
