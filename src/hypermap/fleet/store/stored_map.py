"""A site of a store as a `Hypermap`: the same questions, answered by the database."""

from __future__ import annotations

from collections.abc import ItemsView, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import PointsLike, as_points_xy
from hypermap.core.evidence import EvidenceTable
from hypermap.core.grid import GridGeometry
from hypermap.core.history import History
from hypermap.core.hypermap import Hypermap, Matches
from hypermap.core.layer import Hits, Layer
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.core.pictures import ObjectPicture
from hypermap.core.semantic import KeptObjects, SemanticLayer
from hypermap.fleet.store import pushing, rows, tables
from hypermap.fleet.store.address import site_address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.sites import find_site
from hypermap.fleet.store.stored_objects import StoredObjects
from hypermap.fleet.store.updates import Update, apply


def open_site(address: object) -> Hypermap:
    """Return the map of a site in a store; `hypermap.open_map` calls this.

    With a version in the address, it is a map in memory. Without, the database answers: objects,
    rooms and cells are those of the moment of each question, also if others write. Which layers
    and frames there are is read once.

    Args:
        address: such as "postgresql://robot@db.example/maps?site=lab" or, for a former version,
            "...?site=lab&version=3".

    Raises:
        StoreAway: If the database does not answer.
        StoreError: If it refuses, or there is no such site.
    """
    where = site_address(address)
    assert where.site is not None  # or it is an error
    database = Database(where)
    if where.version is not None:
        try:
            return pushing.pull(database, where.site, where.version)
        finally:
            database.close()
    return StoredHypermap.of(database, where.site)


class StoredHypermap(Hypermap):
    """The map of a site, whose layers ask the database.

    Attributes:
        database: the connection to the store.
        site: the name of the site.
    """

    database: Database
    site: str

    @classmethod
    def of(cls, database: Database, site: str) -> StoredHypermap:
        """Return the map of a site.

        Raises:
            SiteNotFound: If there is no such site.
        """
        with database.snapshot():
            site_id, version = find_site(database, site)
            skeleton = pushing.skeleton_of(database, site_id, version, site)
            ids = pushing.ids_of_layers(database, site_id)
        layers = [_stored(database, site, each, ids) for each in skeleton]
        stored = cls(layers, skeleton.frames, skeleton.metadata)
        stored.mapper_state = skeleton.mapper_state
        stored.database, stored.site = database, site
        return stored

    @property
    def history(self) -> History | None:
        """What has changed so far; loads the whole map, to know what changes from now on."""
        return self.loaded().history

    @history.setter
    def history(self, history: History | None) -> None:
        """Do nothing: the history is in the store."""

    @property
    def version(self) -> int:
        """The version of the site at this moment."""
        return find_site(self.database, self.site)[1]

    def loaded(self) -> Hypermap:
        """Return the map in memory, as it is at present."""
        return pushing.pull(self.database, self.site)

    def __reduce__(self) -> tuple[Any, ...]:
        return _as_it_is, (self.loaded(),)

    def matching(self, *conditions: Any, **others: Any) -> Matches:
        """Find the objects that meet conditions, all at one moment; see `Hypermap.matching`."""
        with self.database.snapshot():
            return super().matching(*conditions, **others)

    def nearest(self, *asked: Any, **others: Any) -> list[Any]:
        """Return the nearest objects of all layers at one moment; see `Hypermap.nearest`."""
        if sum(isinstance(layer, SemanticLayer) for layer in self) < 2:
            return super().nearest(*asked, **others)  # a single question
        with self.database.snapshot():
            return super().nearest(*asked, **others)


def _as_it_is(loaded: Any) -> Any:
    """Return what a pickle or copy holds, which is in memory."""
    return loaded


def _stored(database: Database, site: str, layer: Layer, ids: Mapping[str, int]) -> Layer:
    if isinstance(layer, SemanticLayer):
        return StoredSemanticLayer(database, site, ids[layer.name], layer)
    if isinstance(layer, OccupancyLayer):
        return StoredOccupancyLayer(database, ids[layer.name], layer)
    return layer


