"""What the parts of a configuration contribute."""

from __future__ import annotations

from dataclasses import replace

import pytest
import shapely
from scipy import stats

from hypermap.core.errors import HypermapError
from hypermap.core.semantic import SemanticObject
from hypermap.experiments.ablation import WHOLE, chosen_parts, rows_of, tables_of, without_parts
from hypermap.experiments.ablation_report import to_data
from hypermap.experiments.drives import Mapped, SimulatedDrive
from hypermap.experiments.results import WorldResult
from hypermap.experiments.tables import Interval
from hypermap.mapping.config import profile
from hypermap.simulation import errors_of_level
from hypermap.simulation.sightings import Sightings
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, World, WorldObject


def result(name: str = "w") -> WorldResult:
    """Two drives past a table, which is found without a part by the second alone."""
    world = World(
        name,
        FloorPlan((0, 0, 9, 9)),
        objects=(WorldObject("table", (2, 2)), WorldObject("cup", (5, 5))),
        drive=DrivePlan(((0.5, 2), (0.7, 2)), speed=0.2),
    )
    table = SemanticObject("table", shapely.box(1.6, 1.3, 2.4, 2.7))
    far = SemanticObject("table", shapely.box(4.6, 1.3, 5.4, 2.7))
    errors, sightings = errors_of_level("none"), Sightings.none(2)
    return WorldResult.of(
        [
            Mapped(
                SimulatedDrive(world, seed, errors, 1.0),
                1,
                {WHOLE: (table,), "rays": (found,)},
                sightings,
            )
            for seed, found in ((1, far), (2, table))
        ]
    )


def test_each_part_changes_something_and_parts_that_are_off_are_not_listed() -> None:
    whole = profile("default")
    parts = without_parts(whole)
    assert parts[WHOLE] == whole
    assert len({repr(config) for config in parts.values()}) == len(parts) > 20
    bare = replace(whole, alignment=replace(whole.alignment, enabled=False))
    assert set(parts) - set(without_parts(bare)) == {"pose correction"}
    assert list(chosen_parts(whole, "voting,rays")) == [
        WHOLE,
        "voting: best shape",
        "voting: convex hull",
        "rays",
    ]
    for words, none in (("voting,", ""), (WHOLE, WHOLE)):
        with pytest.raises(HypermapError, match=f"has no part '{none}' that can be left out"):
            chosen_parts(whole, words)


def test_changes_are_paired_by_drive() -> None:
    whole, rays = rows_of([result()])
    assert whole.means["recall"] == 0.5
    assert set(whole.changes.values()) == {None}
    assert rays.means["recall"] == 0.25
    change = rays.changes["recall"]
    assert change is not None
    assert (change.pairs, change.mean) == (2, -0.25)
    half = stats.t.ppf(0.975, df=1) * 0.25  # the standard error of 0 and -0.5
    assert (change.low, change.high) == pytest.approx((-0.25 - half, -0.25 + half))
    distance = rays.changes["distance"]
    assert distance is not None
    assert distance.mean == pytest.approx(1.5)


def test_tables_are_of_each_world_and_of_all() -> None:
    tables = {table.name: table for table in tables_of([result("a"), result("b")])}
    assert list(tables) == [
        "a-changes",
        "a-means",
        "b-changes",
        "b-means",
        "all-changes",
        "all-means",
    ]
    (row,) = tables["all-changes"].rows
    assert row[0] == "rays"
    change = row[4]
    assert isinstance(change, Interval)
    assert (change.mean, change.low + change.high) == pytest.approx((-0.25, -0.5))
    twice = [table.caption for table in tables_of([result("all"), result("b")])]
    assert (twice[0][:4], twice[-1][:10]) == ("all:", "all worlds")
    assert "(Student's t over 4 drives, paired)" in tables["all-changes"].caption
    data = to_data([result("a"), result("b")])
    assert data["worlds"]["a"]["parts"]["rays"]["changes"]["recall"]["mean"] == -0.25
    assert data["all"]["seeds"] == {"a": [1, 2], "b": [1, 2]}
