"""Two maps of one place become one, as if one map had been made of both drives."""

from __future__ import annotations

import copy
import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from hypermap import (
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    Transform,
)
from hypermap.core.frames import FrameTree
from hypermap.core.history import History, Mapped
from hypermap.core.pictures import best_pictures
from hypermap.core.trajectory import trajectory_of
from hypermap.history import as_of
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.frame_log import LoggedFrame, packed_frame
from hypermap.mapping.going_on import CannotGoOn, state_of
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.mapper_state import dump_state
from hypermap.mapping.merging import CannotMerge, Merged, merge_maps
from hypermap.mapping.merging.moving import moved_tracks
from hypermap.mapping.moved_frames import moved_frames
from hypermap.mapping.overrides import override
from hypermap.perception.observation import Observation, ObservedObject

from .merging_tools import (
    ALL,
    DAY,
    HERE,
    MOVED,
    OTHER_FRAME,
    SOURCE,
    centroid,
    changed,
    first_day,
    frames,
    iou,
    mapped,
    objects_of,
    second_day,
    written,
)

pytestmark = pytest.mark.xdist_group("merging")  # they share what takes long to make


def test_the_same_room_in_another_frame_gives_the_map_of_both_drives() -> None:
    merged = merge_maps(first_day(), second_day(*ALL), OTHER_FRAME)
    shots = frames(*ALL)
    both_drives = mapped(shots, later=DAY, onto=first_day())
    expected, found = objects_of(both_drives), objects_of(merged.hypermap)
    assert found.keys() == expected.keys() == {"table", "plant", "chair"}
    for name, item in expected.items():
        assert iou(found[name], item) > 0.9
        assert found[name].id == objects_of(first_day())[name].id
        assert found[name].existence == pytest.approx(item.existence, abs=0.2 * item.existence)
        assert found[name].attributes["evidence"] == item.attributes["evidence"]
        assert (found[name].first_seen, found[name].last_seen) == (item.first_seen, item.last_seen)
    assert (merged.both, merged.first, merged.second, merged.gone) == (3, 0, 0, 0)
    assert merged.hypermap.base_frame == "map"
    points = np.random.default_rng(0).uniform((0, 0), (5, 4), (500, 2))
    one, other = (m.value_at("occupancy", points) for m in (merged.hypermap, both_drives))
    assert np.mean(one == other) > 0.95


def test_what_was_moved_is_only_where_it_is_now() -> None:
    merged = merge_maps(first_day(), second_day(*MOVED), OTHER_FRAME)
    found = objects_of(merged.hypermap)
    assert centroid(found["chair"]) == pytest.approx((2.3, 0.9), abs=0.15)
    assert found["chair"].id == objects_of(first_day())["chair"].id
    assert (merged.both, merged.first, merged.second) == (3, 0, 0)
    assert (merged.gone, merged.left_out) == (0, 0)


def test_what_only_the_older_map_has_is_not_gone_from_the_newer_one() -> None:
    merged = merge_maps(second_day("table", "plant"), first_day(), OTHER_FRAME.inverse())
    assert (merged.both, merged.first, merged.second) == (2, 0, 0)
    assert (merged.gone, merged.left_out) == (0, 1)


def as_of_an_earlier_version(hypermap: Hypermap) -> Hypermap:
    """Return a map that keeps no frames."""
    state = state_of(hypermap, profile("default"))
    other = hypermap.with_layers(list(hypermap))
    other.mapper_state = dump_state(dataclasses.replace(state, log=()))
    return other


def test_maps_without_frames_are_joined_as_they_are() -> None:
    older, later = map(as_of_an_earlier_version, (first_day(), second_day(*MOVED)))
    for first, second, pose in (
        (older, later, OTHER_FRAME),
        (first_day(), later, OTHER_FRAME),
        (later, older, OTHER_FRAME.inverse()),
    ):
        merged = merge_maps(first, second, pose)
        assert objects_of(merged.hypermap).keys() == {"table", "plant", "chair"}
        assert (merged.both, merged.first + merged.second) == (2, 1)
        assert (merged.gone, merged.left_out) == ((0, 1) if first is later else (1, 0))


def test_later_frames_are_mapped_onto_a_map_without_frames() -> None:
    later = second_day(*MOVED)
    for first, second, pose in (
        (as_of_an_earlier_version(first_day()), later, OTHER_FRAME),
        (later, as_of_an_earlier_version(first_day()), OTHER_FRAME.inverse()),
    ):
        assert merge_maps(first, second, pose).both == 3


