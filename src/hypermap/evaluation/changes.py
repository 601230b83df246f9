"""What changed between two maps of one place: objects that came, went, moved, or look different."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arguments import check_kind
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.core.history import (
    ADDED,
    FIRST_SEEN,
    GONE,
    KINDS,
    MOVED,
    NOT_REVISITED,
    RENAMED,
    RESHAPED,
    Change,
)
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.closest import centroids
from hypermap.evaluation.maps import MapObjects
from hypermap.evaluation.matching import iou_matrix, match_objects
from hypermap.history.differences import confidence_of_move, is_said_to_have_moved
from hypermap.history.likeness import (
    FARTHEST,
    MAY_BE,
    MIN_MOVED,
    SAME_SHAPE,
    distance_between,
    likeness,
)

_SAME_PLACE = 0.3  # IoU from which on an object of the same name has not moved
_RENAMED = 0.5  # IoU of an object and one with another name in its place
_AROUND = 0.3  # [m] around an object; if this area is known, so is its place
_KNOWN = 0.3  # share of what is around it


@dataclass(frozen=True, eq=False)
class Changes:
    """What changed between two maps.

    Attributes:
        changes: in the order of `KINDS`, then of the names.
        unchanged: how many objects are in both maps, in the same place.
    """

    changes: tuple[Change, ...]
    unchanged: int


def changes_between(
    first: MapObjects,
    second: MapObjects,
    *,
    min_moved: float = MIN_MOVED,
    is_known: tuple[IsKnown, IsKnown] | None = None,
    same_ids: bool = False,
    names: str | Collection[str] | None = None,
) -> Changes:
    """Return what changed from one map to another of the same place.

    Objects of one layer and name that overlap are the same. Of the others, one that is in the
    place of another has been renamed; one with a shape like that of another of its name has been
    moved; the rest came or went.

    Args:
        first: the objects of the earlier map.
        second: those of the later one, in the same frame.
        min_moved: minimum distance of a move [m].
        is_known: for each map, whether it knows a place; None if both know everything.
        same_ids: whether equal ids mean the same object, as in a map and its continuation.
        names: only objects with this name, or one of several; None for all.

    Raises:
        HypermapError: If neither map has an object of a name.
        TypeError: If one is a map, not its objects.
    """
    check_kind(first, MapObjects)
    check_kind(second, MapObjects)
    names = {names} if isinstance(names, str) else names
    _check_names(names or (), {thing.name for thing in (*first.objects, *second.objects)})
    knows: tuple[IsKnown, IsKnown] = is_known or (_always, _always)
    found: list[Change] = []
    unchanged = 0
    for layer in dict.fromkeys((*first.layers, *second.layers)):
        pair = _Pair(layer, _of(first, layer), _of(second, layer), min_moved)
        if same_ids:
            pair.match_ids()
        pair.match_places()
        pair.match_renamed()
        if layer != ROOMS:
            pair.match_moved()
        changes = pair.changes + pair.leftovers(knows)
        found += [one for one in changes if names is None or one.names & set(names)]
        unchanged += sum(names is None or name in names for name in pair.unchanged)
    found.sort(key=lambda one: (KINDS.index(one.kind), one.object.name, one.layer))
    return Changes(tuple(found), unchanged)


def are_of_one_map(first: MapObjects, second: MapObjects) -> bool:
    """Return whether most equal ids of two maps mean the same object, not only by chance.

    A map and its continuation have the same id, but so have two maps of one recording that were
    made apart, with other detections, which number their objects anew. An object keeps its name,
    and the moment when it was first seen.
    """
    known = {(layer, item.id): item for item, layer in _with_layers(first)}
    both = [
        (item, known[layer, item.id])
        for item, layer in _with_layers(second)
        if (layer, item.id) in known
    ]
    same = sum(a.name == b.name and a.first_seen == b.first_seen for a, b in both)
    return 2 * same > len(both)


def _check_names(names: Iterable[str], known: set[str]) -> None:
    for name in names:
        if name not in known:
            raise HypermapError(f"no object is called {name!r}; {did_you_mean(name, known)}")


IsKnown = Callable[[BaseGeometry], bool]
"""Whether a map knows what is in a place."""


def knowledge_of(hypermap: Hypermap, base_T_frame: Pose2D) -> IsKnown:
    """Return whether a map has seen the surroundings of an object, by its occupancy layers.

    Args:
        hypermap: the map. If it has no occupancy layer, it knows everything.
        base_T_frame: takes the object's frame to the base frame of the map.
    """
    grids = [
        (layer, hypermap.frames.lookup(layer.frame_id, hypermap.base_frame) @ base_T_frame)
        for layer in hypermap
        if isinstance(layer, OccupancyLayer) and layer.grid is not None
    ]

    def is_known(shape: BaseGeometry) -> bool:
        around = shapely.buffer(shape, _AROUND)
        for layer, layer_T_frame in grids:
            values = layer.values_in(layer_T_frame.apply_geometry(around)).values
            if len(values) and np.mean(values != UNKNOWN) >= _KNOWN:
                return True
        return not grids

    return is_known


def _always(_place: BaseGeometry) -> bool:
    return True


def _of(objects: MapObjects, layer: str) -> list[SemanticObject]:
    return [thing for thing, name in _with_layers(objects) if name == layer]


def _with_layers(objects: MapObjects) -> Iterator[tuple[SemanticObject, str]]:
    return zip(objects.objects, objects.layers, strict=True)


@dataclass(eq=False)
class _Pair:
    """The objects of one layer in two maps; those that are not matched yet are left."""

    layer: str
    before: list[SemanticObject]
    after: list[SemanticObject]
    min_moved: float
    changes: list[Change] = field(default_factory=list)
    unchanged: list[str] = field(default_factory=list)  # their names

    def match_ids(self) -> None:
        """Match objects with equal ids."""
        rows = {thing.id: i for i, thing in enumerate(self.after) if thing.id is not None}
        pairs = [(i, rows[one.id]) for i, one in enumerate(self.before) if one.id in rows]
        for i, j in pairs:
            one, other = self.before[i], self.after[j]
            is_away = distance_between(one, other) >= self.min_moved
            if one.name != other.name:
                self._add(RENAMED, one, other)
            elif is_away and is_said_to_have_moved(one, other):
                self._add(MOVED, one, other, confidence_of_move(one, other))
            elif likeness(one.footprint, other.footprint) < SAME_SHAPE:
                self._add(RESHAPED, one, other)
            elif is_away:
                self._add(MOVED, one, other, 1.0)
            else:
                self.unchanged.append(one.name)
        self._take(pairs)

    def match_places(self) -> None:
        """Match objects of one name that overlap."""
        matches = match_objects(self.after, self.before)
        pairs = []
        for match in matches:
            one, other = self.before[match.ground_truth], self.after[match.estimate]
            distance = distance_between(one, other)
            alike = likeness(one.footprint, other.footprint)
            if match.iou < _SAME_PLACE and distance >= self.min_moved:
                continue  # perhaps another one
            pairs.append((match.ground_truth, match.estimate))
            if alike < SAME_SHAPE and match.iou < _SAME_PLACE:
                self._add(RESHAPED, one, other)
            else:
                self.unchanged.append(one.name)
        self._take(pairs)

    def match_renamed(self) -> None:
        """Match objects in one place whose names differ."""
        iou = iou_matrix(_shapes(self.before), _shapes(self.after))
        pairs = [(i, j) for i, j in _assigned(-iou) if iou[i, j] >= _RENAMED]
        for i, j in pairs:
            self._add(RENAMED, self.before[i], self.after[j])
        self._take(pairs)

    def match_moved(self) -> None:
        """Match objects of one name and shape by the shortest ways between them."""
        pairs = []
        names = {one.name for one in self.before} & {one.name for one in self.after}
        for name in sorted(names):
            rows = [i for i, one in enumerate(self.before) if one.name == name]
            cols = [j for j, one in enumerate(self.after) if one.name == name]
            here, there = [self.before[i] for i in rows], [self.after[j] for j in cols]
            alike = np.array(
                [[likeness(a.footprint, b.footprint) for b in there] for a in here]
            ).reshape(len(rows), len(cols))
            ways = np.linalg.norm(centroids(here)[:, None] - centroids(there), axis=2)
            may_be = (ways < self.min_moved) | ((alike >= MAY_BE) & (ways <= FARTHEST))
            cost = np.where(may_be, ways, 1e6)
            for i, j in _assigned(cost):
                if not may_be[i, j]:
                    continue
                pairs.append((rows[i], cols[j]))
                if ways[i, j] < self.min_moved:
                    self.unchanged.append(name)
                    continue
                # How many others it may be, or may have become.
                rivals = max(alike[i][may_be[i]].sum(), alike[:, j][may_be[:, j]].sum())
                confidence = float(alike[i, j] ** 2 / rivals)
                self._add(MOVED, here[i], there[j], confidence)
        self._take(pairs)

    def leftovers(self, is_known: tuple[IsKnown, IsKnown]) -> list[Change]:
        """Return the objects that only one map has."""
        gone = [
            Change(GONE if is_known[1](one.footprint) else NOT_REVISITED, self.layer, one, None)
            for one in self.before
        ]
        return gone + [
            Change(ADDED if is_known[0](one.footprint) else FIRST_SEEN, self.layer, None, one)
            for one in self.after
        ]

    def _add(
        self,
        kind: str,
        before: SemanticObject,
        after: SemanticObject,
        confidence: float | None = None,
    ) -> None:
        distance = distance_between(before, after)
        self.changes.append(Change(kind, self.layer, before, after, distance, confidence))

    def _take(self, pairs: Iterable[tuple[int, int]]) -> None:
        """Remove matched objects from those that are left."""
        rows, cols = ({pair[side] for pair in pairs} for side in (0, 1))
        self.before = [one for i, one in enumerate(self.before) if i not in rows]
        self.after = [one for j, one in enumerate(self.after) if j not in cols]


def _shapes(objects: Sequence[SemanticObject]) -> list[BaseGeometry]:
    return [thing.footprint for thing in objects]


def _assigned(cost: NDArray[np.float64]) -> list[tuple[int, int]]:
    rows, cols = scipy.optimize.linear_sum_assignment(cost)
    return list(zip(rows.tolist(), cols.tolist(), strict=True))
