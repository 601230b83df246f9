"""A map in a store keeps the laws of layers, and answers as the same map in memory."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Callable, Iterator
from typing import Any, cast
from urllib.parse import quote

import numpy as np
import pytest
import shapely
from click.testing import Result
from typer.testing import CliRunner

pytest.importorskip("psycopg", reason="psycopg is missing")

from psycopg import Rollback

from hypermap import Hypermap, HypermapError, open_map
from hypermap.cli.main import app
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.fleet.store.address import StoreError, parse_address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.pushing import push
from hypermap.fleet.store.rows import tile_of
from hypermap.fleet.store.stored_objects import StoredObjects
from hypermap.fleet.store.tables import SRID
from hypermap.testing import occupancy_from_text, square
from hypermap.testing.contract import LayerContract

pytestmark = pytest.mark.xdist_group("store")

LAYER = 20_000  # a number beyond those of other tests that PostgreSQL still counts as small
# 30 layers of 400 objects, each of 1 m^2, with 20 names.
MANY_OBJECTS = f"""
INSERT INTO objects (layer_id, id, position, name, shape, footprint, area, x, y, valid_from)
SELECT layer, n, n, 'thing ' || n % 20, box, ST_AsBinary(box), 1, x + 0.5, y + 0.5, 1
FROM generate_series({LAYER}, {LAYER} + 29) AS layer, generate_series(0, 399) AS n,
    LATERAL (SELECT 2 * (n % 20) AS x, 2 * (n / 20) AS y) AS corner,
    LATERAL (SELECT ST_MakeEnvelope(x, y, x + 1, y + 1, {SRID}) AS box) AS square
"""

ROOMS = """
##########
#....#???#
#....#???#
#........#
##########
"""


@pytest.fixture(scope="module")
def opened(store: str) -> Iterator[Hypermap]:
    """A map of two layers, opened from a store."""
    database = Database(parse_address(store))
    origin = Pose2D(-8.0, -20.8, 0.3)
    push(database, Hypermap([occupancy_from_text(ROOMS, 0.5, origin), some_objects()]), "contract")
    database.close()
    hypermap: Any = open_map(f"{store}&site=contract")
    yield hypermap
    hypermap.database.close()


class TestStoredOccupancyLayer(LayerContract):
    class_name = "OccupancyGridLayer"

    @pytest.fixture
    def layer(self, opened: Hypermap) -> Layer:
        return opened["occupancy"]


def some_objects() -> SemanticLayer:
    bow_tie = shapely.Polygon([(4, 0), (6, 2), (6, 0), (4, 2)])
    return SemanticLayer(
        "semantic",
        "map",
        [
            square("chair", 0, 0, tags=("chair", "stool"), confidence=(0.75, 0.25)),
            square("chair", 0.25, 0.25, 0.5, id=7, existence=2.5, last_seen=12.0),
            square("potted plant", 2, 3, attributes={"color": "green"}),
            SemanticObject("table", bow_tie),
        ],
    )


class TestStoredSemanticLayer(LayerContract):
    class_name = "SemanticLayer"

    @pytest.fixture
    def layer(self, opened: Hypermap) -> Layer:
        return opened["semantic"]


class ExplainedDatabase:
    """A database that notes how it answers each question."""

    def __init__(self, cursor: Any) -> None:
        self._cursor = cursor
        self.plan = ""

    def rows(self, question: str, *values: Any) -> list[tuple[Any, ...]]:
        """Return the rows of a question."""
        self._cursor.execute(f"EXPLAIN {question}", values)
        self.plan = "\n".join(line for (line,) in self._cursor)
        return self._cursor.execute(question, values).fetchall()  # type: ignore[no-any-return]


BY_PLACE = "using objects_shape .*Index Cond: .*layer_id = .* AND .*shape &&"
BY_NAME = "(using|on) objects_name .*Index Cond: .*name = .* AND .*layer_id = "


def test_questions_to_a_store_of_many_sites_use_one_index_of_layers_and_of_what_is_asked(
    database: Database,
) -> None:
    """A small number must not come as a smallint, for which the index of places is no use."""
    questions: dict[str, tuple[Callable[[StoredObjects], object], str]] = {
        "at a point": (lambda all_: all_.all_at(np.array([20.5, 20.5])), BY_PLACE),
        "at points": (lambda all_: all_.at_each(np.array([[0.5, 0.5], [20.5, 20.5]])), BY_PLACE),
        "in an area": (lambda all_: all_.in_area(shapely.box(20, 20, 22, 22)), BY_PLACE),
        "by name": (lambda all_: all_.named("thing 7"), BY_NAME),
        "by id": (lambda all_: all_.named(7), "using objects_now .*layer_id = .* AND .*id = "),
    }
    with database.transaction() as cursor:
        cursor.execute(MANY_OBJECTS)
        cursor.execute("ANALYZE objects")
        explained = ExplainedDatabase(cursor)
        objects = StoredObjects(cast(Database, explained), LAYER, lambda _gone, _new: None)
        for question, (ask, expected) in questions.items():
            assert np.size(ask(objects)), question
            assert re.search(expected, explained.plan, re.DOTALL), f"{question}: {explained.plan}"
        raise Rollback


@pytest.mark.parametrize("content", [b"", b"no zlib", zlib.compress(bytes(10_000_000))])
def test_a_tile_that_is_damaged_or_a_bomb_is_one_error(content: bytes) -> None:
    grid = GridGeometry(130, 100, 0.05)
    assert tile_of(zlib.compress(bytes(200)), (0, 1), grid, np.dtype(np.int8)).shape == (100, 2)
    with pytest.raises(StoreError, match="tile in row 0, column 1 of a grid is damaged"):
        tile_of(content, (0, 1), grid, np.dtype(np.int8))


def test_a_shape_written_by_another_program_that_would_crash_geos_is_refused(
    store: str, site: str
) -> None:
    database = Database(parse_address(store))
    push(database, Hypermap([SemanticLayer("semantic", "map", [square("cup", 0, 0)])]), site)
    hollow = shapely.Polygon([(0, 0), (1, 0), (1, 1)], [shapely.LinearRing()])
    with database.transaction() as cursor:
        cursor.execute(
            """UPDATE objects SET footprint = %s
            FROM layers JOIN sites ON sites.id = layers.site_id
            WHERE layers.id = objects.layer_id AND sites.name = %s""",
            (shapely.to_wkb(hollow), site),
        )
    with pytest.raises(StoreError, match="hole without corners"):
        list(open_map(f"{store}&site={site}").objects_at((0.1, 0.1)))
    database.close()


def test_objects_of_a_site_expire_and_no_answer_shows_a_password(
    store: str, site: str, database: Database
) -> None:
    push(database, Hypermap([SemanticLayer("zones", "map", [square("wet floor", 0, 0)])]), site)
    address = f"{store}&site={quote(site)}".replace("@", ":secret@", 1)

    def run(*words: str) -> Result:
        return CliRunner().invoke(app, [words[0], address + words[1], *words[2:]])

    expire = ("0", "--until", "2020-01-01T10:00")
    assert isinstance(run("expire", "&version=1", *expire).exception, HypermapError)
    found = json.loads(run("query", "", "--name", "wet floor", "--json").stdout)
    assert [one["value"] for one in found["answers"]] == [0]
    assert "secret" not in found["map"]
    assert "wet floor 0 expires on 2020-01-01" in run("expire", "", *expire).output
    assert json.loads(run("query", "", "--json", "--name", "wet floor").stdout)["answers"] == []