def test_where_drives_are_not_told_apart_what_was_moved_is_not_where_the_floor_is_free() -> None:
    maps = []
    for things, later in ((ALL, 0.0), (MOVED, DAY)):
        mapper = Mapper(profile("thesis"), SOURCE, drive=f"{later}")
        for shot in frames(*things):
            mapper.add(dataclasses.replace(shot, stamp=shot.stamp + later))
        maps.append(mapper.hypermap())
    merged = merge_maps(*maps, HERE)
    assert objects_of(merged.hypermap).keys() == {"table", "plant", "chair"}
    assert (merged.both, merged.second, merged.gone) == (2, 1, 1)


def test_both_orders_give_the_same_map() -> None:
    later = mapped(frames(*MOVED), later=DAY)
    one = objects_of(merge_maps(first_day(), later, HERE).hypermap)
    other = objects_of(merge_maps(later, first_day(), HERE).hypermap)
    assert one.keys() == other.keys()
    for name, item in one.items():
        assert item.footprint.equals_exact(other[name].footprint, 1e-9)
        assert item.existence == other[name].existence
        assert item.first_seen == other[name].first_seen


def test_the_history_tells_what_a_drive_onto_the_first_map_would(tmp_path: Path) -> None:
    monday = 19_000 * DAY
    first = changed(mapped(frames(*ALL), later=monday), tmp_path / "monday.hmap")
    shots, told = frames("table", "chair elsewhere"), []
    second = mapped(shots, OTHER_FRAME.inverse(), monday + DAY)
    for hypermap in (
        mapped(shots, later=monday + DAY, onto=first),
        merge_maps(first, second, OTHER_FRAME).hypermap,
    ):
        history = changed(hypermap, tmp_path / "tuesday.hmap").history
        assert history is not None
        changes = history.revisions()[-1].changes
        told.append({(one.kind, one.object.name, one.is_doubtful) for one in changes})
    assert told[1] == told[0] == {("moved", "chair", False), ("gone", "plant", False)}


def test_what_came_in_the_first_of_two_later_drives_is_no_doubtful_change(tmp_path: Path) -> None:
    monday = 19_000 * DAY
    first = changed(mapped(frames("table", "plant"), later=monday), tmp_path / "monday.hmap")
    tuesday = mapped(frames(*ALL), later=monday + DAY)
    later = mapped(frames(*ALL), later=monday + 2 * DAY, onto=tuesday)
    merged = changed(merge_maps(first, later, HERE).hypermap, tmp_path / "week.hmap")
    assert merged.history is not None
    (change,) = merged.history.revisions()[-1].changes
    assert (change.kind, change.object.name, change.is_doubtful) == ("added", "chair", False)


def test_what_the_first_of_two_merged_maps_has_changed_is_no_doubtful_change(
    tmp_path: Path,
) -> None:
    monday = 19_000 * DAY
    hypermap = changed(mapped(frames("table", "plant"), later=monday), tmp_path / "monday.hmap")
    for day in (1, 2):
        other = mapped(frames("table", "chair"), later=monday + day * DAY)
        hypermap = merge_maps(hypermap, other, HERE).hypermap
    history = changed(hypermap, tmp_path / "week.hmap").history
    assert history is not None
    told = {(each.kind, each.object.name) for each in history.revisions()[-1].changes}
    assert told == {("added", "chair"), ("gone", "plant")}
    assert not any(each.is_doubtful for each in history.revisions()[-1].changes)


def test_poses_of_a_merged_map_can_be_corrected(tmp_path: Path) -> None:
    merged = changed(
        merge_maps(first_day(), second_day(*MOVED), OTHER_FRAME).hypermap, tmp_path / "m"
    )
    mapper = Mapper.onto(merged, SOURCE)
    stamps, poses = mapper.logged_poses()
    assert len(stamps) == sum(drive["frames"] for drive in merged.metadata["drives"])
    poses[:, :2, 3] += (0.5, 0.25)
    mapper.correct(trajectory_of(stamps, poses))
    before, after = objects_of(merged), objects_of(mapper.hypermap())
    assert before.keys() == after.keys()
    for name, item in after.items():
        assert item.id == before[name].id
        x, y = centroid(before[name])
        assert centroid(item) == pytest.approx((x + 0.5, y + 0.25), abs=0.02)


