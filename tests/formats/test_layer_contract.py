from __future__ import annotations

from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
import shapely

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Layer
from hypermap.core.notes import Note
from hypermap.core.notes_layer import NotesLayer
from hypermap.core.samples import Samples
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.value_layer import ValueLayer
from hypermap.notes import attachment_of_bytes
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


class TestValueLayer(LayerContract):
    class_name = "ValueLayer"

    @pytest.fixture
    def layer(self) -> Layer:
        nan = np.nan
        return ValueLayer(
            "warmth",
            "map",
            GridGeometry(3, 2, 0.5, Pose2D(2.0, -1.0, 0.3)),
            [[19.1, 20.7, 21.3], [21.3, 22.0, nan]],
            "°C",
            2,
            quantity="temperature",
            deviations=[[0.5, 0.25, 0.5], [0.5, 1.0, nan]],
            stamps=[[1e9, nan, nan], [nan, 1.5e9, nan]],
            samples=Samples.of([[2.1, -0.9], [2.9, 0.1]], [19.0, 22.1], [False, True], [1e9, nan]),
            made_by={"method": "gmrf", "length": 2.5},
        )


class TestNotesLayer(LayerContract):
    class_name = "NotesLayer"

    @pytest.fixture
    def layer(self) -> Layer:
        evening = datetime(2026, 5, 4, 18, 30, tzinfo=timezone(timedelta(hours=2)))
        log = attachment_of_bytes(b"battery low\n", "robot.log")
        hall = shapely.MultiPolygon([shapely.box(0, 0, 2, 1), shapely.box(2.5, 0, 4, 1)])
        return NotesLayer(
            "notes",
            "map",
            [
                Note(shapely.Point(1.5, 0.25), "# Loose tile\nGo *slowly*.", "Ada", evening),
                Note(shapely.Point(4, 3), "", "", evening, (log,), ("https://example.org/a?b",)),
                Note(hall, "wet floor", "robot 7", evening, id=9, changed=evening),
            ],
            next_id=12,
        )


class TestValueLayerOfNumbersAlone(LayerContract):
    class_name = "ValueLayer"

    @pytest.fixture
    def layer(self) -> Layer:
        return ValueLayer("warmth", "map", GridGeometry(3, 1, 2.0), [[19, 20, np.nan]])
