"""The file of the mapper's state: exact, with each piece of evidence once, and as it was before."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.core.hypermap import Hypermap
from hypermap.core.trajectory import pose_from_rpy, trajectory_of
from hypermap.formats.array_file import ArrayFile, dump_arrays, parse_arrays
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.mapper_state import FORMAT, VERSION, MapperState, dump_state, parse_state
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.simulation.levels import errors_of_level

pytestmark = pytest.mark.xdist_group("mapper_state")  # they share what takes long to make

SMALL = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)
SOURCE = detections_from_recording()
CONFIG = profile("default").evidence


def state_in(hypermap: Hypermap) -> bytes:
    kept = hypermap.mapper_state
    assert callable(kept)
    return bytes(kept())


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    recording = SimulatedRecording.with_errors(
        demo_world(), errors_of_level("none"), camera=SMALL, rate=0.4, has_occupancy=False
    )
    return [dataclasses.replace(frame, stamp=1.7e9 + frame.stamp) for frame in recording.frames()]


@pytest.fixture(scope="module")
def three_days(frames: list[RgbdFrame]) -> Hypermap:
    """The map of three drives, each onto the map before."""
    mapper = Mapper(profile("default"), SOURCE, drive="0")
    for number in range(3):
        if number:
            mapper = Mapper.onto(mapper.hypermap(), SOURCE, drive=str(number))
        for frame in frames[number::3]:
            mapper.add(frame)
    return mapper.hypermap()


@pytest.fixture(scope="module")
def content(three_days: Hypermap) -> bytes:
    return state_in(three_days)


@pytest.fixture(scope="module")
def state(content: bytes) -> MapperState:
    return parse_state(content, CONFIG)


def in_the_older_form(state: MapperState) -> bytes:
    """A file as earlier versions wrote it: the map before each part is a whole file within it."""
    befores = [
        dump_state(dataclasses.replace(state, **vars(part.before), published=(), log=()))
        for part in state.log
    ]
    file = parse_arrays(dump_state(state), FORMAT, VERSION, "")
    arrays = {n: a for n, a in file.arrays.items() if not n.startswith(("before.", "more."))}
    arrays["log.before"] = np.frombuffer(b"".join(befores), np.uint8)
    arrays["log.before_lengths"] = np.array([len(one) for one in befores], np.int64)
    facts = {key: value for key, value in file.facts.items() if key != "before"}
    return dump_arrays(ArrayFile(facts, arrays), FORMAT, VERSION)


def test_a_state_is_the_same_after_it_was_read(content: bytes, state: MapperState) -> None:
    assert len(state.log) == 3
    assert dump_state(state) == content


def test_how_poses_were_corrected_is_kept_and_not_at_all_is_assumed_of_older_files(
    content: bytes, state: MapperState
) -> None:
    by = 0.01, -0.02, 0.003
    tracks = state.tracks.snapshot()
    for track in tracks.objects:
        items = [dataclasses.replace(item, correction=by) for item in track.buffer.items]
        track.buffer.items[:] = items
    again = parse_state(dump_state(dataclasses.replace(state, tracks=tracks)), CONFIG).tracks
    assert {item.correction for track in again.objects for item in track.buffer.items} == {by}
    file = parse_arrays(content, FORMAT, VERSION, "")
    older = {name: array for name, array in file.arrays.items() if "view.correction" not in name}
    assert len(older) == len(file.arrays) - 2
    assert (
        dump_state(parse_state(dump_arrays(ArrayFile(file.facts, older), FORMAT, VERSION), CONFIG))
        == content
    )
    wrong = {**file.arrays, "view.correction": file.arrays["view.correction"] * np.nan}
    with pytest.raises(FormatError, match="corrections"):
        parse_state(dump_arrays(ArrayFile(file.facts, wrong), FORMAT, VERSION), CONFIG)


def test_each_piece_of_evidence_is_kept_once(content: bytes, state: MapperState) -> None:
    arrays = parse_arrays(content, FORMAT, VERSION, "").arrays
    kept = sum(len(arrays[f"{prefix}observation.score"]) for prefix in ("", "more."))
    tables = [state.tracks, *(part.before.tracks for part in state.log)]
    pieces = [item for one in tables for track in one.objects for item in track.buffer.items]
    found = {(item.stamp, item.score, shapely.to_wkb(item.footprint)) for item in pieces}
    assert kept == len(found) < len(pieces) / 2
    areas = sum(len(arrays[f"{prefix}view.stamp"]) for prefix in ("", "more."))
    assert areas == len({item.stamp for item in pieces})


def test_evidence_that_is_dropped_since_then_stays_with_the_earlier_maps(
    state: MapperState,
) -> None:
    shorter = dataclasses.replace(state, tracks=state.log[0].before.tracks)
    assert not shorter.tracks.objects
    again = parse_state(dump_state(shorter), CONFIG)
    before, expected = (one.log[2].before.tracks for one in (again, state))
    assert before.objects
    for track, same in zip(before.objects, expected.objects, strict=True):
        assert (track.id, track.name) == (same.id, same.name)
        assert track.buffer.footprints().tolist() == same.buffer.footprints().tolist()
    shapes = [one.shapes.geometries(range(len(one.objects))).tolist() for one in (before, expected)]
    assert shapes[0] == shapes[1]


def test_the_older_form_is_read_and_corrected_alike(
    frames: list[RgbdFrame], three_days: Hypermap, state: MapperState
) -> None:
    stamps = np.array([frame.stamp for frame in frames])
    off = pose_from_rpy(0.3, 0.1, 0, 0, 0, 0.02)
    there = trajectory_of(stamps, np.array([off @ frame.map_T_camera for frame in frames]))
    corrected = []
    for content in (in_the_older_form(state), dump_state(state)):
        given = three_days.with_layers(list(three_days))
        given.mapper_state = content
        mapper = Mapper.onto(given, SOURCE)
        mapper.correct(there)
        corrected.append(parse_state(state_in(mapper.hypermap()), CONFIG))
    one, other = corrected
    assert [t.id for t in one.tracks.objects] == [t.id for t in other.tracks.objects]
    assert dump_state(one) == dump_state(other)


def test_earlier_versions_find_no_log_and_what_they_know(content: bytes) -> None:
    """They look for `log.before`, and count the evidence of the tracks."""
    arrays = parse_arrays(content, FORMAT, VERSION, "").arrays
    assert "log.before" not in arrays
    assert arrays["track.kept"].sum() == len(arrays["observation.score"])
    assert arrays["observation.view"].max() < len(arrays["view.stamp"])


def test_rows_that_are_not_there_are_one_error(content: bytes) -> None:
    file = parse_arrays(content, FORMAT, VERSION, "")
    for name in ("before.2.track.evidence", "before.2.track.shape"):
        for row in (-1, 10_000):
            rows = file.arrays[name].copy()
            rows[0] = row
            wrong = ArrayFile(file.facts, {**file.arrays, name: rows})
            with pytest.raises(FormatError, match=r"x\.hmap: is damaged"):
                parse_state(dump_arrays(wrong, FORMAT, VERSION), CONFIG, "x.hmap")


def test_counts_of_evidence_that_is_not_there_take_no_memory(content: bytes) -> None:
    file = parse_arrays(content, FORMAT, VERSION, "")
    kept = file.arrays["track.kept"].copy()
    kept[0] = 1 << 47
    wrong = ArrayFile(file.facts, {**file.arrays, "track.kept": kept})
    with pytest.raises(FormatError, match=r"x\.hmap: is damaged"):
        parse_state(dump_arrays(wrong, FORMAT, VERSION), CONFIG, "x.hmap")


def nearly_empty(shape: tuple[int, int]) -> NDArray[np.float32]:
    """Log-odds of a grid of which two corners were seen."""
    grid = np.full(shape, np.nan, np.float32)
    grid[:30, :20], grid[-5:, -70:] = 0.85, -0.4
    return grid


def with_grids(state: MapperState, *grids: NDArray[np.float32]) -> MapperState:
    """The state with other grids: of the present map, and of those before each part of the log."""
    now, *befores = grids
    log = [
        dataclasses.replace(part, before=dataclasses.replace(part.before, log_odds=grid))
        for part, grid in zip(state.log, befores, strict=True)
    ]
    return dataclasses.replace(state, log_odds=now, log=log)


def test_large_grids_that_are_nearly_empty_take_the_space_of_what_was_seen(
    state: MapperState,
) -> None:
    large, small = nearly_empty((1501, 1003)), nearly_empty((100, 100))
    content = dump_state(with_grids(state, large, small, large, small))
    assert len(content) < len(dump_state(with_grids(state, *4 * [small]))) + 200_000
    again = parse_state(content, CONFIG)
    for read, grid in zip(
        [again.log_odds, *(part.before.log_odds for part in again.log)],
        [large, small, large, small],
        strict=True,
    ):
        assert read is not None
        assert read.tobytes() == grid.tobytes()


def test_versions_before_blocks_read_all_other_files(state: MapperState) -> None:
    full = np.zeros((1200, 1000), np.float32)
    small = nearly_empty((100, 100))
    for grid in (full, small):
        parse_arrays(dump_state(with_grids(state, grid, *3 * [small])), FORMAT, 1, "")
    in_blocks = dump_state(with_grids(state, nearly_empty((1200, 1000)), *3 * [small]))
    with pytest.raises(FormatError, match=r"of version 2; this program reads 1$"):
        parse_arrays(in_blocks, FORMAT, 1, "")


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("shape", np.array([10**6, 10**6])),  # 4 TB
        ("shape", np.array([-1501, -1003])),
        ("shape", np.array([10, 10])),
        ("blocks", np.array([[0, 0], [24, 15], [1000, 0]])),
        ("blocks", np.array([[0, 0], [-1, 15], [23, 14]])),
        ("blocks", np.array([[0, 0], [4, 4], [23, 14]], np.uint8)),  # 64 times 4 overflows
        ("values", np.zeros((3, 64), np.float32)),
    ],
)
def test_damaged_blocks_are_one_error(
    state: MapperState, name: str, wrong: NDArray[np.float64]
) -> None:
    small = nearly_empty((100, 100))
    content = dump_state(with_grids(state, nearly_empty((1501, 1003)), *3 * [small]))
    file = parse_arrays(content, FORMAT, VERSION, "")
    arrays = {**file.arrays, f"log_odds.{name}": wrong}
    with pytest.raises(FormatError, match=r"x\.hmap: is damaged"):
        parse_state(dump_arrays(ArrayFile(file.facts, arrays), FORMAT, VERSION), CONFIG, "x.hmap")


def test_nested_files_of_earlier_versions_hold_no_blocks(state: MapperState) -> None:
    small = nearly_empty((100, 100))
    older = in_the_older_form(with_grids(state, small, nearly_empty((1501, 1003)), small, small))
    with pytest.raises(FormatError, match=r"of version 2; this program reads 1$"):
        parse_state(older, CONFIG)
    with pytest.raises(FormatError, match="is damaged: a nested file has grids in blocks"):
        parse_state(older.replace(b'"version":2', b'"version":1'), CONFIG)


def test_files_nested_many_times_are_read(state: MapperState) -> None:
    empty = dataclasses.replace(
        state, tracks=state.log[0].before.tracks, published=(), log=(), drives=(), log_odds=None
    )
    content = dump_state(empty)
    for _ in range(400):
        file = parse_arrays(content, FORMAT, VERSION, "")
        nested = np.frombuffer(content, np.uint8)
        lengths = np.array([len(content)])
        arrays = {**file.arrays, "log.before": nested, "log.before_lengths": lengths}
        content = dump_arrays(ArrayFile(file.facts, arrays), FORMAT, 1)
    assert parse_state(content, CONFIG).log == ()