def test_a_log_that_is_damaged_is_told() -> None:
    state = state_of(second_day(*ALL), profile("default"))
    (part,) = state.log
    damaged = dataclasses.replace(part, frames=[b"?"] * len(part.frames))
    other = second_day(*ALL).with_layers(list(second_day(*ALL)))
    other.mapper_state = dump_state(dataclasses.replace(state, log=[damaged]))
    words = r"^the second map: the log of frames.*map all its recordings again"
    with pytest.raises(CannotGoOn, match=words):
        merge_maps(first_day(), other, OTHER_FRAME)
    with pytest.raises(CannotGoOn, match=r"^other: the log of frames"):
        merge_maps(other, first_day(), OTHER_FRAME.inverse(), ("other", "day"))


def test_free_floor_below_a_table_does_not_say_that_what_stands_on_it_is_gone() -> None:
    """A laser map, and rays below a table, know the floor there to be free."""
    shots = frames("table", "plant", "monitor")
    walls = OccupancyLayer("walls", "map", GridGeometry(50, 40, 0.1), np.zeros((40, 50), np.int8))
    maps = []
    for missed, count, later in (("", len(shots), 0.0), ("monitor", 3, DAY)):
        mapper = Mapper(profile("default"), SOURCE, walls)
        for shot in [shot for shot in shots if "monitor" in shot.detections.names][:count]:
            found = shot.detections[shot.detections.names != missed]
            mapper.add(dataclasses.replace(shot, stamp=shot.stamp + later, detections=found))
        maps.append(mapper.hypermap())
    assert "monitor" not in objects_of(maps[1])
    assert "monitor" in objects_of(merge_maps(*maps, Pose2D()).hypermap)


def test_how_poses_were_corrected_turns_with_the_map() -> None:
    evidence = EvidenceMap(profile("default").evidence)
    shape = shapely.box(1, 0, 2, 1)
    one = ObservedObject("table", 0.9, shape, z_max=0.7)
    evidence.update(Observation(0.0, np.eye(4), (one,), shape, correction=(0.02, 0.01, 0.003)))
    moved = moved_tracks(evidence.tracks(), Pose2D(5, 6, math.pi / 2), evidence.config)
    (item,) = moved.objects[0].buffer.items
    assert item.correction == pytest.approx((-0.01, 0.02, 0.003))


def test_how_a_pose_was_corrected_turns_with_the_frame() -> None:
    area = shapely.box(1, 0, 2, 1)
    observation = Observation(0.0, np.eye(4), (), area, correction=(0.02, 0.01, 0.003))
    packed, quarter = packed_frame(LoggedFrame(observation, None)), Pose2D(5, 6, math.pi / 2)
    pose = np.eye(4)
    pose[np.ix_([0, 1, 3], [0, 1, 3])] = quarter.matrix()
    for whole, expected in ((quarter, (-0.01, 0.02, 0.003)), (None, (0, 0, 0))):
        (frame,) = moved_frames([packed], [pose], 0.05, "x.hmap", whole)
        assert frame.observation.correction == pytest.approx(expected)
        assert frame.observation.visible_area.bounds == pytest.approx((4, 7, 5, 8))


def test_the_order_of_the_maps_does_not_matter_for_what_is_there() -> None:
    merged = merge_maps(second_day(*MOVED), first_day(), OTHER_FRAME.inverse())
    found = objects_of(merged.hypermap)
    place = OTHER_FRAME.apply([centroid(found["chair"])])[0]
    assert place == pytest.approx((2.3, 0.9), abs=0.15)
    assert found.keys() == {"table", "plant", "chair"}


def test_what_only_one_map_has_seen_is_kept() -> None:
    shots = frames(*ALL)
    left = mapped([shot for shot in shots if shot.map_T_camera[1, 2] > 0.5])
    right = mapped([shot for shot in shots if shot.map_T_camera[1, 2] < -0.5], later=DAY)
    alone = objects_of(left), objects_of(right)
    assert alone[0].keys() != alone[1].keys()
    merged = merge_maps(left, right, Pose2D())
    assert objects_of(merged.hypermap).keys() == alone[0].keys() | alone[1].keys()
    extent = merged.hypermap["occupancy"].extent()
    for one in (left, right):
        assert extent.buffer(1e-6).covers(one["occupancy"].extent())


def test_a_merged_map_can_be_continued_saved_and_merged(tmp_path: Path) -> None:
    merged = merge_maps(first_day(), second_day(*ALL), OTHER_FRAME).hypermap
    again = changed(merged, tmp_path / "merged.hmap")
    names = [drive["name"] for drive in again.metadata["drives"]]
    assert names == ["day 0", "day 1"]
    assert again.metadata["map_id"] == first_day().metadata["map_id"]
    assert again.metadata["map_version"] > first_day().metadata["map_version"]
    third = mapped(frames("table", "plant"), later=2 * DAY, onto=again)
    assert objects_of(third).keys() == {"table", "plant"}
    fourth = merge_maps(again, mapped(frames("table", "plant"), later=3 * DAY), Pose2D())
    assert len(fourth.hypermap.metadata["drives"]) == 3