class StoredSemanticLayer(SemanticLayer):
    """A semantic layer whose objects, evidence and pictures are in a database.

    A change is written to the store at once, as a version of the site.
    """

    def __init__(
        self, database: Database, site: str, layer_id: int, skeleton: SemanticLayer
    ) -> None:
        self._database = database
        self._site = site
        self._layer_id = layer_id
        super().__init__(skeleton.name, skeleton.frame_id, (), skeleton.settings, skeleton.rejected)
        self.kept_evidence = self._whole_evidence
        self.kept_pictures = _StoredPictures(database, layer_id)

    @property
    def _now(self) -> KeptObjects:
        return StoredObjects(self._database, self._layer_id, self._write)

    @_now.setter
    def _now(self, after: KeptObjects) -> None:
        """Do nothing: a change is in the store already."""

    def _write(self, gone: Mapping[int, int], new: Sequence[SemanticObject]) -> None:
        kept = {item.id for item in new}
        apply(
            self._database,
            Update(
                self._site,
                self.name,
                objects=tuple(new),
                removed=tuple(number for number in gone if number not in kept),
                seen=dict(gone),
            ),
        )

    def loaded(self) -> SemanticLayer:
        """Return the layer in memory, as it is at present."""
        with self._database.snapshot():
            (site_id,) = self._database.rows(
                "SELECT site_id FROM layers WHERE id = %s", self._layer_id
            )[0]
            version = self._database.rows("SELECT version FROM sites WHERE id = %s", site_id)[0][0]
            skeleton = SemanticLayer(
                self.name, self.frame_id, settings=self.settings, rejected=self.rejected
            )
            layer = pushing.read_layer(self._database, skeleton, self._layer_id, version)
        assert isinstance(layer, SemanticLayer)
        return layer

    copy = loaded
    __copy__ = loaded

    def __reduce__(self) -> tuple[Any, ...]:
        return _as_it_is, (self.loaded(),)

    def evidence(self) -> EvidenceTable | None:
        """Return the evidence for the current objects; None if there is none."""
        kept = self._evidence("")
        return None if kept is None else kept.of(self.ids)

    def evidence_of(self, object_id: int) -> EvidenceTable:
        """Return the evidence for one object; empty if there is none.

        Raises:
            ObjectNotFound: If there is no such object.
        """
        self._rows_there(self._now, [object_id])
        kept = self._evidence(" AND object_id = %s", object_id)
        return EvidenceTable.empty() if kept is None else kept.of([object_id])

    def _whole_evidence(self) -> EvidenceTable:
        kept = self._evidence("")
        return EvidenceTable.empty() if kept is None else kept

    def _evidence(self, condition: str, *values: Any) -> EvidenceTable | None:
        """Return the observations that meet a condition of ours, and their views."""
        chosen = f"FROM observations WHERE layer_id = %s AND valid_to IS NULL{condition}"
        with self._database.snapshot():
            observations = self._database.rows(
                "SELECT object_id, view, score, lowest, highest, footprint "
                f"{chosen} ORDER BY number",
                self._layer_id,
                *values,
            )
            views = self._database.rows(
                "SELECT number, stamp, pose, area FROM views WHERE layer_id = %s "
                f"AND valid_to IS NULL AND number IN (SELECT view {chosen}) ORDER BY number",
                self._layer_id,
                self._layer_id,
                *values,
            )
        return rows.evidence_of(views, observations) if views else None


class _StoredPictures(Mapping[int, tuple[ObjectPicture, ...]]):
    """The pictures of a layer's present objects, by id, read when they are asked for."""

    def __init__(self, database: Database, layer_id: int) -> None:
        self._database = database
        self._layer_id = layer_id

    def __getitem__(self, object_id: int) -> tuple[ObjectPicture, ...]:
        found = self._rows("object_id, content", " AND object_id = %s", object_id)
        return rows.pictures_of(found)[object_id]

    def items(self) -> ItemsView[int, tuple[ObjectPicture, ...]]:
        """Return those of all objects, read at once."""
        return rows.pictures_of(self._rows("object_id, content", "")).items()

    def __iter__(self) -> Iterator[int]:
        return (object_id for (object_id,) in self._rows("object_id", " ORDER BY object_id"))

    def __len__(self) -> int:
        return int(self._rows("count(*)", "")[0][0])

    def _rows(self, columns: str, rest: str, *values: Any) -> list[rows.Row]:
        return self._database.rows(
            f"SELECT {columns} FROM pictures WHERE layer_id = %s AND valid_to IS NULL{rest}",
            self._layer_id,
            *values,
        )


