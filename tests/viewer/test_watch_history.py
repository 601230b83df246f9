"""What is kept of a run: every step exactly, and never too much."""

from __future__ import annotations

import json
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap.viewer.watch.grids import GridPicture
from hypermap.viewer.watch.history import History, NoSuchStep
from hypermap.viewer.watch.objects import ObjectState, ObjectStates, changed_by, difference, merged

SIZES = st.integers(1, 9)


def polygons(size: int) -> list[list[list[list[float]]]]:
    return [[[[0.0, 0.0], [float(size), 0.0], [0.0, size / 7]]]]


THINGS = st.builds(
    lambda name, existence, size: ObjectState(name, existence, size, polygons(size)),
    st.sampled_from(["chair", "cup"]),
    st.floats(-1, 5),
    SIZES,
)
STATES = st.dictionaries(st.integers(0, 6), THINGS).map(lambda state: dict(sorted(state.items())))


def observation(stamp: float) -> dict[str, Any]:
    return {"stamp": stamp, "camera": {"x": stamp, "y": -stamp}}


@given(STATES, STATES)
def test_a_difference_makes_the_one_of_the_other(before: ObjectStates, after: ObjectStates) -> None:
    changes = json.loads(json.dumps(difference(before, after)))
    made = changed_by(before, changes)
    assert made == after
    assert list(made) == list(after)
    assert difference(after, made) == {"set": [], "existence": [], "removed": []}


@given(STATES, STATES, STATES)
def test_two_differences_merged_do_what_one_after_the_other_does(
    first: ObjectStates, second: ObjectStates, third: ObjectStates
) -> None:
    one, other = difference(first, second), difference(second, third)
    both = merged(json.loads(json.dumps(one)), json.loads(json.dumps(other)))
    assert changed_by(first, both) == third


def test_a_difference_tells_what_has_changed_and_nothing_else() -> None:
    before = {n: ObjectState("chair", 1.0, 3, polygons(1)) for n in range(4)}
    after = {
        0: before[0],
        1: before[1]._replace(existence=0.8),
        2: before[2]._replace(evidence=4, polygons=polygons(2)),
        9: ObjectState("cup", 0.5, 1, polygons(3)),
    }
    assert difference(before, after) == {
        "set": [[2, "chair", 1.0, 4, polygons(2)], [9, "cup", 0.5, 1, polygons(3)]],
        "existence": [(1, 0.8)],
        "removed": [3],
    }


@settings(max_examples=30, deadline=None)
@given(st.lists(STATES, min_size=1, max_size=140), st.integers(2, 130), st.randoms())
def test_every_kept_step_is_rebuilt_exactly(
    states: list[ObjectStates], most: int, random: Any
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        history = History(Path(folder), most_steps=most)
        numbers = list(range(3, 3 + 2 * len(states), 2))
        for number, things in zip(numbers, states, strict=True):
            history.add(number, observation(number / 10), b"%d" % number, things, None)
            assert len(history.steps) < most
            assert history.steps[-1].number == number
        wanted = dict(zip(numbers, states, strict=True))
        kept = [step.number for step in history.steps]
        assert kept == sorted(kept)
        random.shuffle(kept)
        for number in kept:
            assert history.objects(number) == wanted[number]
            assert list(history.objects(number)) == list(wanted[number])
            assert history.picture(number) == b"%d" % number
            answer = json.loads(history.observation(number))
            assert (answer["number"], answer["stamp"]) == (number, number / 10)


def test_a_long_run_keeps_evenly_spread_steps_and_few_files(tmp_path: Path) -> None:
    history = History(tmp_path, most_steps=64)
    used = 0
    thing = ObjectState("chair", 1.0, 1, polygons(1))
    for frame in range(1, 5001):
        used += 1
        if used < history.stride:
            continue
        used = 0
        grid = GridPicture(b"grid %d" % frame, (0.0, 0.0, frame, 1.0)) if frame % 3 else None
        history.add(
            frame, observation(frame), b"x" * 100, {1: thing._replace(evidence=frame)}, grid
        )
    numbers = [step.number for step in history.steps]
    assert 32 <= len(numbers) <= 64
    assert history.stride == 2**history.thinned == 128
    assert {b - a for a, b in pairwise(numbers)} == {history.stride}
    for step in history.steps:
        assert history.objects(step.number)[1].evidence == step.number
        assert step.grid is not None
        assert history.grid(step.grid) == b"grid %d" % step.grid
        shown = json.loads(history.observation(step.number))["grid"]
        assert shown == {"number": step.grid, "extent": [0.0, 0.0, step.grid, 1.0]}
    files = list(tmp_path.iterdir())
    assert len(files) <= 5 * len(numbers)


def test_the_room_on_the_disk_is_bounded_too(tmp_path: Path) -> None:
    history = History(tmp_path, most_bytes=100_000)
    for frame in range(1, 400):
        history.add(frame, observation(frame), b"x" * 5000, {}, None)
        assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 110_000
    assert history.thinned > 1
    assert history.steps[-1].number == 399


def test_what_was_dropped_is_answered_by_the_step_before_and_the_rest_is_refused(
    tmp_path: Path,
) -> None:
    history = History(tmp_path)
    for frame in (5, 9):
        history.add(frame, observation(frame), b"", {}, None)
    assert [history.number_at(number) for number in (5, 8, 9, 99)] == [5, 5, 9, 9]
    assert [number in history for number in (4, 5, 8, 9, 99)] == [False, True, False, True, False]
    with pytest.raises(NoSuchStep, match="there is no step 4"):
        history.number_at(4)
    with pytest.raises(NoSuchStep, match=r"there is no 9\.png"):
        history.grid(9)
    with pytest.raises(ValueError, match="most_steps must be 2 or more, got 1"):
        History(tmp_path, most_steps=1)


def test_the_newest_step_may_get_a_newer_grid(tmp_path: Path) -> None:
    history = History(tmp_path)
    history.add(1, observation(1), b"", {}, GridPicture(b"first", (0, 0, 1, 1)))
    history.add(2, observation(2), b"", {}, None)
    assert json.loads(history.observation(2))["grid"]["number"] == 1
    history.renew_grid(GridPicture(b"second", (0, 0, 2, 2)))
    assert json.loads(history.observation(2))["grid"] == {"number": 2, "extent": [0, 0, 2, 2]}
    assert (history.grid(1), history.grid(2)) == (b"first", b"second")
