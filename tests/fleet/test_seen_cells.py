"""Cells that robots see reach the occupancy layer of a site, tile by tile."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("psycopg", reason="psycopg is missing")

from hypermap import GridGeometry, Hypermap, OccupancyLayer, SemanticLayer
from hypermap.core.frames import Pose2D
from hypermap.fleet.store import rows
from hypermap.fleet.store.address import StoreError
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.delivery import deliver
from hypermap.fleet.store.live_writer import Changes
from hypermap.fleet.store.observed import Observed, apply_observed
from hypermap.fleet.store.pushing import pull, push
from hypermap.fleet.store.seen_cells import NO_NEWS, ChangedCells, changed_cells
from hypermap.fleet.store.spool import Spool

pytestmark = pytest.mark.xdist_group("store")

THINGS = SemanticLayer("semantic", "map")
SIDE = 0.05


def grid_at(x: float, y: float, cells: list[list[int]], frame: str = "map") -> OccupancyLayer:
    """Return a layer whose first cell is at x, y."""
    content = np.array(cells, np.int8)
    grid = GridGeometry(content.shape[1], content.shape[0], SIDE, Pose2D(x, y))
    return OccupancyLayer("occupancy", frame, grid, content)


def stored(database: Database, site: str, layer: OccupancyLayer) -> list[list[int]]:
    """Return the cells of the store at the places of a layer's cells."""
    assert layer.grid is not None
    found = pull(database, site)["occupancy"]
    assert isinstance(found, OccupancyLayer)
    values = found.value_at(layer.grid.centers(*np.indices(layer.grid.shape).reshape(2, -1)))
    return [list(map(int, row)) for row in values.reshape(layer.grid.shape)]


def test_only_cells_that_have_changed_are_sent() -> None:
    before = grid_at(0, 0, [[0, -1], [100, 0]])
    now = grid_at(-SIDE, 0, [[-1, 0, 7], [-1, 100, 0], [0, -1, -1]])
    seen = changed_cells(before, now)
    assert seen is not None
    assert seen.cells.tolist() == [[NO_NEWS] * 2 + [7], [NO_NEWS] * 3, [0] + [NO_NEWS] * 2]
    assert (seen.grid.origin.x, seen.grid.origin.y) == pytest.approx((-SIDE, 0))
    assert changed_cells(now, now) is None
    assert changed_cells(None, OccupancyLayer("occupancy", "map")) is None
    assert changed_cells(before, OccupancyLayer("occupancy", "map")) is None
    assert changed_cells(before, grid_at(0, 0, [[0, -1], [-1, -1]])) is None
    elsewhere = changed_cells(before, grid_at(-9, 9, [[5]]))
    assert elsewhere is not None
    assert elsewhere.cells.tolist() == [[5]]


def test_a_site_grows_with_what_robots_see_and_the_newest_holds(
    database: Database, site: str, tmp_path: Path
) -> None:
    anna, bert = Changes(site, "anna"), Changes(site, "bert")
    first = anna.since_last(THINGS, grid_at(1, 1, [[0, 100], [0, 30]]))
    assert first is not None
    spool = Spool(tmp_path / "spool")
    spool.put(first)
    waited = spool.first()
    spool.close()
    assert waited is not None
    deliver(database, waited[1])  # which makes the site
    deliver(database, first)  # once is enough
    far = grid_at(-20, 1, [[0] * 450])
    for robot, layer in ((bert, far), (anna, grid_at(1, 1, [[0, 100], [100, 30]]))):
        sent = robot.since_last(THINGS, layer)
        assert sent is not None
        assert apply_observed(database, sent)["tiles"] > 0
    assert stored(database, site, far) == [[0] * 450]  # also where anna saw 100 before
    assert stored(database, site, grid_at(1, 1, [[0] * 2] * 2)) == [[0, 0], [100, 30]]
    whole = pull(database, site)["occupancy"]
    assert isinstance(whole, OccupancyLayer)
    assert whole.grid is not None
    assert whole.grid.shape == (128, 5 * 128)
    assert database.rows("SELECT version FROM sites WHERE name = %s", site) == [(4,)]


