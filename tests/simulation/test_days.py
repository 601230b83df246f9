"""Worlds that change from day to day."""

from __future__ import annotations

import dataclasses
import functools
import math

import pytest

from hypermap.simulation.days import DailyChanges, Day, next_day
from hypermap.simulation.standing import overlaps
from hypermap.simulation.world import built_in_world

pytestmark = pytest.mark.xdist_group("days")  # they share what takes long to make


@functools.cache
def week() -> tuple[Day, ...]:
    days = [Day.first(built_in_world("demo"))]
    for seed in range(2):
        days.append(next_day(days[-1], seed))
    return tuple(days)


def test_things_keep_their_numbers_and_nothing_stands_in_anything_else() -> None:
    first = overlaps(week()[0].world)
    for before, after in zip(week(), week()[1:], strict=False):
        assert len(after.things) == len(after.world.objects) == len(set(after.things))
        here = dict(zip(after.things, after.world.objects, strict=True))
        was = dict(zip(before.things, before.world.objects, strict=True))
        changed = {change.thing for change in after.changes}
        for thing in was.keys() - changed:
            assert here[thing] == was[thing]
        for change in after.changes:
            assert (was.get(change.thing), here.get(change.thing)) == (change.before, change.after)
        assert len(overlaps(after.world)) <= len(first)


def test_each_kind_of_change_is_what_it_says() -> None:
    changes = [change for day in week() for change in day.changes]
    assert {change.kind for change in changes} >= {"moved", "removed", "added", "swapped"}
    for change in changes:
        if change.kind in ("moved", "swapped"):
            assert change.before is not None
            assert change.after is not None
            way = math.dist(change.before.place, change.after.place)
            assert 0.25 < way < 8
            assert change.before.label == change.after.label
        elif change.kind == "removed":
            assert change.after is None


def test_where_there_is_nothing_only_doors_change() -> None:
    world = built_in_world("demo")
    bare = Day.first(dataclasses.replace(world, objects=()))
    assert {change.kind for change in next_day(bare, 0).changes} <= {"door"}


def test_the_same_seed_gives_the_same_day() -> None:
    first = Day.first(built_in_world("demo"))
    assert next_day(first, 0) == week()[1]
    assert next_day(first, 7) != week()[1]


def test_a_door_closes_only_where_the_robot_does_not_pass() -> None:
    counts = DailyChanges(moved=0, removed=0, added=0, swapped=0, doors=3)
    day = next_day(Day.first(built_in_world("lab")), 0, counts)
    assert day.changes == ()  # its only door is on the way


@pytest.mark.parametrize("name", ["apartment"])
def test_doors_close_and_open_again(name: str) -> None:
    counts = DailyChanges(moved=0, removed=0, added=0, swapped=0, doors=1)
    day = Day.first(built_in_world(name))
    kinds = set()
    for seed in range(6):
        day = next_day(day, seed, counts)
        kinds |= {(change.kind, change.before is None) for change in day.changes}
    assert kinds <= {("door", True), ("door", False)}
