"""Going on with a saved map gives what mapping in one go gives, wherever it was cut."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import logging
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map
from hypermap.mapping.config import profile
from hypermap.mapping.going_on import CannotGoOn
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.overrides import override
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.simulation.levels import errors_of_level

from .test_mapper import CONFIG, boxes, frame, walk

pytestmark = pytest.mark.xdist_group("going_on")  # they share what takes long to make

SMALL = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)
OF_THE_DRIVES = {"hmap_config.yaml", "mapper_state"}  # members that tell of the drives
SOURCE = detections_from_recording()


@functools.cache
def drive() -> list[RgbdFrame]:
    """Frames with all errors that a robot has."""
    recording = SimulatedRecording.with_errors(
        demo_world(), errors_of_level("robot"), camera=SMALL, rate=1.0, has_occupancy=False
    )
    return list(recording.frames())


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        names = (n for n in archive.namelist() if not n.startswith("history."))
        return {n: archive.read(n) for n in names if n not in OF_THE_DRIVES}


@functools.cache
def in_one_go(name: str) -> Hypermap:
    mapper = Mapper(profile(name), SOURCE, drive="day")
    for each in drive():
        mapper.add(each)
    return mapper.hypermap()


def saved_and_opened(hypermap: Hypermap, path: Path) -> Hypermap:
    save_map(hypermap, path)
    return open_map(path)


@pytest.mark.parametrize("name", ["default", "thesis"])
@settings(max_examples=5, deadline=None)
@example(cuts={0})
@example(cuts={1, 2, 3})
@given(cuts=st.sets(st.integers(0, 25), min_size=1, max_size=3))
def test_a_drive_that_is_cut_anywhere_gives_the_map_of_one_go_byte_for_byte(
    name: str, cuts: set[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("maps")
    mapper = Mapper(profile(name), SOURCE, drive="day")
    for i, each in enumerate(drive()):
        if i in cuts:
            so_far = saved_and_opened(mapper.hypermap(), folder / "so_far.hmap")
            mapper = Mapper.onto(so_far, SOURCE, profile(name), "day")
        mapper.add(each)
    whole, parts = in_one_go(name), mapper.hypermap()
    save_map(whole, folder / "whole.hmap")
    save_map(parts, folder / "parts.hmap")
    assert contents(folder / "parts.hmap") == contents(folder / "whole.hmap")
    assert len(whole["semantic"].objects()) > 3
    assert parts.metadata["frames"] == whole.metadata["frames"]


def test_with_a_known_occupancy_map_the_objects_are_the_same() -> None:
    recording = SimulatedRecording.with_errors(
        demo_world(), errors_of_level("robot"), camera=SMALL, rate=1.0
    )
    whole = Mapper(CONFIG, SOURCE, recording.occupancy())
    parts = Mapper(CONFIG, SOURCE, recording.occupancy())
    for i, each in enumerate(recording.frames()):
        if i == 13:
            parts = Mapper.onto(parts.hypermap(), SOURCE)
        whole.add(each)
        parts.add(each)
    expected = {item.id: item for item in whole.hypermap().semantic()}
    found = {item.id: item for item in parts.hypermap().semantic()}
    assert expected.keys() == found.keys()
    for number, item in expected.items():
        one, other = item.footprint, found[number].footprint
        assert (item.name, item.existence) == (found[number].name, found[number].existence)
        assert one.intersection(other).area >= 0.98 * one.union(other).area


def test_the_drive_of_this_test_is_longer_than_its_cuts_and_leaves_unpublished_tracks() -> None:
    mapper = Mapper(profile("default"), SOURCE)
    for each in drive():
        mapper.add(each)
    assert len(drive()) > 25
    assert len(mapper.evidence.tracks().objects) > len(mapper.evidence)


def mapped(frames: Sequence[RgbdFrame], drive: str = "monday") -> Hypermap:
    mapper = Mapper(CONFIG, boxes, drive=drive)
    for each in frames:
        mapper.add(each)
    return mapper.hypermap()


def test_frames_that_are_in_the_map_already_count_once(tmp_path: Path) -> None:
    first = saved_and_opened(mapped(walk().items), tmp_path / "a.hmap")
    again = Mapper.onto(first, boxes, drive="monday again")
    for each in walk(8).items:  # two of which are new
        again.add(each)
    assert (again.counts.repeated, again.counts.used) == (6, 2)
    expected = mapped(walk(8).items)
    assert again.hypermap()["semantic"].get(0).attributes == expected["semantic"].get(0).attributes
    assert [d["name"] for d in again.hypermap().metadata["drives"]] == ["monday", "monday again"]
    assert again.hypermap().metadata["frames"] == {
        "used": 8,
        "skipped": 0,
        "unusable": 0,
        "repeated": 6,
    }


def test_a_camera_at_rest_looks_again_as_if_mapping_had_never_stopped(tmp_path: Path) -> None:
    still = [frame(i) for i in range(20)]  # of which 0, 1, 3, 7 and 15 are keyframes
    first = saved_and_opened(mapped(still[:10]), tmp_path / "a.hmap")
    rest, again = (Mapper.onto(first, boxes, drive="monday") for _ in range(2))
    for each in still[10:]:
        rest.add(each)
    for each in still:
        again.add(each)
    assert (rest.counts.used, again.counts.used, again.counts.repeated) == (1, 1, 4)


def test_another_drive_with_the_same_stamps_is_another_drive(tmp_path: Path) -> None:
    first = saved_and_opened(mapped(walk().items), tmp_path / "a.hmap")
    other = Mapper.onto(first, boxes, drive="tuesday")
    for each in walk().items:
        nearer = dataclasses.replace(each, depth=(each.depth - 0.01).astype(np.float32))
        other.add(nearer)
    assert (other.counts.repeated, other.counts.used) == (0, 6)


def test_the_drives_are_listed_with_times_of_day() -> None:
    late = [dataclasses.replace(each, stamp=1.7e9 + each.stamp) for each in walk().items]
    assert mapped(late).metadata["drives"] == [
        {
            "name": "monday",
            "frames": 6,
            "began": "2023-11-14T22:13:20Z",
            "ended": "2023-11-14T22:13:25Z",
        }
    ]
    assert mapped(walk().items).metadata["drives"] == [{"name": "monday", "frames": 6}]


def test_other_layers_frames_and_metadata_stay(tmp_path: Path) -> None:
    first = mapped(walk(3).items)
    zone = SemanticObject("wet floor", shapely.box(1, 1, 2, 2))
    first.add(SemanticLayer("zones", "map", [zone]))
    first.metadata["floor"] = "2nd"
    first["semantic"].settings["publish_global_topics"] = True
    again = saved_and_opened(first, tmp_path / "a.hmap")
    mapper = Mapper.onto(again, boxes)
    for each in walk().items:
        mapper.add(each)
    made = mapper.hypermap()
    assert [layer.name for layer in made] == ["occupancy", "semantic", "zones"]
    assert made["zones"] is again["zones"]
    assert made.metadata["floor"] == "2nd"
    assert made["semantic"].settings["publish_global_topics"] is True


def test_a_drive_without_a_source_of_detections_leaves_the_objects_as_they_are() -> None:
    mapper = Mapper.onto(mapped(walk().items), None)
    for i in range(6, 12):
        mapper.add(dataclasses.replace(frame(i, x=0.1 * i), depth=np.full((120, 160), 2.0, "f4")))
    (box,) = mapper.hypermap()["semantic"].objects()
    assert mapper.counts.used == 6
    assert box.existence == mapped(walk().items)["semantic"].get(0).existence


def test_map_recording_goes_on_with_a_map() -> None:
    first = map_recording(walk(3), boxes, CONFIG)
    made = map_recording(walk(), boxes, CONFIG, onto=first)
    assert made.metadata["frames"] == {"used": 6, "skipped": 0, "unusable": 0, "repeated": 3}
    with pytest.raises(ValueError, match="already has an occupancy layer"):
        map_recording(walk(), boxes, CONFIG, made["occupancy"], onto=first)


def _without_state(hypermap: Hypermap) -> Hypermap:
    hypermap.mapper_state = None
    return hypermap


def _damaged(hypermap: Hypermap) -> Hypermap:
    hypermap.mapper_state = hypermap.mapper_state()[:-7]
    return hypermap


def _of_a_wrong_policy(hypermap: Hypermap) -> Hypermap:
    hypermap.metadata["history"] = {"keep": "long"}
    return hypermap


def _of_the_future(hypermap: Hypermap) -> Hypermap:
    hypermap.metadata["config"]["evidence"]["telepathy"] = 3
    return hypermap


@pytest.mark.parametrize("name", ["default", "thesis"])
def test_settings_that_an_earlier_version_did_not_know_are_those_of_the_profile(name: str) -> None:
    hypermap = Mapper(profile(name), SOURCE).hypermap()
    for key in ("detection_rate", "min_probability"):
        del hypermap.metadata["config"]["evidence"][key]
    assert Mapper.onto(hypermap, SOURCE).config == profile(name)
    assert Mapper.onto(hypermap, SOURCE, profile(name)).config == profile(name)


def test_a_map_with_defaults_of_an_earlier_version_keeps_them_when_its_profile_is_named() -> None:
    hypermap = Mapper(profile("default"), SOURCE).hypermap()
    hypermap.metadata["config"]["evidence"]["loss"] = 0.321
    going_on = Mapper.onto(hypermap, SOURCE, profile("default"))
    assert going_on.config.evidence.loss == 0.321
    other = override(profile("default"), {"evidence": {"loss": 0.4}})
    with pytest.raises(CannotGoOn, match=r"made with evidence: loss: 0.321, not 0.4"):
        Mapper.onto(hypermap, SOURCE, other)


@pytest.mark.parametrize(
    ("spoil", "options", "message"),
    [
        (lambda _: Hypermap(), {}, "this map was not made by mapping"),
        (
            _without_state,
            {},
            "the state of the mapper is not in the map, for example after --drop-evidence",
        ),
        (_damaged, {}, "mapper_state: is damaged: 'view.area.lengths' ends too early; map all"),
        (
            _of_the_future,
            {},
            "made by another version: config: evidence.telepathy: unk",
        ),
        (
            _of_a_wrong_policy,
            {},
            "keep: expected a time such as 90d, got 'long'; `hypermap history",
        ),
        (lambda m: m, {"config": profile("thesis")}, "made with perception: method: enclosed, not"),
        (lambda m: m, {"frame_id": "odom"}, "the poses are in the frame 'odom', and the map in"),
    ],
    ids=[
        "not ours",
        "no state",
        "damaged",
        "newer",
        "policy",
        "other configuration",
        "other frame",
    ],
)
def test_mapping_says_why_it_cannot_go_on(spoil, options, message) -> None:
    hypermap = spoil(mapped(walk(3).items))
    with pytest.raises(CannotGoOn) as error:
        Mapper.onto(hypermap, boxes, **options)
    assert message in str(error.value)


def test_a_map_whose_state_was_lost_opens_and_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    save_map(mapped(walk(3).items), tmp_path / "a.hmap")
    with (
        zipfile.ZipFile(tmp_path / "a.hmap") as old,
        zipfile.ZipFile(tmp_path / "b.hmap", "w") as b,
    ):
        for name in old.namelist():
            if name != "mapper_state":
                b.writestr(name, old.read(name))
    with caplog.at_level(logging.WARNING):
        lost = open_map(tmp_path / "b.hmap")
    assert len(lost["semantic"].objects()) == 1
    assert "mapping cannot continue this map" in caplog.text
    with pytest.raises(HypermapError):
        Mapper.onto(lost, boxes)


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_a_spoiled_state_is_one_error_or_a_map(data: st.DataObject) -> None:
    hypermap = mapped(walk(2).items)
    content = bytearray(hypermap.mapper_state())
    head = content.index(b"\n")
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, min(len(content), 2 * head) - 1))
        content[at] = data.draw(st.integers(0, 255))
    hypermap.mapper_state = bytes(content)
    with contextlib.suppress(CannotGoOn):
        Mapper.onto(hypermap, boxes).hypermap()
