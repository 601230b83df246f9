"""The hypermap: ordered layers, their frames, and queries across them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, ObjectArray, PointsLike, as_point_xy
from hypermap.core.errors import HypermapError
from hypermap.core.found import Found, FoundObject
from hypermap.core.frames import FrameTree
from hypermap.core.history import History
from hypermap.core.layer import Hits, Layer, check_count
from hypermap.core.layer_stack import ROOMS, LayerStack
from hypermap.core.outside import OutsideMethods
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import as_area
from hypermap.core.store import Matches, Placed, PlacedLayer, PlacedLayers

__all__ = ["ROOMS", "Found", "FoundObject", "Hypermap", "Matches"]


class Hypermap(LayerStack, OutsideMethods):
    """A map: ordered layers in a tree of frames, and queries across them.

    A query may use any frame of the map, by `frame_id`; None is the base frame. Answers are always
    in the base frame, which is the frame of the first layer.

    Attributes:
        frames: the transforms between the frames of the layers.
        metadata: saved with the map, such as the configuration that made it.
        mapper_state: what mapping needs to continue the map, in a form that only it understands:
            bytes, or a function that makes them; None for a map that mapping cannot continue.
        history: the changes so far; None for a map without a history.

    Raises:
        HypermapError: If two layers have the same name.
    """

    def __init__(
        self,
        layers: Iterable[Layer] = (),
        frames: FrameTree | None = None,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(layers, frames)
        self.metadata: dict[str, Any] = dict(metadata or {})
        self.mapper_state: bytes | Callable[[], bytes] | None = None
        self.history: History | None = None

    def __copy__(self) -> Hypermap:
        return self.with_layers(self._layers.values())

    def __getstate__(self) -> dict[str, Any]:
        kept = self.mapper_state  # a function may not travel to another process
        return vars(self) | {"mapper_state": kept() if callable(kept) else kept}

    def __repr__(self) -> str:
        rows = [(layer.name, type(layer).__name__, self._summary(layer)) for layer in self]
        width, kind_width = (max((len(row[i]) for row in rows), default=0) for i in (0, 1))
        lines = [f"  {name:{width}}  {kind:{kind_width}}  {held}" for name, kind, held in rows]
        number = f"{len(rows)} layer{'' if len(rows) == 1 else 's'}"
        title = f"<Hypermap in frame {self.base_frame!r}: {number}>"
        return "\n".join([title, *(line.rstrip() for line in lines)])

    def _summary(self, layer: Layer) -> str:
        frame = "" if layer.frame_id == self.base_frame else f"in frame {layer.frame_id!r}"
        return ", ".join(filter(None, (layer.summary(), frame)))

    def with_layer(self, layer: Layer) -> Hypermap:
        """Return a map in which a layer replaces the one with the same name.

        Raises:
            LayerNotFound: If there is none of that name.
        """
        old = self[layer.name]
        return self.with_layers(layer if place is old else place for place in self._layers.values())

    def with_layers(self, layers: Iterable[Layer]) -> Hypermap:
        """Return a map with other layers, and otherwise the contents of this one.

        Raises:
            HypermapError: If two layers have the same name.
        """
        other = Hypermap(layers, self.frames, self.metadata)
        other.mapper_state = self.mapper_state
        other.history = self.history
        return other

    # Queries to one layer

    def label_at(
        self, layer: str, points_xy: PointsLike, frame_id: str | None = None
    ) -> ObjectArray:
        """Return a layer's label at each point, shape (N,).

        Raises:
            LayerNotFound, FrameError: If the layer or the frame is unknown.
        """
        asked = self[layer]
        return asked.label_at(self._points(points_xy, asked, frame_id))

    def value_at(
        self, layer: str, points_xy: PointsLike, frame_id: str | None = None
    ) -> NDArray[Any]:
        """Return a layer's value at each point, shape (N,); raises like `label_at`."""
        asked = self[layer]
        return asked.value_at(self._points(points_xy, asked, frame_id))

    def labels_in(self, layer: str, area: BaseGeometry, frame_id: str | None = None) -> Hits:
        """Return every hit of a layer in an area, as labels; raises like `label_at`."""
        asked = self[layer]
        return self._in_base_frame(asked, asked.labels_in(self._area(area, asked, frame_id)))

    def values_in(self, layer: str, area: BaseGeometry, frame_id: str | None = None) -> Hits:
        """Return every hit of a layer in an area, as values; raises like `label_at`."""
        asked = self[layer]
        return self._in_base_frame(asked, asked.values_in(self._area(area, asked, frame_id)))

    def find(
        self,
        layer: str,
        what: str | float,
        area: BaseGeometry | None = None,
        frame_id: str | None = None,
    ) -> NDArray[np.float64]:
        """Return where a label or value occurs in a layer, or in an area of it, shape (M, 2).

        Raises:
            LayerNotFound, FrameError: If the layer or the area's frame is unknown.
        """
        asked = self[layer]
        in_layer = None if area is None else self._area(area, asked, frame_id)
        return self._pose_of(asked).apply(asked.find(what, in_layer))

    def labels_at(
        self, layer: str, point_xy: PointsLike, frame_id: str | None = None
    ) -> ObjectArray:
        """Return all labels of a layer at one point, shape (M,); raises like `label_at`.

        The first is the label of `label_at`: the smallest of stacked objects.
        """
        asked = self[layer]
        return asked.labels_at(self._points(point_xy, asked, frame_id))

    # Queries across layers

    def objects_at(
        self, point_xy: PointsLike, layer: str | None = None, frame_id: str | None = None
    ) -> list[FoundObject]:
        """Return all objects at a point, layer by layer, smallest first.

        Args:
            point_xy: in the frame `frame_id` [m].
            layer: only in this layer; None for all semantic layers connected to the base frame.
            frame_id: frame of the point; None for the base frame.

        Raises:
            LayerNotFound, FrameError: If the layer or the frame is unknown.
            HypermapError: If the layer cannot have objects.
        """
        asked = self._lookup(self.base_frame, frame_id).apply(as_point_xy(point_xy))[0]
        return [found for place in self._with_objects(layer) for found in place.at(asked)]

    def nearest(
        self,
        what: str | float,
        point_xy: PointsLike,
        k: int = 1,
        layer: str | None = None,
        frame_id: str | None = None,
        by: str = "air",
    ) -> list[Found]:
        """Return the k nearest occurrences of a label or value, nearest first.

        The distance to an object is the distance to its shape, 0 inside. By path, it is the length
        of the shortest path of a point over free cells to where the object is in sight and at most
        a meter away, and from there to its shape; objects that no path reaches are left out.
        `hypermap.paths.Planner` does the same for a robot with a radius.

        Args:
            what: what to look for, as in `find`.
            point_xy: from where, in the frame `frame_id` [m].
            k: how many at most.
            layer: only in this layer; None for all semantic layers connected to the base frame.
            frame_id: frame of the point; None for the base frame.
            by: "air" or "path".

        Raises:
            LayerNotFound, FrameError: If the layer or the frame is unknown.
            HypermapError: By path, if the layer cannot have objects, the map does not have exactly
                one occupancy layer, or the point is in a wall.
            ValueError: If `k` is below 1, or `by` is neither.
        """
        check_count(k)
        asked = self._lookup(self.base_frame, frame_id).apply(as_point_xy(point_xy))[0]
        if by == "path":
            return self.nearest_by_path(what, asked, k, layer)
        if by != "air":
            raise ValueError(f"by must be 'air' or 'path', got {by!r}")
        found: list[Found] = []
        only = None if layer is None else self[layer]
        if only is None or isinstance(only, SemanticLayer):
            for place in self._with_objects(layer):
                found += place.nearest(what, asked, k)
        else:
            base_T_layer = self._pose_of(only)
            locations, distances = only.nearest(what, base_T_layer.inverse().apply(asked), k)
            for point, distance in zip(base_T_layer.apply(locations), distances, strict=True):
                found.append(Found(only.name, point, float(distance)))
        return sorted(found, key=lambda hit: hit.distance or 0.0)[:k]

    def objects(
        self,
        name: str | Iterable[str] | None = None,
        *,
        near: str | BaseGeometry | PointsLike | None = None,
        within: float | None = None,
        inside: str | BaseGeometry | None = None,
        area: BaseGeometry | None = None,
        tags: str | Iterable[str] = (),
        layer: str | None = None,
        limit: int | None = None,
        frame_id: str | None = None,
    ) -> list[FoundObject]:
        """Return the objects of semantic layers that meet all conditions.

        Args:
            name: their name, or several names, any of which matches; None for any.
            near: a name, a geometry or a point to measure the distance to; for a name, the
                distance to the nearest other object with it.
            within: the largest distance between the shapes [m]; None for any.
            inside: a name or a geometry that contains their centroid; a name means any other
                object with it, or a room of that kind, such as "kitchen". What is in a room may
                be in its wall.
            area: an area that their shape intersects.
            tags: a tag that each object has, or several, all of which it has.
            layer: only objects of this layer; None for all semantic layers connected to the base
                frame. Objects named by `near` and `inside` may be in any.
            limit: return at most this many; None for all.
            frame_id: frame of the geometries and the point; None for the base frame.

        Returns:
            With `near`, sorted by distance, ties by the distance of the centroid; otherwise
            in the order of the layers.

        Raises:
            LayerNotFound, FrameError: If the layer or the frame is unknown.
            HypermapError: If the layer cannot have objects.
            ValueError: If `within` is given without `near`, or is negative, or `limit` is below 1.

        >>> import shapely
        >>> from hypermap.core.semantic import SemanticObject
        >>> sink = SemanticObject("sink", shapely.box(0, 0, 1, 1))
        >>> chairs = [SemanticObject("chair", shapely.box(x, 0, x + 1, 1)) for x in (2, 5)]
        >>> hypermap = Hypermap([SemanticLayer("semantic", "map", [sink, *chairs])])
        >>> [found.distance for found in hypermap.objects("chair", near="sink", within=2)]
        [1.0]
        """
        if limit is not None and limit < 1:
            raise ValueError(f"limit must be at least 1, got {limit}")
        asked: dict[str, Any] = {"near": near, "within": within, "inside": inside, "area": area}
        matches = self.matching(name, **asked, tags=tags, layer=layer, frame_id=frame_id)
        return matches.first(limit)

    def matching(
        self,
        name: str | Iterable[str] | None = None,
        *,
        near: str | BaseGeometry | PointsLike | None = None,
        within: float | None = None,
        inside: str | BaseGeometry | None = None,
        area: BaseGeometry | None = None,
        tags: str | Iterable[str] = (),
        layer: str | None = None,
        frame_id: str | None = None,
    ) -> Matches:
        """Find the same as `objects` without creating the objects, which is slow for many.

        Takes the same arguments except `limit`, and raises the same errors.
        """
        if within is not None and near is None:
            raise ValueError("within needs near: a distance from what?")
        if within is not None and not within >= 0:
            raise ValueError(f"within must not be negative, got {within}")
        farthest = np.inf if within is None else within
        has_anchors = isinstance(near, str) or isinstance(inside, str)
        layers = PlacedLayers(self._with_objects(layer, and_others=has_anchors))
        asked = None
        if area is not None:
            asked = self._lookup(self.base_frame, frame_id).apply_geometry(as_area(area))
        names = [name] if isinstance(name, str) else None if name is None else list(name)
        chosen = layers.named(names, layer, asked)
        if wanted := {tags} if isinstance(tags, str) else set(tags):
            chosen = chosen.take(layers.have_tags(chosen.keys, wanted))
        if inside is not None:
            chosen = chosen.take(self._are_inside(layers, chosen, inside, frame_id))
        if near is None:
            return Matches(layers, chosen)
        others = self._anchors(layers, near, frame_id)
        distances = chosen.distances_to(others, farthest)
        to_centroids = chosen.centroid_distances_to(others)
        order = np.lexsort((to_centroids, distances))
        order = order[np.isfinite(distances[order])]
        return Matches(layers, chosen.take(order), distances[order])

    def _with_objects(
        self, layer: str | None = None, *, and_others: bool = False
    ) -> list[PlacedLayer]:
        """Return the semantic layers that are connected to the base frame.

        Args:
            layer: only this one, which must be such a layer; None for all.
            and_others: return all even if `layer` is given.
        """
        only = None if layer is None else self[layer]
        if only is not None:
            if not isinstance(only, SemanticLayer):
                kind = type(only).__name__
                raise HypermapError(
                    f"layer {only.name!r} is of the kind {kind}, which has no objects"
                )
            place = self._placed(only)
            if not and_others:
                return [place]
        layers = (each for each in self.placed_layers() if isinstance(each, SemanticLayer))
        return [self._placed(each) for each in layers]

    def _placed(self, layer: SemanticLayer) -> PlacedLayer:
        return PlacedLayer(layer.name, layer.snapshot, self._pose_of(layer))

    def _are_inside(
        self,
        layers: PlacedLayers,
        chosen: Placed,
        inside: str | BaseGeometry,
        frame_id: str | None,
    ) -> BoolArray:
        """Return which objects are inside a geometry, or inside objects or rooms of a name."""
        is_inside = chosen.are_inside(self._anchors(layers, inside, frame_id))
        if isinstance(inside, str) and ROOMS in self:
            in_rooms = self.stand_in_rooms(inside, chosen.centroids)
            if in_rooms is not None:
                is_inside = (is_inside | in_rooms) & ~layers.are_of(ROOMS, chosen.keys)
        return is_inside

    def _anchors(
        self, layers: PlacedLayers, what: str | BaseGeometry | PointsLike, frame_id: str | None
    ) -> Placed:
        """Return what `near` or `inside` refers to: objects of a name, a geometry or a point."""
        base_T_asked = self._lookup(self.base_frame, frame_id)
        if isinstance(what, str):
            return layers.named([what])
        shape = as_area(what) if isinstance(what, BaseGeometry) else Point(as_point_xy(what))
        return Placed.geometry(base_T_asked.apply_geometry(shape))
