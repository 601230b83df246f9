"""Rows of the tables as objects, evidence and cells, and back; exactly."""

from __future__ import annotations

import functools
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.evidence import EvidenceTable
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.objects import ObjectTable
from hypermap.core.pictures import ObjectPicture
from hypermap.core.tangles import has_empty_hole
from hypermap.fleet.store.address import StoreError
from hypermap.fleet.store.tables import SRID
from hypermap.formats.semantic.parquet_files import attributes_as_text, attributes_of_text
from hypermap.formats.semantic.pictures_file import dump_pictures, parse_pictures

Row = tuple[Any, ...]

_TEXT, _FLOAT8 = 25, 701  # the numbers of these types in every database

TILE = 128
"""Rows and columns of cells in a tile."""

OBJECT = (
    "position, id, name, ST_AsBinary(shape), footprint, area, x, y, tags, confidence, "
    "existence, first_seen, last_seen, attributes, valid_from"
)
"""The columns of an object, as `table_of` takes them; the last is the version that it is of."""


# Objects


def rows_of_objects(
    table: ObjectTable, positions: NDArray[np.int64] | None = None
) -> Iterator[Row]:
    """Yield the rows of objects, as `tables.OBJECTS` has them.

    Args:
        table: the objects.
        positions: their places in the order of the layer; None for 0, 1, 2, ...

    Raises:
        StoreError: If the name or a tag of one has a NUL character, which PostgreSQL has not.
    """
    _check_texts(table)
    places = np.arange(len(table)) if positions is None else positions
    is_repaired = np.array(
        [one is not other for one, other in zip(table.shapes, table.footprints, strict=True)],
        dtype=bool,
    )
    # Without -0.0: PostGIS compares bytes, so that a ring from 0.0 to -0.0 is none for it.
    unsigned = shapely.transform(table.shapes, lambda xy: xy + 0.0)
    shapes = shapely.to_wkb(shapely.set_srid(unsigned, SRID), include_srid=True)
    footprints = np.full(len(table), None)
    footprints[is_repaired] = shapely.to_wkb(table.footprints[is_repaired])
    known = list(table.vocabulary)
    yield from zip(
        table.ids.tolist(),
        places.tolist(),
        [known[code] for code in table.codes.tolist()],
        shapes,
        footprints,
        table.areas.tolist(),
        table.centroids[:, 0].tolist(),
        table.centroids[:, 1].tolist(),
        [_text_array(tags) if tags else None for tags in table.tags],
        [_number_array(values) if values else None for values in table.confidence],
        *(_or_none(getattr(table, key)) for key in ("existence", "first_seen", "last_seen")),
        [attributes_as_text(each) if each else None for each in table.attributes],
        strict=True,
    )


def table_of(rows: Sequence[Row]) -> ObjectTable:
    """Return objects in rows of the columns `OBJECT`, in the same order."""
    columns = list(zip(*rows, strict=True)) if rows else [()] * 15
    ids, names, wkb, given, areas, xs, ys, tags, confidence, *numbers, attributes = columns[1:-1]
    vocabulary: dict[str, int] = {}
    codes = [vocabulary.setdefault(name, len(vocabulary)) for name in names]
    shapes: ObjectArray = as_objects(shapely.from_wkb(as_objects(wkb)))
    footprints = shapes
    if any(each is not None for each in given):
        own = _shapes_of(given)  # None where it is the shape
        footprints = np.where(shapely.is_missing(own), shapes, own)
    existence, first_seen, last_seen = (_or_nan(values) for values in numbers)
    table = ObjectTable(
        ids=np.array(ids, dtype=np.int64),
        codes=np.array(codes, dtype=np.int32),
        footprints=footprints,
        tags=as_objects(tuple(each or ()) for each in tags),
        confidence=as_objects(tuple(each or ()) for each in confidence),
        existence=existence,
        first_seen=first_seen,
        last_seen=last_seen,
        attributes=as_objects(
            {} if each is None else attributes_of_text(each, "attributes") for each in attributes
        ),
        vocabulary=vocabulary,
    )
    centroids = np.column_stack([np.array(xs, dtype=float), np.array(ys, dtype=float)])
    computed = {"shapes": shapes, "areas": np.array(areas, dtype=float), "centroids": centroids}
    vars(table).update(computed)
    return table


