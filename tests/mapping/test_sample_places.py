"""Samples move with the frames of their time when poses are corrected."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.core.trajectory import pose_from_rpy
from hypermap.core.value_layer import ValueLayer
from hypermap.mapping.floor_motions import FloorMotions
from hypermap.mapping.sample_places import with_moved_samples
from hypermap.values import value_layer_of

STAMPS = np.array([100.0, 110, 120, 10_000, 10_020])
WALLS = OccupancyLayer("occupancy", "map", GridGeometry(60, 60, 0.1), np.zeros((60, 60), np.int8))


def motions(is_under_way: bool = False) -> FloorMotions:
    """Those of two drives: the first one moves ever farther along x, the second one turns about."""
    before = np.repeat(np.eye(4)[np.newaxis], 5, axis=0)
    after = np.array(
        [
            *(pose_from_rpy(x, 0, 0, 0, 0, 0) for x in (0.0, 1.0, 2.0)),
            *(pose_from_rpy(0, 0, 0.3, 0, 0, np.pi) for _ in range(2)),
        ]
    )
    return FloorMotions.between(STAMPS, before, after, np.array([0, 0, 0, 1, 1]), is_under_way)


def at(*stamps: float) -> Samples:
    """Samples at (1, 3)."""
    count = len(stamps)
    return Samples.of(np.tile([1.0, 3], (count, 1)), np.arange(count), stamps=stamps)


@pytest.mark.parametrize(
    ("stamp", "place"),
    [
        (100, (1, 3)),
        (105, (1.5, 3)),  # between two frames
        (110, (2, 3)),
        (119, (2.9, 3)),
        (125, (3, 3)),  # soon after the last frame
        (5000, (1, 3)),  # of no drive
        (9990, (-1, -3)),  # just before the first frame
        (10_011, (-1, -3)),
        (20_000, (1, 3)),
        (np.nan, (1, 3)),
    ],
)
def test_a_sample_moves_as_the_frames_of_its_time(stamp: float, place: tuple[float, float]) -> None:
    assert motions().moved(at(stamp)).points_xy[0] == pytest.approx(place, abs=1e-9)


def test_while_the_drive_goes_on_all_later_samples_belong_to_it() -> None:
    assert motions(is_under_way=True).moved(at(20_000)).points_xy[0] == pytest.approx((-1, -3))


def test_of_drives_with_the_same_stamps_the_one_that_was_there_takes_the_sample_along() -> None:
    before = np.array([pose_from_rpy(x, 3, 0, 0, 0, 0) for x in (0, 1, 8, 9)])
    after = np.array([pose_from_rpy(x, 5, 0, 0, 0, 0) for x in (0, 1, 8.5, 9.5)])
    both = FloorMotions.between(np.array([0.0, 10, 0, 10]), before, after, np.array([0, 0, 1, 1]))
    taken = Samples.of([[1.5, 3], [8.0, 3]], [0.0, 1.0], stamps=[5.0, 5.0])
    assert both.moved(taken).points_xy == pytest.approx(np.array([[1.5, 5], [8.5, 5]]))


def layer(points: NDArray[np.float64], stamps: NDArray[np.float64], frame: str) -> ValueLayer:
    samples = Samples.of(points, 20 + points[:, 0], stamps=stamps)
    made = value_layer_of("warmth", samples, frame_id=frame, unit="°C")
    made.settings["enable_update"] = False
    return made


def test_the_field_of_moved_samples_is_made_again_in_its_own_frame() -> None:
    points = np.random.default_rng(1).uniform(1, 3, (12, 2))
    cellar = Transform("map", "cellar", Pose2D(0, 0, np.pi / 2))
    hypermap = Hypermap([WALLS, layer(points, np.full(12, 110.0), "cellar")], FrameTree([cellar]))
    moved = with_moved_samples(hypermap, motions, lambda: WALLS)["warmth"]
    assert isinstance(moved, ValueLayer)
    assert moved.samples is not None
    np.testing.assert_allclose(moved.samples.points_xy, points - [0, 1], atol=1e-9)
    before = hypermap["warmth"]
    assert isinstance(before, ValueLayer)
    own = {name: moved.made_by[name] for name in ("method", "length", "noise")}
    assert own.items() <= before.made_by.items()
    assert (moved.frame_id, moved.unit) == ("cellar", "°C")
    place = points[0] - [0, 1]
    assert moved.value_at([place])[0] == pytest.approx(20 + points[0, 0], abs=0.3)


def test_what_did_not_move_or_cannot_be_made_again_stays(caplog: pytest.LogCaptureFixture) -> None:
    points = np.random.default_rng(1).uniform(1, 3, (12, 2))
    still = layer(points, np.full(12, 5000.0), "map")
    assert with_moved_samples(Hypermap([WALLS, still]), motions, lambda: WALLS)["warmth"] is still
    by_hand = ValueLayer(
        "gas",
        "map",
        still.grid,
        still.cells,
        samples=layer(points, np.full(12, 110.0), "map").samples,
    )
    after = with_moved_samples(Hypermap([WALLS, by_hand]), motions, lambda: WALLS)
    assert after["gas"] is by_hand
    assert "the samples of layer 'gas' stay where they were" in caplog.text
