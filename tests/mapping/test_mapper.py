"""The whole of mapping: frames in, a hypermap out."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.config import profile, to_dict
from hypermap.mapping.counts import Counts
from hypermap.mapping.mapper import MappedFrame, Mapper
from hypermap.mapping.recording_to_map import Progress, map_recording
from hypermap.mapping.stages import KeyframeConfig
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.sources import detections_from_file
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.recording import OnBadFrame, RecordingInfo
from hypermap.recordings import RecordingOptions, open_recording

CAMERA = Camera.from_intrinsics(fx=120, fy=120, cx=79.5, cy=59.5, width=160, height=120)
CONFIG = profile("default")
# A camera 2 m above the floor that looks straight down: its x is the map's x, its y is minus y.
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def frame(i: int, x: float = 0.0) -> RgbdFrame:
    """A box of 0.4 m x 0.4 m and 0.5 m high about the map's origin, seen from above."""
    map_T_camera = DOWN.copy()
    map_T_camera[:3, 3] = x, 0.0, 2.0
    v, u = np.mgrid[0:120, 0:160]
    at_top_x, at_top_y = x + (u - 79.5) / 120 * 1.5, (v - 59.5) / 120 * 1.5
    on_box = (np.abs(at_top_x) < 0.2) & (np.abs(at_top_y) < 0.2)
    return RgbdFrame(float(i), np.where(on_box, 1.5, 2.0).astype(np.float32), CAMERA, map_T_camera)


def boxes(of: RgbdFrame) -> Detections:
    """Where the box is in the image."""
    vs, us = np.nonzero(of.depth < 1.7)
    return Detections.of([(us.min(), vs.min(), us.max() + 1, vs.max() + 1)], ["box"], [0.9])


@dataclasses.dataclass
class Frames:
    """A recording in memory."""

    items: list[Any]  # frames, and errors in place of frames that cannot be read
    map: OccupancyLayer | None = None
    path: Path = Path("some/where/walk")
    frame_id: str = "map"

    def __len__(self) -> int:
        return len(self.items)

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        for item in self.items:
            if isinstance(item, HypermapError):
                if on_bad is None:
                    raise item
                on_bad(7.5, item)
            else:
                yield item

    def info(self) -> RecordingInfo:
        raise NotImplementedError

    def occupancy(self) -> OccupancyLayer | None:
        return self.map


def walk(count: int = 6) -> Frames:
    return Frames([frame(i, x=0.1 * i - 0.25) for i in range(count)])


def test_frames_become_a_map_of_two_layers() -> None:
    hypermap = map_recording(walk(), boxes, CONFIG)
    assert [layer.name for layer in hypermap.layers] == ["occupancy", "semantic"]
    assert hypermap.base_frame == "map"
    (found,) = hypermap["semantic"].objects()
    truth = shapely.box(-0.2, -0.2, 0.2, 0.2)
    overlap = found.footprint.intersection(truth).area / found.footprint.union(truth).area
    assert overlap > 0.85
    assert (found.name, found.attributes["evidence"]) == ("box", 6)
    assert found.attributes["z_max"] == pytest.approx(0.5, abs=0.01)
    assert hypermap["occupancy"].value_at([[0.0, 0.0], [0.5, 0.5]]).tolist() == [100, 0]


def test_the_map_tells_how_it_was_made() -> None:
    metadata = map_recording(walk(), boxes, CONFIG).metadata
    assert metadata["recording"] == "walk"
    assert metadata["config"] == to_dict(CONFIG)
    assert metadata["frames"] == {"used": 6, "skipped": 0, "unusable": 0}
    assert isinstance(metadata["hypermap_version"], str)


def test_a_map_made_from_depth_is_in_the_frame_of_the_recordings_poses() -> None:
    hypermap = map_recording(dataclasses.replace(walk(), frame_id="odom"), boxes, CONFIG)
    assert [layer.frame_id for layer in hypermap] == ["odom", "odom"]


@pytest.mark.parametrize("given_by", ["recording", "caller"])
def test_a_known_occupancy_map_is_used_and_names_the_frame(given_by: str) -> None:
    grid = GridGeometry(width=2, height=2, resolution=1.0)
    known = OccupancyLayer("floor", "lab", grid, np.zeros((2, 2), np.int8))
    other = OccupancyLayer("other", "other", grid, np.zeros((2, 2), np.int8))
    if given_by == "recording":
        hypermap = map_recording(dataclasses.replace(walk(), map=known), boxes, CONFIG)
    else:
        recording = dataclasses.replace(walk(), map=other)
        hypermap = map_recording(recording, boxes, CONFIG, occupancy=known)
    assert hypermap.layers[0] is known
    assert hypermap["semantic"].frame_id == "lab"


