"""A detector that knows the truth, and how it errs."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.perception.detections import Detections
from hypermap.simulation.detector import (
    EXACT_DETECTOR,
    WALL_NAMES,
    DetectorNoise,
    NoisyDetector,
    visible_boxes,
)
from hypermap.simulation.lasting import LastingFaults, like_classes

NAMES = ["cup", "chair", "table"]


def image() -> np.ndarray:
    """A cup of 10 x 12 pixels, a chair in two pieces, and no table."""
    instances = np.full((60, 80), -1, dtype=np.int32)
    instances[20:32, 30:40] = 0
    instances[5:15, 0:10] = 1
    instances[40:60, 50:55] = 1
    return instances


def detect(noise: DetectorNoise, frames: int = 1, seed: int = 0) -> list[Detections]:
    detector = NoisyDetector(NAMES, noise, np.random.default_rng(seed))
    return [detector.detect(image()) for _ in range(frames)]


def only(**noise: float) -> DetectorNoise:
    """An exact detector but for the noise that is given."""
    exact = {
        "miss": 0,
        "flicker": 0,
        "looseness": 0,
        "shift": 0,
        "confusion": 0,
        "false_positives": 0,
        "walls": 0,
        "mask_margin": 0,
    }
    return DetectorNoise(**{**exact, **noise})


def test_visible_boxes_hold_all_pixels_of_an_object() -> None:
    assert visible_boxes(image(), 3).tolist() == [[30, 20, 40, 32], [0, 5, 55, 60], [0, 0, 0, 0]]


def test_an_exact_detector_finds_what_is_visible() -> None:
    (found,) = detect(EXACT_DETECTOR)
    assert found.names.tolist() == ["cup", "chair"]
    assert found.xyxy.tolist() == [[30, 20, 40, 32], [0, 5, 55, 60]]
    assert ((found.scores >= 0.5) & (found.scores <= 0.95)).all()


def test_objects_of_few_pixels_are_not_found() -> None:
    (found,) = detect(only(min_pixels=121))  # the cup has 120
    assert found.names.tolist() == ["chair"]


def test_misses_are_as_frequent_as_asked() -> None:
    found = detect(only(miss=0.3), frames=2000)
    assert sum(len(d) for d in found) / 4000 == pytest.approx(0.7, abs=0.02)


def test_flicker_loses_an_object_for_several_frames_in_a_row() -> None:
    seen = ["cup" in d.names for d in detect(only(flicker=0.02, flicker_frames=5), frames=5000)]
    runs = "".join("1" if s else "0" for s in seen).strip("1").split("1")
    lengths = [len(run) for run in runs if run]
    assert np.mean(lengths) == pytest.approx(5, rel=0.25)
    # Lost for 5 frames of every 5 + 1 / 0.02.
    assert np.mean(seen) == pytest.approx(50 / 55, abs=0.03)


def test_walls_are_taken_for_large_things_that_are_not_there() -> None:
    boxes, names = [], []
    for found in detect(only(walls=0.5), frames=1000):
        is_wall = np.isin(found.names, WALL_NAMES)
        boxes += found.xyxy[is_wall].astype(int).tolist()
        names += found.names[is_wall].tolist()
    assert set(names) == set(WALL_NAMES)
    assert 0 < len(names) <= 600  # 0.5 a frame, less those that would have shown an object
    for xmin, ymin, xmax, ymax in boxes:
        assert np.mean(image()[ymin:ymax, xmin:xmax] < 0) > 0.9
        assert (xmax - xmin) >= 0.29 * 80
        assert (ymax - ymin) >= 0.29 * 60


def test_loose_boxes_are_larger_and_still_centered() -> None:
    boxes = np.array([d.xyxy[0] for d in detect(only(looseness=0.2), frames=2000)])
    size = boxes[:, 2:] - boxes[:, :2]
    assert (size >= [10 - 1e-4, 12 - 1e-4]).all()
    assert size.mean(axis=0) == pytest.approx([12, 14.4], rel=0.03)
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2
    np.testing.assert_allclose(middles, np.tile([35, 26], (2000, 1)), rtol=1e-6)


def test_shifted_boxes_keep_their_size() -> None:
    boxes = np.array([d.xyxy[0] for d in detect(only(shift=0.1), frames=2000)])
    sizes = boxes[:, 2:] - boxes[:, :2]
    np.testing.assert_allclose(sizes, np.tile([10, 12], (2000, 1)), rtol=0, atol=1e-4)
    assert boxes[:, :2].std(axis=0) == pytest.approx([1.0, 1.2], rel=0.05)


def test_a_confused_object_gets_the_name_of_another_class() -> None:
    names = [d.names[0] for d in detect(only(confusion=0.25), frames=2000)]
    assert set(names) == set(NAMES)
    assert names.count("cup") / 2000 == pytest.approx(0.75, abs=0.03)


def test_a_world_of_one_class_cannot_be_confused() -> None:
    detector = NoisyDetector(["cup"], only(confusion=1), np.random.default_rng(0))
    assert detector.detect(np.zeros((20, 20), dtype=np.int32)).names.tolist() == ["cup"]


def test_false_positives_are_as_frequent_as_asked_and_lie_in_the_image() -> None:
    found = detect(only(false_positives=0.5, miss=1), frames=2000)
    assert sum(len(d) for d in found) / 2000 == pytest.approx(0.5, abs=0.05)
    boxes = np.concatenate([d.xyxy for d in found])
    assert (boxes >= 0).all()
    assert (boxes <= [80, 60, 80, 60]).all()
    assert (boxes[:, 2:] > boxes[:, :2]).all()


def test_boxes_never_reach_past_the_image() -> None:
    boxes = np.concatenate([d.xyxy for d in detect(only(looseness=1, shift=0.3), frames=500)])
    assert boxes.min() == 0
    assert (boxes.max(axis=0) <= [80, 60, 80, 60]).all()


def masks(noise: DetectorNoise) -> Detections:
    return NoisyDetector(NAMES, noise, np.random.default_rng(0), has_masks=True).detect(image())


def test_masks_hold_the_visible_pixels_and_a_margin_around_them() -> None:
    exact = masks(EXACT_DETECTOR)
    assert (exact.masks == [image() == 0, image() == 1]).all()
    loose = masks(only(mask_margin=2))
    assert loose.masks[0, 18:34, 35].all()
    assert loose.masks[0, :, 35].sum() == 12 + 2 * 2
    assert detect(EXACT_DETECTOR)[0].masks is None


def test_the_mask_of_a_false_positive_is_its_box() -> None:
    found = masks(only(false_positives=3, miss=1))
    assert len(found) == len(found.masks) > 0
    for mask, box in zip(found.masks, found.xyxy, strict=True):
        rows, cols = np.nonzero(mask)
        bounds = [cols.min(), rows.min(), cols.max() + 1, rows.max() + 1]
        assert bounds == pytest.approx(box, abs=0.51)


def test_at_times_nothing_at_all_is_found_for_several_frames_in_a_row() -> None:
    noise = only(blackout=0.02, blackout_frames=5)
    seen = "".join("1" if len(found) else "0" for found in detect(noise, frames=5000))
    lengths = [len(run) for run in seen.strip("1").split("1") if run]
    assert np.mean(lengths) == pytest.approx(5, rel=0.25)
    assert seen.count("1") / 5000 == pytest.approx(50 / 55, abs=0.03)


def test_small_things_are_hard_to_find_more_often_and_stay_so() -> None:
    noise = only(lasting_misses=0.4, hard_size=0.3, hard_miss=0.9)
    sizes = np.repeat([0.1, 0.3, 1.2], 5000)
    names = ["cup"] * len(sizes)
    is_hard = LastingFaults.draw(names, sizes, noise, np.random.default_rng(0)).is_hard
    shares = is_hard.reshape(3, -1).mean(axis=1)
    assert shares == pytest.approx([0.4, 0.4, 0.1], abs=0.03)
    lasting = LastingFaults(np.array([True, False, False]), ("", "", ""))
    detector = NoisyDetector(NAMES, noise, np.random.default_rng(1), lasting=lasting)
    found = [detector.detect(image()).names.tolist() for _ in range(500)]
    assert sum("cup" in names for names in found) / 500 == pytest.approx(0.1, abs=0.05)
    assert all("chair" in names for names in found)


def test_a_thing_is_taken_for_a_like_one_in_many_frames() -> None:
    noise = only(lasting_confusion=0.3, confusion_rate=0.5)
    drawn = LastingFaults.draw(["chair"] * 3000, np.ones(3000), noise, np.random.default_rng(0))
    assert np.mean([bool(alias) for alias in drawn.aliases]) == pytest.approx(0.3, abs=0.03)
    assert set(drawn.aliases) == {"", *like_classes("chair")}
    lasting = LastingFaults(np.zeros(3, dtype=bool), ("", "bench", ""))
    detector = NoisyDetector(NAMES, noise, np.random.default_rng(1), lasting=lasting)
    names = [detector.detect(image()).names.tolist() for _ in range(500)]
    assert sum(found[1] == "bench" for found in names) / 500 == pytest.approx(0.5, abs=0.07)
    assert all(found[0] == "cup" for found in names)


def test_what_looks_like_nothing_else_is_not_confused() -> None:
    drawn = LastingFaults.draw(
        ["person"], np.ones(1), only(lasting_confusion=1), np.random.default_rng(0)
    )
    assert drawn.aliases == ("",)


def test_false_places_join_the_boxes_clipped_to_the_image() -> None:
    places = Detections.of([[-5, 10, 20, 30]], ["plant"], [0.8])
    detector = NoisyDetector(NAMES, EXACT_DETECTOR, np.random.default_rng(0), has_masks=True)
    found = detector.detect(image(), places)
    assert found.names.tolist() == ["cup", "chair", "plant"]
    assert found.xyxy[2].tolist() == [0, 10, 20, 30]
    assert found.masks[2].sum() == 20 * 20


def test_an_empty_world_gives_empty_detections() -> None:
    detector = NoisyDetector([], DetectorNoise(false_positives=5), np.random.default_rng(0))
    assert len(detector.detect(np.full((10, 10), -1, dtype=np.int32))) == 0


def test_a_seed_repeats_the_detections() -> None:
    for a, b in zip(detect(DetectorNoise(), 20, 3), detect(DetectorNoise(), 20, 3), strict=True):
        assert (a.xyxy == b.xyxy).all()
        assert a.names.tolist() == b.names.tolist()


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        ({"miss": -0.1}, "miss must be a number of at least 0, got -0.1"),
        ({"miss": 1.5}, "miss must be a share from 0 to 1, got 1.5"),
        ({"blackout": 2}, "blackout must be a share from 0 to 1, got 2"),
        ({"flicker_frames": 0.5}, "flicker_frames must be at least 1, got 0.5"),
    ],
)
def test_noise_out_of_range_is_refused(noise: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DetectorNoise(**noise)
