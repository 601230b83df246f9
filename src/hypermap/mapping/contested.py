"""Floor that the shapes of two objects of a class share belongs to one of them.

A box in an image also shows the next shelf of a row, or the one behind, through which the camera
looks, so footprints reach over both. Where enough views do so, the fused shapes of two objects
overlap, although each has more of the votes on its own floor.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray, as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.mapping.footprint_iou import at_same_height

_SHARED = 0.02  # of the smaller footprint; less is noise of the outlines
_CELLS = 40  # along the longer side of a footprint
_DOUBT = 1.0  # votes against, as few views agree by chance; a view from near has its score's weight

VotesAt = Callable[[int, NDArray[np.float64]], NDArray[np.float64]]
"""Returns the votes for an object, by its id, at places [m], (P, 2), and those cast, (2, P)."""


def own_floor(
    objects: Sequence[SemanticObject],
    may_be_one: Callable[[int, int], bool],
    votes_at: VotesAt,
    vote_share: float,
    fixed: Collection[int | None] = (),
) -> dict[int, BaseGeometry]:
    """Return the shapes on their own floor of the objects that share floor with others, by id.

    Their cells have enough votes, and no smaller a share of them, with one vote against, than for
    any other object of the class at the same height that frames have shown together with it. The
    shape is the convex hull of the largest connected part.

    Args:
        objects: of a map, with the attributes `z_min` and `z_max`.
        may_be_one: says of two ids whether they may be one object, or many frames have shown both.
        votes_at: of these objects.
        vote_share: share of the votes that a cell needs in any case.
        fixed: ids of objects that do not change, because they were edited by hand.
    """
    free = {item.id: item for item in objects if item.id is not None and item.id not in fixed}
    rivals: dict[int, list[int]] = {}
    for one, other in _sharing(list(free.values())):
        if not may_be_one(one, other):
            rivals.setdefault(one, []).append(other)
            rivals.setdefault(other, []).append(one)
    found = {}
    for one, others in rivals.items():
        cells, place = _cells(free[one])
        centers_xy = place[:2] + (cells + 0.5) * place[2]
        votes, cast = votes_at(one, centers_xy)
        is_own = (votes > 0) & (votes >= vote_share * cast)
        shares = votes / (cast + _DOUBT)
        for other in others:
            left = np.flatnonzero(is_own)
            votes, cast = votes_at(other, centers_xy[left])
            is_own[left] = shares[left] >= votes / (cast + _DOUBT)
        if is_own.any():
            part = _largest_part(cells[is_own], place)
            (whole,) = valid_copies(as_objects([free[one].footprint]))
            found[one] = shapely.intersection(part, whole)  # cells are coarse
    return {one: shape for one, shape in found.items() if shape.geom_type == "Polygon"}


def _sharing(objects: Sequence[SemanticObject]) -> list[tuple[int, int]]:
    """Return the ids of each two objects of one class that share floor at the same height."""
    shapes = valid_copies(as_objects(item.footprint for item in objects))
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    first, second = first[first < second], second[first < second]
    shared = shapely.area(shapely.intersection(shapes[first], shapes[second]))
    smaller = np.minimum(shapely.area(shapes[first]), shapely.area(shapes[second]))
    is_shared = shared > _SHARED * smaller
    pairs = zip(first[is_shared].tolist(), second[is_shared].tolist(), strict=True)
    return [
        (one.id, other.id)
        for one, other in ((objects[i], objects[j]) for i, j in pairs)
        if one.id is not None and other.id is not None and _are_alike(one, other)
    ]


def _are_alike(one: SemanticObject, other: SemanticObject) -> bool:
    heights = [(item.attributes["z_min"], item.attributes["z_max"]) for item in (one, other)]
    return one.name == other.name and at_same_height(*heights)


def _cells(item: SemanticObject) -> tuple[IntArray, NDArray[np.float64]]:
    """Return the columns and rows of a grid below an object, shape (P, 2), and where it is.

    That is x and y of its lower left corner, and the side of a cell [m], shape (3,).
    """
    xmin, ymin, xmax, ymax = item.footprint.bounds
    side = max(xmax - xmin, ymax - ymin) / _CELLS
    columns, rows = np.ceil((xmax - xmin) / side), np.ceil((ymax - ymin) / side)
    x, y = np.meshgrid(np.arange(columns, dtype=np.int64), np.arange(rows, dtype=np.int64))
    return np.column_stack([x.ravel(), y.ravel()]), np.array([xmin, ymin, side])


def _largest_part(cells: IntArray, place: NDArray[np.float64]) -> BaseGeometry:
    """Return the convex hull of the largest connected part of some cells [m].

    Args:
        cells: as `_cells` returns them, some of these, shape (P, 2).
        place: likewise.
    """
    left, bottom = cells.T
    covered = shapely.coverage_union_all(shapely.box(left, bottom, left + 1, bottom + 1))
    parts = shapely.get_parts(covered)
    hull: BaseGeometry = parts[np.argmax(shapely.area(parts))].convex_hull
    return shapely.transform(hull, lambda xy: place[:2] + xy * place[2])