def test_frames_whose_camera_has_not_moved_are_skipped() -> None:
    calls = []

    def source(of: RgbdFrame) -> Detections:
        calls.append(of.stamp)
        return boxes(of)

    config = dataclasses.replace(CONFIG, keyframes=KeyframeConfig(look_again=0.0))
    mapper = Mapper(config, source)
    observations = [mapper.add(frame(i, x=0.02 * i)) for i in range(6)]
    assert [observation is None for observation in observations] == [
        *[False, True, True],
        *[False, True, True],
    ]
    assert calls == [0, 3]
    assert mapper.counts == Counts(used=2, skipped=4, unusable=0)


def test_what_a_camera_at_rest_sees_is_mapped() -> None:
    mapper = Mapper(CONFIG, boxes)
    for i in range(4):
        mapper.add(frame(i))
    assert mapper.counts == Counts(used=3, skipped=1, unusable=0)
    assert [one.name for one in mapper.hypermap()["semantic"].objects()] == ["box"]


def _with_pose(pose: NDArray[np.float64]) -> RgbdFrame:
    return dataclasses.replace(frame(0), map_T_camera=pose)


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (
            dataclasses.replace(frame(0), depth=np.full((120, 160), np.nan, np.float32)),
            "its depth image is empty",
        ),
        (
            dataclasses.replace(frame(0), depth=np.full((120, 160), 65.535, np.float32)),
            "half of its depth is beyond 66 m; are the units of depth per meter right",
        ),
        (
            dataclasses.replace(frame(0), depth=np.full((120, 160), 13.107, np.float32)),
            "its depth is saturated: 100% of it is 13.107 m",
        ),
        (dataclasses.replace(frame(0), stamp=np.nan), "its stamp is not finite"),
        (_with_pose(np.full((4, 4), np.nan)), "its pose is not finite"),
        (_with_pose(np.diag([2.0, 2.0, 2.0, 1.0])), "its pose is not a rigid transform"),
        (_with_pose(np.diag([1.0, 1.0, -1.0, 1.0])), "its pose is not a rigid transform"),
        (
            dataclasses.replace(frame(0, x=0), map_T_camera=frame(0, x=1e7).map_T_camera),
            "the occupancy map would grow to",
        ),
        (
            dataclasses.replace(frame(0, x=0), map_T_camera=frame(0, x=1e300).map_T_camera),
            "its pose is more than 9e+08 m away",
        ),
    ],
    ids=[
        "no depth",
        "too far",
        "saturated",
        "no stamp",
        "no pose",
        "not rigid",
        "mirrored",
        "far away",
        "absurdly far",
    ],
)
def test_an_unusable_frame_is_counted_and_logged_and_the_rest_is_mapped(
    bad: RgbdFrame, reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    frames = walk()
    frames.items.insert(3, bad)
    with caplog.at_level(logging.WARNING):
        hypermap = map_recording(frames, boxes, CONFIG)
    assert hypermap.metadata["frames"] == {"used": 6, "skipped": 0, "unusable": 1}
    assert len(hypermap["semantic"].objects()) == 1
    assert f"frame {bad.stamp:.6f} left out: {reason}" in caplog.text


@pytest.mark.parametrize("count", [0, 3])
def test_a_recording_without_a_usable_frame_is_an_error(count: int) -> None:
    empty = dataclasses.replace(frame(0), depth=np.full((120, 160), np.nan, np.float32))
    with pytest.raises(HypermapError) as error:
        map_recording(Frames([empty] * count), boxes, CONFIG)
    assert str(error.value) == (
        f"some/where/walk: nothing to map: no frame of {count} can be used"
        + ("; the first one: its depth image is empty" if count else "")
    )


def test_a_frame_that_cannot_be_read_is_left_out_and_reported(
    caplog: pytest.LogCaptureFixture,
) -> None:
    frames = walk()
    frames.items.insert(3, FormatError("the picture is damaged", path="depth/8.png"))
    hypermap = map_recording(frames, boxes, CONFIG)
    assert hypermap.metadata["frames"] == {"used": 6, "skipped": 0, "unusable": 1}
    assert len(hypermap["semantic"].objects()) == 1
    assert "frame 7.500000 left out: depth/8.png: the picture is damaged" in caplog.text
    with pytest.raises(FormatError, match=r"depth/8\.png: the picture is damaged"):
        map_recording(frames, boxes, CONFIG, max_bad=0)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (RuntimeError("no memory left"), "failed: RuntimeError: no memory left"),
        (HypermapError("the network is gone"), "the network is gone"),
        (None, "returned NoneType, not Detections"),
        (
            Detections.of([[0, 0, 9, 9]], ["a"], masks=np.ones((1, 3, 3), bool)),
            "the masks of the detections have the shape (3, 3), the image (120, 160)",
        ),
    ],
)
def test_a_source_that_fails_at_one_frame_costs_this_frame_alone(
    fault: Any, reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    def source(of: RgbdFrame) -> Any:
        if of.stamp != 3:
            return boxes(of)
        if isinstance(fault, Exception):
            raise fault
        return fault

    # The camera stands still at first: the frame after the failed one takes its place.
    frames = Frames([*walk(3).items, frame(3, x=0.2), frame(4, x=0.2), frame(5, x=0.3)])
    hypermap = map_recording(frames, source, CONFIG)
    assert hypermap.metadata["frames"] == {"used": 5, "skipped": 0, "unusable": 1}
    assert "frame 3.000000 left out: " in caplog.text
    assert reason in caplog.text
    with pytest.raises(HypermapError):
        map_recording(frames, source, CONFIG, max_bad=0)


def test_a_full_memory_costs_its_frame_and_not_the_map(caplog: pytest.LogCaptureFixture) -> None:
    def source(of: RgbdFrame) -> Any:
        if of.stamp == 3:
            raise MemoryError
        return boxes(of)

    hypermap = map_recording(walk(6), source, CONFIG)
    assert hypermap.metadata["frames"] == {"used": 5, "skipped": 0, "unusable": 1}
    assert "not enough memory" in caplog.text
    assert "source of detections" not in caplog.text  # which is not to blame


@pytest.mark.parametrize(("bad", "is_enough"), [(2, True), (3, False)])
def test_too_many_frames_that_fail_end_it(bad: int, is_enough: bool) -> None:
    frames = walk(6)
    frames.items[:bad] = [HypermapError("broken")] * bad
    if is_enough:
        assert map_recording(frames, boxes, CONFIG, max_bad=0.4).metadata["frames"]["used"] == 4
        return
    with pytest.raises(HypermapError, match=r"walk: 3 of 6 frames cannot be used, .* broken"):
        map_recording(frames, boxes, CONFIG, max_bad=0.4)


def test_where_nothing_works_it_is_not_tried_to_the_end() -> None:
    tried = []

    def failing(of: RgbdFrame) -> Detections:
        tried.append(of.stamp)
        raise HypermapError("there is no color")

    with pytest.raises(HypermapError, match="the first one: there is no color"):
        map_recording(Frames([frame(i) for i in range(1000)]), failing, CONFIG)
    assert len(tried) <= 100


def test_a_watcher_that_fails_ends_it() -> None:
    def watch(*_: Any) -> None:
        raise HypermapError("the disk is full")

    with pytest.raises(HypermapError, match="the disk is full"):
        map_recording(walk(), boxes, CONFIG, watch=watch)


def test_of_very_many_detections_the_best_count(caplog: pytest.LogCaptureFixture) -> None:
    config = dataclasses.replace(
        CONFIG, perception=dataclasses.replace(CONFIG.perception, max_detections=1)
    )

    def crowd(of: RgbdFrame) -> Detections:
        (box,) = boxes(of).xyxy
        names, scores = ["far", "box", "unsure"], [0.8, 0.9, 0.1]
        return Detections.of([[0, 0, 50, 50], box, box], names, scores)

    hypermap = map_recording(walk(), crowd, config)
    assert [item.name for item in hypermap["semantic"].objects()] == ["box"]
    assert hypermap.metadata["surplus_detections"] == 6
    assert (
        caplog.text.count("dropped 1 detections, because only the best 1 of a frame are used") == 1
    )


def test_progress_is_reported_after_each_frame() -> None:
    reports: list[Progress] = []
    map_recording(walk(), boxes, CONFIG, on_progress=reports.append)
    assert [(report.done, report.total) for report in reports] == [(i, 6) for i in range(1, 7)]
    assert reports[-1].objects == 1
    assert reports[-1].counts == Counts(used=6)


def test_the_map_can_be_asked_for_at_any_time() -> None:
    mapper = Mapper(CONFIG, boxes)
    assert len(mapper.hypermap()["semantic"].objects()) == 0
    for item in walk().items:
        mapper.add(item)
    assert len(mapper.hypermap()["semantic"].objects()) == 1


def test_an_error_of_the_source_leaves_the_map_as_it_was() -> None:
    mapper = Mapper(CONFIG, boxes)
    for item in walk().items:
        mapper.add(item)

    def failing(of: RgbdFrame) -> Detections:
        raise HypermapError("no color")

    mapper._source = failing
    with pytest.raises(HypermapError, match="no color"):
        mapper.add(frame(9, x=1.0))
    assert mapper.counts.used == 6


def test_nothing_detected_still_gives_an_occupancy_layer() -> None:
    hypermap = map_recording(walk(), lambda _: Detections.of([], []), CONFIG)
    assert len(hypermap["semantic"].objects()) == 0
    assert hypermap["occupancy"].value_at([[0.0, 0.0]]).tolist() == [100]


@pytest.mark.parametrize("name", ["default", "thesis"])
def test_a_real_desk_is_mapped(shared_data: Path, name: str) -> None:
    recording = open_recording(shared_data / "desk", RecordingOptions(every=6))
    source = detections_from_file(shared_data / "desk" / "detections.json")
    # The reference method of perception takes a second a frame; its results have their own tests.
    config = dataclasses.replace(CONFIG, evidence=profile(name).evidence)
    hypermap = map_recording(recording, source, config)
    objects = hypermap["semantic"].objects()
    assert {"tv", "keyboard", "person", "chair"} <= {found.name for found in objects}
    for found in objects:
        assert found.existence is not None
        assert found.existence > 2
        assert found.attributes["z_max"] < 2.5


def test_who_watches_sees_each_mapped_frame_its_segments_and_the_map_as_it_is_then() -> None:
    def unsure_too(of: RgbdFrame) -> Detections:
        (box,) = boxes(of).xyxy
        return Detections.of([[0, 0, 9, 9], box], ["ghost", "box"], [0.1, 0.9])

    config = dataclasses.replace(
        CONFIG, perception=dataclasses.replace(CONFIG.perception, min_score=0.5)
    )
    frames = walk()
    frames.items.insert(2, frames.items[1])  # the camera has not moved
    seen: list[tuple[MappedFrame, Counts, list[tuple[int, int, float, float]], float]] = []

    def watch(mapped: MappedFrame, mapper: Mapper) -> None:
        known = mapper.occupancy().value_at([[0.0, 0.0]])[0]
        seen.append((mapped, mapper.counts, mapper.evidence.summary(), known))

    hypermap = map_recording(frames, unsure_too, config, watch=watch)
    assert [mapped.frame.stamp for mapped, *_ in seen] == [0, 1, 2, 3, 4, 5]
    assert [counts.frames for _, counts, *_ in seen] == [1, 2, 4, 5, 6, 7]
    for mapped, *_ in seen:
        assert mapped.detections.names.tolist() == ["box"]
        (found,) = mapped.observation.objects
        assert found.segment is not None
        assert found.segment.detection == 0
        on_box = np.flatnonzero(mapped.frame.depth.ravel() < 1.7)
        assert np.isin(found.segment.pixels, on_box).all()
        assert len(found.segment.pixels) > 0.9 * len(on_box)
    *_, summary, known = seen[-1]
    (thing,) = hypermap["semantic"].objects()
    assert summary == [(thing.id, 6, 5.0, thing.existence)]
    assert known == 100
    evidence = [{id_: count for id_, count, *_ in summary} for _, _, summary, _ in seen]
    assert [counts.get(thing.id, 0) for counts in evidence][-3:] == [4, 5, 6]


def test_segments_are_kept_for_those_who_watch_alone() -> None:
    observation = Mapper(CONFIG, boxes).add(frame(0))
    assert observation is not None
    assert [found.segment for found in observation.objects] == [None]


@pytest.mark.parametrize(
    ("has_map", "enabled", "expected"),
    [
        (True, True, "corrected by the occupancy map"),
        (True, False, "as recorded"),
        (False, True, "as recorded"),
    ],
)
def test_a_map_tells_whether_its_poses_were_corrected(
    has_map: bool, enabled: bool, expected: str
) -> None:
    grid = GridGeometry(40, 40, 0.1)
    given = OccupancyLayer("occupancy", "map", grid, np.zeros((40, 40), np.int8))
    alignment = dataclasses.replace(CONFIG.alignment, enabled=enabled)
    config = dataclasses.replace(CONFIG, alignment=alignment)
    hypermap = map_recording(walk(2), boxes, config, given if has_map else None)
    assert hypermap.metadata["poses"] == expected


def test_without_a_source_of_detections_there_are_no_objects() -> None:
    alone, both = map_recording(walk(), None, CONFIG), map_recording(walk(), boxes, CONFIG)
    assert [layer.name for layer in alone.layers] == ["occupancy"]
    np.testing.assert_array_equal(alone["occupancy"].cells, both["occupancy"].cells)


def test_a_frame_that_fails_half_way_is_in_no_layer(monkeypatch: pytest.MonkeyPatch) -> None:
    mapper = Mapper(CONFIG, boxes)
    mapper.add(frame(0, x=-0.2))
    before = mapper.hypermap()

    def out_of_memory(*_: Any) -> None:
        raise MemoryError

    with monkeypatch.context() as patched:
        patched.setattr(mapper.evidence, "update", out_of_memory)
        with pytest.raises(MemoryError):
            mapper.add(frame(1, x=0.5))
    after = mapper.hypermap()
    assert mapper.counts == Counts(used=1)
    assert after["occupancy"].grid == before["occupancy"].grid
    np.testing.assert_array_equal(after["occupancy"].cells, before["occupancy"].cells)