def test_what_a_merge_has_changed_is_of_the_day_of_the_other_map(tmp_path: Path) -> None:
    monday = 19_000 * DAY
    first = changed(mapped(frames(*ALL), later=monday), tmp_path / "monday.hmap")
    other = mapped(frames(*MOVED), later=monday + DAY)
    merged = merge_maps(first, other, Pose2D()).hypermap
    third = mapped(frames(*MOVED), later=monday + 2 * DAY)
    for last, hypermap in (
        ("day 19001", merged),
        ("day 19001, day 19002", merge_maps(merged, third, Pose2D()).hypermap),
    ):
        week = changed(hypermap, tmp_path / "week.hmap")
        assert week.history is not None
        revision = week.history.revisions()[-1]
        assert revision.drive == last
        assert revision.time == max(thing.last_seen or 0 for thing in week.semantic())
        then = objects_of(as_of(week, monday + DAY / 2))["chair"]
        assert centroid(then) == centroid(objects_of(first)["chair"])


def test_corrections_of_poses_before_a_merge_are_known_after_it() -> None:
    first = first_day().with_layers(first_day())
    correction = Mapped("", None, shifts={0: (0.5, 0.0)})
    first.history = History(mapped=correction)
    merged = merge_maps(first, second_day("table"), OTHER_FRAME).hypermap
    assert merged.history is not None
    assert merged.history.mapped is not None
    assert merged.history.mapped.shifts == correction.shifts


def test_poses_of_one_map_may_be_corrected_and_those_of_the_other_not() -> None:
    other = mapped(frames("table"), later=DAY, alignment={"enabled": False})
    merged = merge_maps(first_day(), other, Pose2D()).hypermap
    assert merged.metadata["config"]["alignment"]["enabled"]


def test_the_best_pictures_of_both_days_are_kept() -> None:
    first, second = first_day(), second_day(*ALL)
    merged = merge_maps(first, second, OTHER_FRAME).hypermap
    found = objects_of(merged)
    assert found.keys() == set(ALL)
    for name, item in found.items():
        one, other = (
            hypermap.semantic().pictures(objects_of(hypermap)[name].id)
            for hypermap in (first, second)
        )
        assert one
        assert other
        turned = (dataclasses.replace(e, azimuth=e.azimuth + OTHER_FRAME.yaw) for e in other)
        assert merged.semantic().pictures(item.id) == best_pictures([*one, *turned])


def test_other_layers_of_both_maps_are_kept_where_they_lie() -> None:
    zone = SemanticObject("wet floor", shapely.box(1, 1, 2, 2))
    maps = []
    for one, pose in ((first_day(), Pose2D()), (second_day("table"), OTHER_FRAME.inverse())):
        layer = SemanticLayer("zones", "map", [])
        shape = pose.apply_geometry(zone.footprint)
        layer.add([dataclasses.replace(zone, footprint=shape)])
        lab = SemanticLayer("lab only", "lab", [SemanticObject("door", shapely.box(0, 0, 1, 1))])
        other = one.with_layers([*one, layer, lab])
        other.frames = FrameTree([Transform("map", "lab", Pose2D(3, 0, 0))])
        maps.append(other)
    merged = merge_maps(*maps, OTHER_FRAME)
    hypermap = merged.hypermap
    assert merged.renamed == {"zones": "zones_2", "lab only": "lab only_2"}
    assert [layer.name for layer in hypermap][-2:] == ["zones_2", "lab only_2"]
    assert hypermap.label_at("zones_2", [(1.5, 1.5)]).tolist() == ["wet floor"]
    assert hypermap.label_at("zones_2", [(2.5, 1.5)]).tolist() == ["Empty"]
    x, y = OTHER_FRAME.apply([(3.5, 0.5)])[0]
    assert hypermap.label_at("lab only_2", [(x, y)]).tolist() == ["door"]
    assert hypermap.label_at("lab only", [(3.5, 0.5)]).tolist() == ["door"]


