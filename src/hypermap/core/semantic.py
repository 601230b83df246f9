"""The semantic layer: objects with names and shapes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from shapely.geometry.base import BaseGeometry

from hypermap.core.layer import Layer


@dataclass(frozen=True, eq=False)
class SemanticObject:
    """One object of a semantic layer, as a value.

    Attributes:
        name: its class, as "cup".
        footprint: shapely Polygon or MultiPolygon on the floor, in the layer's frame [m].
        id: stable identifier, not negative; None lets the layer choose the next free one.
        tags: other names for it, most likely first.
        confidence: one number per tag.
        existence: evidence that it is there (the log-odds of the mapping half), if known.
        first_seen: stamp [s], if known.
        last_seen: stamp [s], if known.
        attributes: free, of what YAML can hold.
    """

    name: str
    footprint: BaseGeometry
    id: int | None = None
    tags: tuple[str, ...] = ()
    confidence: tuple[float, ...] = ()
    existence: float | None = None
    first_seen: float | None = None
    last_seen: float | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Rejected:
    """An entry of a layer's file that could not be read; it is written back as it was.

    Attributes:
        position: its place in the file, from 0, which is the id that it would have had.
        name: its name, if it has one.
        reason: what is wrong with it.
        entry: the entry itself, as parsed.
    """

    position: int
    name: str
    reason: str
    entry: Any


class SemanticLayer(Layer):
    """Objects with names and shapes, kept as columns.

    Attributes:
        rejected: entries of the layer's file that could not be read.
    """

    class_name: ClassVar[str] = "SemanticLayer"

    def __init__(
        self,
        name: str,
        frame_id: str,
        objects: Iterable[SemanticObject] = (),
        settings: Mapping[str, Any] | None = None,
        rejected: Iterable[Rejected] = (),
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.rejected = tuple(rejected)
