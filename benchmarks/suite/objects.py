"""Made-up semantic layers: a large floor with things and some rooms, and questions to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import as_objects
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import SemanticLayer

CLASSES, CORNERS = 50, 8
SPACING = 1.5  # meters; as many times the number of objects' root, the floor is wide
AREA_SIDES = (1.0, 10.0, 0.25, 1.0)  # meters of the first two, parts of the floor of the others


# The number of an object, its new shape, and the centroid of that.
Change = tuple[int, shapely.Polygon, list[float]]


@dataclass(frozen=True, eq=False)
class Floor:
    """Objects on a square floor, and what is asked about them.

    Attributes:
        xy: the objects' corners [m], shape (N, 8, 2); one in a hundred is as large as a room.
        shapes: the same as polygons, shape (N,).
        codes: number of each object's class, shape (N,).
        points: shape (P, 2).
        starts: from where the nearest are asked for, shape (100, 2).
        areas: boxes (x0, y0, x1, y1) of four sizes: 1 m wide, 10 m, a quarter and all of the floor.
        moves: by how much the first objects are moved, and back again [m], shape (M, 2).
    """

    xy: NDArray[np.float64]
    shapes: NDArray[np.object_]
    codes: NDArray[np.int32]
    points: NDArray[np.float64]
    starts: NDArray[np.float64]
    areas: tuple[NDArray[np.float64], ...]
    moves: NDArray[np.float64]

    @property
    def names(self) -> NDArray[np.object_]:
        """The objects' names, shape (N,)."""
        return as_objects(f"class {code}" for code in self.codes.tolist())

    def changes(self, count: int) -> list[Change]:
        """Return the moves of the first objects, so many at most, and then those back."""
        moves = self.moves[:count, np.newaxis]
        numbers = range(len(moves))
        moved = np.asarray(shapely.polygons(self.xy[: len(moves)] + moves))
        shapes = [*moved, *self.shapes[: len(moves)]]
        at = shapely.get_coordinates(shapely.centroid(shapes)).tolist()
        return list(zip([*numbers, *numbers], shapes, at, strict=True))

    def layer(self) -> SemanticLayer:
        """Return the objects as a layer; their ids are their places."""
        count = len(self.shapes)
        nothing, unknown = as_objects([()] * count), np.full(count, np.nan)
        table = ObjectTable(
            ids=np.arange(count),
            codes=self.codes,
            footprints=self.shapes,
            tags=nothing,
            confidence=nothing,
            existence=unknown,
            first_seen=unknown,
            last_seen=unknown,
            attributes=as_objects([{}] * count),
            vocabulary={f"class {code}": code for code in range(CLASSES)},
        )
        return SemanticLayer.of_table("semantic", "map", table)

    def write(self, folder: Path) -> None:
        """Write what `benchmarks/boost/layer_queries.cpp` reads."""
        folder.mkdir(parents=True, exist_ok=True)
        np.full(len(self.xy), CORNERS, dtype=np.int32).tofile(folder / "corners.i32")
        self.codes.tofile(folder / "names.i32")
        arrays: dict[str, Any] = {"xy": self.xy, "points": self.points, "starts": self.starts}
        arrays |= {"moves": self.moves} | {f"areas{i}": a for i, a in enumerate(self.areas)}
        for name, array in arrays.items():
            array.tofile(folder / f"{name}.f64")


def floor(count: int, points: int, moves: int = 1000) -> Floor:
    """Return a floor with so many objects; the same each time."""
    rng = np.random.default_rng(count)
    side = SPACING * np.sqrt(count)
    radii = np.exp(rng.uniform(np.log(0.1), np.log(0.6), count))
    radii[::100] *= 10
    angles = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    reach = radii[:, np.newaxis] * rng.uniform(0.7, 1, (count, CORNERS))
    xy = rng.uniform(0, side, (count, 1, 2)) + reach[..., np.newaxis] * around
    areas = []
    for number, asked in zip((100, 100, 10, 1), AREA_SIDES, strict=True):
        width = asked if number == 100 else asked * side
        corner = rng.uniform(0, max(side - width, 0), (number, 2))
        areas.append(np.concatenate([corner, corner + width], axis=1))
    return Floor(
        xy=xy,
        shapes=np.asarray(shapely.polygons(xy)),
        codes=rng.integers(0, CLASSES, count).astype(np.int32),
        points=rng.uniform(0, side, (points, 2)),
        starts=rng.uniform(0, side, (100, 2)),
        areas=tuple(areas),
        moves=rng.normal(0, 1, (min(moves, count), 2)),
    )
