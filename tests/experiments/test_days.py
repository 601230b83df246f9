"""What is counted of maps of worlds that change."""

from __future__ import annotations

import dataclasses
import functools
import json
from pathlib import Path

import pytest

from hypermap.cli.experiment_days import run
from hypermap.cli.experiment_plan import Plan
from hypermap.core.history import ADDED
from hypermap.experiments.day_causes import CAUSES
from hypermap.experiments.days import Series, Tally, count_day, map_day, map_one
from hypermap.mapping.config import profile
from hypermap.simulation.days import Day, WorldChange
from hypermap.simulation.levels import errors_of_level
from hypermap.simulation.world import built_in_world

pytestmark = pytest.mark.xdist_group("experiment_days")  # they share what takes long to make


@functools.cache
def demo() -> Tally:
    """Return what comes of two sparse drives through the demo's room without errors."""
    series = Series(built_in_world("demo"), 3, errors_of_level("none"), 0.5, 2)
    return map_one(series, profile("default"))


def test_without_errors_most_changes_are_found_and_ids_stay() -> None:
    tally = demo()
    for counts in (tally.looked, tally.in_sight, tally.alike):
        true, right = sum(counts.true.values()), sum(counts.right.values())
        assert 1 <= right <= true
        assert all(counts.right[kind] <= counts.reported[kind] for kind in counts.reported)
    assert tally.switched <= 0.1 * tally.kept
    found, there, matched = tally.last
    assert matched >= 0.8 * there
    assert matched <= found


def test_what_was_moved_out_of_sight_is_rightly_told_as_gone() -> None:
    world, config = built_in_world("demo"), profile("default")
    series = Series(world, 3, errors_of_level("none"), 0.5, 2)
    chair = next(one for one in world.objects if one.label == "chair")
    away = dataclasses.replace(chair, at=(chair.place[0] + 30, chair.place[1]))
    rest = [away if one is chair else one for one in world.objects]
    first = Day.first(world)
    thing = first.things[world.objects.index(chair)]
    second = dataclasses.replace(
        first,
        world=dataclasses.replace(world, objects=tuple(rest)),
        changes=(WorldChange("moved", thing, chair, away),),
    )
    before = map_day(series, first, 0, None, config)
    tally = Tally("demo", 3)
    count_day(tally, before, map_day(series, second, 1, before, config))
    assert tally.looked.true == {"moved": 0, "removed": 0, "added": 0}
    for counts in (tally.in_sight.true, tally.in_sight.right, tally.in_sight.reported):
        assert counts == {"moved": 0, "removed": 1, "added": 0}


def test_a_report_of_a_true_change_whose_place_does_not_count_is_not_wrong() -> None:
    """As of a table of which the robot looked at one end only."""
    world, config = built_in_world("demo"), profile("default")
    series = Series(world, 3, errors_of_level("none"), 0.5, 2)
    chair = next(one for one in world.objects if one.label == "chair")
    second = Day.first(world)
    thing = second.things[world.objects.index(chair)]
    rest = tuple(one for one in world.objects if one is not chair)
    things = tuple(one for one in second.things if one != thing)
    first = Day(dataclasses.replace(world, objects=rest), things, (), second.next_thing)
    before = map_day(series, first, 0, None, config)
    after = map_day(series, second, 1, before, config)
    assert after.hypermap.history is not None
    changes = after.hypermap.history.revisions()[-1].changes
    (told,) = (one for one in changes if one.kind == ADDED and one.object.name == "chair")
    seen = [told.object.footprint.centroid.buffer(0.2)] * 3
    aside = dataclasses.replace(chair, at=(chair.place[0] + 0.5, chair.place[1]))
    for place, counts in ((chair, 1), (aside, 0)):
        change = WorldChange("added", thing, None, place)
        day = dataclasses.replace(second, changes=(change,))
        tally = Tally("demo", 3)
        count_day(
            tally,
            dataclasses.replace(before, visible=seen),
            dataclasses.replace(after, visible=seen, day=day),
        )
        looked = tally.looked
        assert (looked.true["added"], looked.right["added"]) == (counts, counts)
        assert looked.reported["added"] == counts


def test_misses_and_errors_are_listed() -> None:
    tally = demo()
    counts = tally.looked
    missed = sum(counts.true.values()) - sum(counts.right.values())
    wrong = sum(counts.reported.values()) - sum(counts.right.values())
    assert len(tally.notes) == missed + wrong == sum(tally.causes.values())
    assert {cause.split(": ")[1] for cause in tally.causes} <= CAUSES.keys()


def test_the_command_prints_and_saves_the_figures(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def series(*_: object) -> list[Tally]:
        return [demo()]

    monkeypatch.setattr("hypermap.experiments.days.map_series", series)
    plan = Plan(
        name="days",
        worlds="demo",
        methods="all",
        added=(),
        exact=False,
        parts="all",
        seeds=1,
        drives=2,
        given_first_seed=3,
        level="none",
        sensor="kinect_v1",
        network=False,
        rate=0.5,
        given_jobs=1,
    )
    run(plan, tmp_path / "days.json", as_json=False, replace=False)
    printed = capsys.readouterr().out
    assert "ids that changed" in printed
    assert all(cause.split(": ")[1] in printed for cause in demo().causes)
    data = json.loads((tmp_path / "days.json").read_text())
    assert data["command"] == (
        "hypermap experiment days --worlds demo --seeds 1 --first-seed 3 --errors none --drives 2 "
        "--rate 0.5"
    )
    assert data["made_with"]["methods"]["default"]["evidence"]["fusion"] == "votes"
    figures = data["worlds"]["demo"]
    assert figures["kept"] == demo().kept
    assert figures["changes"]["moved"]["true"] == demo().looked.true["moved"]
    assert figures["changes_of_things_that_sizes_tell"]["moved"]["f1"] is not None
    assert figures["causes"] == dict(demo().causes)