def test_maps_that_cannot_be_merged_are_refused() -> None:
    second = second_day(*ALL)
    with pytest.raises(CannotMerge, match="frames of the drive 'day 0', which would count twice"):
        merge_maps(first_day(), mapped(frames("table"), later=DAY, onto=first_day()), Pose2D())
    other = mapped(frames("table"), later=DAY, evidence={"gain": 1.0})
    with pytest.raises(CannotMerge, match=r"evidence: gain: 1\.5 and 1\.0"):
        merge_maps(first_day(), other, Pose2D())
    drawn = Hypermap([SemanticLayer("semantic", "map", [])])
    with pytest.raises(CannotGoOn, match="not made by mapping"):
        merge_maps(drawn, second, Pose2D())
    without = second.with_layers(list(second))
    without.mapper_state = None
    with pytest.raises(CannotGoOn, match="--drop-evidence"):
        merge_maps(first_day(), without, Pose2D())


def test_a_map_of_a_version_with_other_defaults_is_merged_by_those_of_the_first() -> None:
    older = second_day(*ALL).with_layers(list(second_day(*ALL)))
    config = copy.deepcopy(older.metadata["config"])
    config["evidence"] |= {"gain": 1.4, "tolerance": 0.123}
    older.metadata = {**older.metadata, "config": config, "hypermap_version": "0.0.1"}
    merged = merge_maps(first_day(), older, OTHER_FRAME)
    assert (merged.both, merged.second, merged.gone) == (3, 0, 0)
    assert merged.hypermap.metadata["config"] == first_day().metadata["config"]
    assert merged.settings[0] == "evidence: gain: 1.5 instead of 1.4"
    assert len(merged.settings) == 2
    own = copy.deepcopy(first_day().metadata["config"])
    own["evidence"]["gain"] = 1.3  # neither is the default: the user has chosen
    chosen = first_day().with_layers(list(first_day()))
    chosen.metadata = {**chosen.metadata, "config": own}
    with pytest.raises(CannotMerge, match=r"evidence: gain: 1\.3 and 1\.4"):
        merge_maps(chosen, older, OTHER_FRAME)


def test_a_result_with_older_defaults_is_merged_with_a_third_map_and_continued() -> None:
    older = second_day(*ALL).with_layers(list(second_day(*ALL)))
    config = copy.deepcopy(older.metadata["config"])
    config["evidence"] |= {"gain": 1.4}
    older.metadata = {**older.metadata, "config": config, "hypermap_version": "0.0.1"}
    both = merge_maps(older, first_day(), OTHER_FRAME.inverse()).hypermap
    continued = mapped(frames(*ALL), OTHER_FRAME.inverse(), 3 * DAY, older)
    third = mapped(frames(*ALL), later=2 * DAY)
    for begun_by_older in (both, continued):
        merged = merge_maps(begun_by_older, third, OTHER_FRAME.inverse())
        assert merged.settings == ("evidence: gain: 1.4 instead of 1.5",)
        assert merged.both == 3
        assert merged.hypermap.metadata["config"] == config


def test_merging_leaves_both_maps_as_they_were(tmp_path: Path) -> None:
    maps = first_day(), second_day(*MOVED)
    files = [tmp_path / "a.hmap", tmp_path / "b.hmap"]
    before = [written(*pair) for pair in zip(maps, files, strict=True)]
    merge_maps(*maps, OTHER_FRAME)
    assert [written(*pair) for pair in zip(maps, files, strict=True)] == before


def test_maps_with_a_given_occupancy_map_get_one_that_covers_both() -> None:
    shots = frames("table", "plant")
    cells = np.zeros((40, 50), np.int8)
    given = [
        OccupancyLayer("walls", "map", GridGeometry(50, 40, 0.1, Pose2D(x)), cells)
        for x in (0.0, 3.0)
    ]
    maps = []
    for occupancy, later in zip(given, (0.0, DAY), strict=True):
        mapper = Mapper(override(profile("default"), {}), SOURCE, occupancy)
        for shot in shots:
            mapper.add(dataclasses.replace(shot, stamp=shot.stamp + later))
        maps.append(mapper.hypermap())
    merged = merge_maps(*maps, Pose2D()).hypermap
    assert merged["walls"].extent().bounds == pytest.approx((0, 0, 8, 4))
    assert merged.value_at("walls", [(0.5, 1), (4, 1), (7.5, 1), (9, 1)]).tolist() == [0, 0, 0, -1]


def test_counts_add_up() -> None:
    merged: Merged = merge_maps(first_day(), second_day("plant"), OTHER_FRAME)
    total = len(merged.hypermap.semantic())
    assert merged.both + merged.first + merged.second == total
    assert total + merged.gone == 3