def _shapes_of(wkb: Iterable[bytes | None]) -> ObjectArray:
    """Return the geometries of well-known binary, None where that is None.

    Raises:
        StoreError: If GEOS would crash on one that another program has written; in a column of
            PostGIS' own type, it refuses these.
    """
    shapes: ObjectArray = as_objects(shapely.from_wkb(as_objects(wkb)))
    if has_empty_hole(shapes).any():
        raise StoreError("a footprint or an area in the store has a hole without corners")
    return shapes


def _check_texts(table: ObjectTable) -> None:
    names = {code: name for name, code in table.vocabulary.items()}
    wrong_names = {code for code, name in names.items() if "\0" in name}
    wrong_tags = {tags for tags in set(table.tags) if any("\0" in tag for tag in tags)}
    if not (wrong_names or wrong_tags):
        return
    for number, code, tags in zip(table.ids, table.codes, table.tags, strict=True):
        if code in wrong_names or tags in wrong_tags:
            raise StoreError(
                f"object {number}, {names[code]!r}: its name or a tag has a NUL character, which "
                "the database does not allow; rename it"
            )


# Evidence


def rows_of_views(evidence: EvidenceTable, first: int = 0) -> Iterator[Row]:
    """Yield the views of evidence, as `tables.VIEWS` has them, numbered from `first` on."""
    areas = shapely.to_wkb(evidence.areas)
    for number, (stamp, pose, area) in enumerate(
        zip(evidence.stamps.tolist(), evidence.poses, areas, strict=True)
    ):
        yield number + first, stamp, np.ascontiguousarray(pose, "<f8").tobytes(), area


def rows_of_observations(
    evidence: EvidenceTable, first: int = 0, first_view: int = 0
) -> Iterator[Row]:
    """Yield the observations of evidence, as `tables.OBSERVATIONS` has them."""
    yield from zip(
        range(first, first + len(evidence)),
        evidence.object_ids.tolist(),
        (evidence.views + first_view).tolist(),
        evidence.scores.tolist(),
        evidence.heights[:, 0].tolist(),
        evidence.heights[:, 1].tolist(),
        shapely.to_wkb(evidence.footprints),
        strict=True,
    )


def evidence_of(views: Sequence[Row], observations: Sequence[Row]) -> EvidenceTable:
    """Return evidence.

    Args:
        views: number, stamp, pose and area, in the order of the numbers.
        observations: object_id, view, score, lowest, highest and footprint.
    """
    numbers, stamps, poses, areas = zip(*views, strict=True) if views else [()] * 4
    ids, of_view, scores, *heights, shapes = (
        zip(*observations, strict=True) if observations else [()] * 6
    )
    return EvidenceTable(
        object_ids=np.array(ids, dtype=np.int64),
        views=np.searchsorted(np.array(numbers, dtype=np.int64), np.array(of_view, np.int64)),
        scores=np.array(scores, dtype=float),
        footprints=_shapes_of(shapes),
        heights=np.column_stack([np.array(each, dtype=float) for each in heights]),
        stamps=np.array(stamps, dtype=float),
        poses=np.frombuffer(b"".join(poses), "<f8").astype(float).reshape(-1, 4, 4),
        areas=_shapes_of(areas),
    )


# Pictures


def rows_of_pictures(pictures: Mapping[int, Sequence[ObjectPicture]]) -> Iterator[Row]:
    """Yield the pictures of objects, as `tables.PICTURES` has them."""
    for number, kept in pictures.items():
        yield number, dump_pictures({number: kept})


def pictures_of(rows: Sequence[Row]) -> dict[int, tuple[ObjectPicture, ...]]:
    """Return pictures by their objects' ids, of rows of object_id and content."""
    return {number: parse_pictures(content, "pictures")[number] for number, content in rows}