def test_a_tile_that_stays_is_not_written_again(database: Database, site: str) -> None:
    push(database, Hypermap([THINGS]), site)
    robot = Changes(site, "anna")
    for cells in ([[0] * 300], [[100] + [0] * 299]):
        sent = robot.since_last(THINGS, grid_at(0, 0, cells))
        assert sent is not None
        outcome = apply_observed(database, sent)
    assert outcome == {"tiles": 1}
    assert [layer.name for layer in pull(database, site)] == ["semantic", "occupancy"]


def test_what_a_robot_does_not_know_says_nothing_of_what_others_know(
    database: Database, site: str
) -> None:
    anna, bert = Changes(site, "anna"), Changes(site, "bert")
    push(database, Hypermap([THINGS]), site)
    for robot, cells in (
        (anna, [[0, 100]]),
        (bert, [[0, 100]]),
        (anna, [[-1, 30]]),  # its poses were corrected: what it saw was elsewhere
    ):
        sent = robot.since_last(THINGS, grid_at(0, 0, cells))
        assert sent is not None
        apply_observed(database, sent)
    assert stored(database, site, grid_at(0, 0, [[0, 0]])) == [[0, 30]]
    grid = GridGeometry(2, 1, SIDE)
    unknown = ChangedCells("occupancy", "map", grid, np.full((1, 2), -1, np.int8))
    old = Observed(site, "semantic", "an earlier program", cells=unknown)
    assert apply_observed(database, old) == {}
    assert stored(database, site, grid_at(0, 0, [[0, 0]])) == [[0, 30]]


def test_only_tiles_with_news_are_read_and_written(
    database: Database, site: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    wide = np.zeros((200, 1000), np.int8)
    grid = GridGeometry(1000, 200, SIDE)
    known = OccupancyLayer("occupancy", "map", grid, wide)
    push(database, Hypermap([known, THINGS]), site)
    news = np.full((200, 1000), NO_NEWS, np.int8)
    news[0, 0], news[199, 999], news[5, 500] = 100, 100, 0  # the last is so already
    read = []
    tile_of = rows.tile_of
    monkeypatch.setattr(rows, "tile_of", lambda *of: read.append(of[1]) or tile_of(*of))
    cells = ChangedCells("occupancy", "map", grid, news)
    assert apply_observed(database, Observed(site, "semantic", "anna", cells=cells)) == {"tiles": 2}
    assert read == [(0, 0), (0, 3), (1, 7)]
    found = pull(database, site)["occupancy"]
    assert isinstance(found, OccupancyLayer)
    assert np.argwhere(found.cells == 100).tolist() == [[0, 0], [199, 999]]


def test_cells_go_where_they_lie_on_a_map_that_was_pushed(database: Database, site: str) -> None:
    turned = GridGeometry(40, 40, 0.1, Pose2D(2.0, 0.0, np.pi / 2))
    known = OccupancyLayer("occupancy", "map", turned, np.full((40, 40), 100, np.int8))
    push(database, Hypermap([known, THINGS]), site)
    seen = grid_at(0.5, 0.5, [[0] * 10] * 10)
    sent = Changes(site, "anna").since_last(THINGS, seen)
    assert sent is not None
    apply_observed(database, sent)
    assert stored(database, site, seen) == [[0] * 10] * 10
    found = pull(database, site)["occupancy"]
    assert isinstance(found, OccupancyLayer)
    assert found.grid == turned
    assert int((found.cells == 0).sum()) == 25


def test_cells_that_do_not_fit_are_refused_and_nothing_is_written(
    database: Database, site: str
) -> None:
    push(database, Hypermap([THINGS]), site)
    for layer, reason in (
        (grid_at(0, 0, [[0] * 9]), None),
        (grid_at(1e6, 1e6, [[0]]), "more than 50000000; do all its robots use the same frame"),
        (grid_at(0, 0, [[0]], "odom"), "in frame 'map'; a robot has seen cells in frame 'odom'"),
    ):
        sent = Changes(site, "anna").since_last(THINGS, layer)
        assert sent is not None
        if reason is None:
            apply_observed(database, sent)
            continue
        with pytest.raises(StoreError, match=reason):
            apply_observed(database, sent)
    assert database.rows("SELECT version FROM sites WHERE name = %s", site) == [(2,)]
