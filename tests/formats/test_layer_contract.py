from __future__ import annotations

import pytest
import shapely

from hypermap.core.frames import Pose2D
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.testing import occupancy_from_text, square
from hypermap.testing.contract import LayerContract

ROOMS = """
##########
#....#???#
#....#???#
#........#
##########
"""


class TestOccupancyLayer(LayerContract):
    class_name = "OccupancyGridLayer"

    @pytest.fixture
    def layer(self) -> Layer:
        return occupancy_from_text(ROOMS, resolution=0.5, origin=Pose2D(-8.0, -20.8, 0.3))


class TestSemanticLayer(LayerContract):
    class_name = "SemanticLayer"

    @pytest.fixture
    def layer(self) -> Layer:
        bow_tie = shapely.Polygon([(4, 0), (6, 2), (6, 0), (4, 2)])
        return SemanticLayer(
            "semantic",
            "map",
            [
                square("chair", 0, 0, tags=("chair", "stool"), confidence=(0.75, 0.25)),
                square("chair", 0.25, 0.25, 0.5, id=7, existence=2.5, last_seen=12.0),
                square("potted plant", 2, 3, attributes={"color": "green"}),
                SemanticObject("table", bow_tie),
            ],
        )