# Cells


def rows_of_cells(cells: NDArray[Any]) -> Iterator[Row]:
    """Yield the tiles of a grid, as `tables.TILES` has them; those at the ends are smaller."""
    height, width = cells.shape
    for row in range(0, height, TILE):
        for col in range(0, width, TILE):
            part = cells[row : row + TILE, col : col + TILE]
            yield row // TILE, col // TILE, content_of_tile(part)


def content_of_tile(cells: NDArray[Any]) -> bytes:
    """Return the cells of a tile as `tables.TILES` has them."""
    little = cells.astype(cells.dtype.newbyteorder("<"))
    return zlib.compress(little.tobytes(), 1)


def shape_of_tile(place: tuple[int, int], grid: GridGeometry) -> tuple[int, int]:
    """Return the rows and columns of the tile at (tile_row, tile_col) of a grid."""
    height, width = (
        min(TILE, size - number * TILE) for size, number in zip(grid.shape, place, strict=True)
    )
    return height, width


def row_of_grid(grid: GridGeometry, cells: NDArray[Any]) -> Row:
    """Return a grid as a row of `tables.GRIDS`."""
    x, y, yaw = grid.origin.x, grid.origin.y, grid.origin.yaw
    return grid.width, grid.height, float(grid.resolution), x, y, yaw, cells.dtype.name


def grid_of(row: Row) -> tuple[GridGeometry, np.dtype[Any]]:
    """Return a grid and the type of its cells, of the columns of `tables.GRIDS`."""
    width, height, resolution, *origin, kind = row
    return GridGeometry(width, height, resolution, Pose2D(*origin)), np.dtype(kind)


def cells_of(
    tiles: Sequence[Row], grid: GridGeometry, kind: np.dtype[Any], unknown: int
) -> NDArray[Any]:
    """Return the cells of a grid, shape (height, width).

    Args:
        tiles: tile_row, tile_col and cells.
        grid: the geometry of all cells.
        kind: int8 or int16.
        unknown: what stands in cells of no tile.
    """
    cells = np.full(grid.shape, unknown, dtype=kind)
    for row, col, content in tiles:
        place = cells[row * TILE :, col * TILE :][:TILE, :TILE]
        place[...] = tile_of(content, (row, col), grid, kind)
    return cells


def tile_of(
    content: bytes, place: tuple[int, int], grid: GridGeometry, kind: np.dtype[Any]
) -> NDArray[Any]:
    """Return the cells of the tile at (tile_row, tile_col) of a grid, shape (h, w).

    Raises:
        StoreError: If it is damaged, or unpacks to more than a tile.
    """
    height, width = shape_of_tile(place, grid)
    wanted = height * width * kind.itemsize
    try:
        plain = zlib.decompressobj().decompress(content, max(wanted, 0) + 1)
    except zlib.error:
        plain = b""
    if len(plain) != wanted or wanted <= 0:
        raise StoreError(f"the tile in row {place[0]}, column {place[1]} of a grid is damaged")
    return np.frombuffer(plain, kind.newbyteorder("<")).reshape(height, width)


@functools.lru_cache(maxsize=4096)  # most objects of a name have the same
def _text_array(texts: tuple[str, ...]) -> bytes:
    """Return a `text[]` as PostgreSQL's binary format has it; psycopg takes ten times as long."""
    encoded = [text.encode() for text in texts]
    items = b"".join(struct.pack(">i", len(text)) + text for text in encoded)
    return struct.pack(">5i", 1, 0, _TEXT, len(texts), 1) + items


def _number_array(values: Sequence[float]) -> bytes:
    """Return a `float8[]` as PostgreSQL's binary format has it."""
    items = (part for value in values for part in (8, value))
    return struct.pack(f">5i{'id' * len(values)}", 1, 0, _FLOAT8, len(values), 1, *items)


def _or_none(values: NDArray[np.float64]) -> list[float | None]:
    return [None if value != value else value for value in values.tolist()]


def _or_nan(values: Sequence[float | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], dtype=float)