class StoredOccupancyLayer(OccupancyLayer):
    """An occupancy layer whose cells are tiles in a database, of which questions get some."""

    def __init__(self, database: Database, layer_id: int, skeleton: OccupancyLayer) -> None:
        self._database = database
        self._layer_id = layer_id
        super().__init__(skeleton.name, skeleton.frame_id, settings=skeleton.settings)

    @property
    def grid(self) -> GridGeometry | None:
        """The geometry of the cells at this moment; None while the layer is empty."""
        found = self._grid()
        return None if found is None else found[0]

    @grid.setter
    def grid(self, grid: GridGeometry | None) -> None:
        """Do nothing: the grid is in the store."""

    @property
    def cells(self) -> NDArray[Any] | None:
        """All cells at this moment, read-only, shape (height, width)."""
        return self.loaded().cells

    @cells.setter
    def cells(self, cells: NDArray[Any] | None) -> None:
        """Do nothing: the cells are in the store."""

    def loaded(self) -> OccupancyLayer:
        """Return the layer in memory, as it is at present."""
        return self._with_tiles("")

    def __reduce__(self) -> tuple[Any, ...]:
        return _as_it_is, (self.loaded(),)

    def __copy__(self) -> OccupancyLayer:
        return self.loaded()

    def value_at(self, points_xy: PointsLike) -> NDArray[np.int32]:
        """Return the cell at each point, shape (N,); -1 where unknown or outside the grid."""
        points = as_points_xy(points_xy)
        values = np.full(len(points), UNKNOWN, dtype=np.int32)
        with self._database.snapshot():
            found = self._grid()
            if found is None:
                return values
            grid, kind = found
            cells = grid.cells_at(points)
            on_grid = np.flatnonzero(grid.contains(*cells.T))
            places = cells[on_grid] // rows.TILE
            names, of_point = np.unique(places, axis=0, return_inverse=True)
            tiles = self._database.rows(
                "SELECT tile_row, tile_col, cells FROM tiles WHERE layer_id = %s "
                "AND valid_to IS NULL AND (tile_row, tile_col) IN "
                "(SELECT * FROM unnest(%s::int[], %s::int[]))",
                self._layer_id,
                *names.T.tolist(),
            )
        contents = {(row, col): content for row, col, content in tiles}
        for number, (row, col) in enumerate(names.tolist()):
            here = on_grid[of_point.ravel() == number]
            tile = rows.tile_of(contents[row, col], (row, col), grid, kind)
            within = cells[here] - [row * rows.TILE, col * rows.TILE]
            values[here] = tile[within[:, 0], within[:, 1]]
        return values

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the value and center of each cell whose center the area covers, row by row."""
        return self._around(area).values_in(area)

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centers of the cells with a label or value, shape (M, 2), row by row."""
        return self._around(area).find(what, area)

    def _around(self, area: BaseGeometry | None) -> OccupancyLayer:
        """Return the layer in memory with at least the cells of an area."""
        with self._database.snapshot():
            return self._around_now(area)

    def _around_now(self, area: BaseGeometry | None) -> OccupancyLayer:
        grid = self.grid
        if area is None or grid is None:
            return self.loaded()
        window = grid.window_in(area)
        first = window.row // rows.TILE, window.col // rows.TILE
        last = (
            (window.row + window.shape[0]) // rows.TILE,
            (window.col + window.shape[1]) // rows.TILE,
        )
        condition = " AND tile_row BETWEEN %s AND %s AND tile_col BETWEEN %s AND %s"
        return self._with_tiles(condition, first[0], last[0], first[1], last[1])

    def _with_tiles(self, condition: str, *values: int) -> OccupancyLayer:
        """Return the layer in memory with the tiles that meet a condition of ours."""
        with self._database.snapshot():
            found = self._grid()
            if found is None:
                return OccupancyLayer(self.name, self.frame_id, settings=self.settings)
            tiles = self._database.rows(
                "SELECT tile_row, tile_col, cells FROM tiles WHERE layer_id = %s "
                f"AND valid_to IS NULL{condition}",
                self._layer_id,
                *values,
            )
        grid, kind = found
        cells = rows.cells_of(tiles, grid, kind, UNKNOWN)
        return OccupancyLayer(self.name, self.frame_id, grid, cells, self.settings)

    def _grid(self) -> tuple[GridGeometry, np.dtype[Any]] | None:
        columns = ", ".join(tables.GRIDS.columns)
        found = self._database.rows(
            f"SELECT {columns} FROM grids WHERE layer_id = %s AND valid_to IS NULL", self._layer_id
        )
        return rows.grid_of(found[0]) if found else None
