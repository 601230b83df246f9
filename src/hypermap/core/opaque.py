"""A layer whose plug-in is not installed: its files are kept unchanged."""

# ruff: noqa: ARG002  # every query raises, whatever its arguments

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn

import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, PointsLike
from hypermap.core.errors import HypermapError
from hypermap.core.layer import Hits, Layer


class OpaqueLayer(Layer):
    """The files of a layer of an unknown kind; every query raises an error.

    Attributes:
        files: content by name, written back byte for byte.
        load_file: whether the configuration says to load them.
    """

    def __init__(
        self,
        class_name: str,
        name: str,
        frame_id: str,
        files: Mapping[str, bytes] | None = None,
        load_file: bool = True,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.class_name = class_name  # type: ignore[misc]  # only here, it differs by layer
        self.files = dict(files or {})
        self.load_file = load_file

    def summary(self) -> str:
        """Return the name of the unknown class."""
        return f"of class {self.class_name!r}, whose plug-in is not installed"

    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Raise HypermapError."""
        self._refuse()

    def value_at(self, points_xy: PointsLike) -> NDArray[Any]:
        """Raise HypermapError."""
        self._refuse()

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Raise HypermapError."""
        self._refuse()

    def values_in(self, area: BaseGeometry) -> Hits:
        """Raise HypermapError."""
        self._refuse()

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[Any]:
        """Raise HypermapError."""
        self._refuse()

    def extent(self) -> BaseGeometry:
        """Return an empty area, since the content is unknown."""
        return shapely.Polygon()

    def _refuse(self) -> NoReturn:
        raise HypermapError(
            f"layer {self.name!r} cannot be queried: no plug-in for its class "
            f"{self.class_name!r} is installed"
        )
