"""What becomes of true objects, by what they are: groups, confusions, and how near they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.experiments.breakdown import (
    KINDS,
    Kind,
    ObjectResult,
    by_class,
    by_object,
    grouped,
    objects_of,
    recall_of,
)
from hypermap.experiments.confusion import Confusion
from hypermap.experiments.drives import Mapped, SimulatedDrive
from hypermap.experiments.localization import LIMITS, localization_curve
from hypermap.experiments.results import WorldResult
from hypermap.simulation import errors_of_level
from hypermap.simulation.sightings import Sightings
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, World, WorldObject


def box(name: str, x: float, y: float, side: float = 1.0) -> SemanticObject:
    half = side / 2
    return SemanticObject(name, shapely.box(x - half, y - half, x + half, y + half))


def results() -> list[ObjectResult]:
    """Two drives past a table, which is found once, and a cup, which is never seen."""
    world = World(
        "w",
        FloorPlan((0, 0, 9, 9)),
        objects=(WorldObject("table", (2, 2)), WorldObject("cup", (5, 5))),
        drive=DrivePlan(((0.5, 2), (0.7, 2)), speed=0.2),
    )
    table = SemanticObject("table", shapely.box(1.6, 1.3, 2.4, 2.7))
    sightings = Sightings(*np.array([[9, 0], [4, 0], [0, 0]]), np.array([1.7, np.inf]))
    drives = [
        Mapped(
            SimulatedDrive(world, seed, errors_of_level("none"), 1.0),
            1,
            {"ours": found},
            sightings,
        )
        for seed, found in ((1, (table,)), (2, ()))
    ]
    return objects_of(WorldResult.of(drives), "ours")


def test_each_object_of_each_drive_has_a_result() -> None:
    found, cup, missed, _ = results()
    assert (found.number, found.name, found.found, found.found_half) == (0, "table", True, True)
    assert found.size == pytest.approx(0.8 * 1.4)
    assert (found.nearest, found.views, found.detections) == (1.7, 9, 4)
    assert found.distance == pytest.approx(0)
    assert (missed.iou, missed.found, missed.distance) == (0.0, False, None)
    assert (cup.name, cup.nearest, cup.views) == ("cup", math.inf, 0)


def test_groups_are_means_over_all_drives() -> None:
    objects = results()
    near, never = grouped(objects, KINDS["distance"])
    assert (near.words, near.objects, near.recall, near.iou) == ("1.5 to 2", 2, 0.5, 0.5)
    assert (never.words, never.objects, never.recall, never.distance) == ("not seen", 2, 0, None)
    assert [group.words for group in grouped(objects, KINDS["views"])] == ["0", "3 to 5"]
    assert [group.words for group in by_class(objects)] == ["cup", "table"]
    assert [group.words for group in by_object(objects)] == ["0 table", "1 cup"]
    assert recall_of(objects, 0, "views") == 0.25
    assert recall_of(objects, 1, "views") == 0.5
    assert recall_of(objects, 5, "detections") is None


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_each_group_has_words(kind: Kind) -> None:
    assert len(kind.edges) == len(kind.words)


def test_classes_are_confused_where_they_are_in_one_place() -> None:
    truth = [box("chair", 0, 0), box("sofa", 5, 0), box("table", 9, 9)]
    estimate = [box("sofa", 0.1, 0), box("chair", 0.1, 0), box("chair", 5, 0.1), box("cup", 3, 3)]
    confusion = Confusion.of([(estimate, truth), ([], truth)])
    assert confusion.classes == ("chair", "cup", "sofa", "table")
    expected = np.zeros((5, 5), int)
    expected[0, 0] = 1  # of the two in its place, that of its class
    expected[2, 0] = 1
    expected[3, -1] = 2
    expected[0, -1] = expected[2, -1] = 1  # of the second map
    expected[-1, 1] = expected[-1, 2] = 1
    assert confusion.counts.tolist() == expected.tolist()


def test_the_curve_takes_each_object_once_and_asks_for_no_overlap() -> None:
    truth = [box("cup", 0, 0, 0.1), box("cup", 0.3, 0, 0.1), box("bed", 5, 5)]
    estimate = [box("cup", 0.1, 0, 0.1), box("cup", -0.3, 0, 0.1), box("bed", 7, 5)]
    curve = localization_curve([(estimate, truth)])
    assert curve is not None
    at = dict(zip(LIMITS, curve, strict=True))
    # The near one is for the second cup: then both are found within 0.3 m.
    assert (at[0.1], at[0.2], at[0.32], at[1.0]) == pytest.approx((0, 1 / 3, 2 / 3, 2 / 3))
    assert localization_curve([(estimate, [])]) is None
