"""The part of the map server that shows what a camera has covered of an area that is to be mapped.

Source: INTERFACES, section 9: `automap` of the first program, whose topics keep their names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial

import numpy as np
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.ros.port import Closable, Message, Parameter, Port, Value
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.requests import Requests

LAYER = "mapped_grid"

_AREA_TOPIC, _POLYGON = "/polygon", "geometry_msgs/PolygonStamped"
_WAITING = 100  # polygons in the queue; each of them counts
_THICK = 0.75  # cells from the border's line within which cells are occupied


class AutoMap:
    """Makes the layer `mapped_grid`: the part of an area that was covered, with a border around it.

    It waits for the area on `/polygon`. The layer then has the geometry of the first occupancy
    layer, its cells at the area's border are occupied, and all others unknown. Each polygon on
    `covered_topic` copies the cells of the area that it covers. So a program that drives to
    frontiers of `mapped_grid`, as explore_lite, drives to where the camera has not looked yet. The
    occupancy layer stays as it is.
    """

    PARAMETERS = (
        Parameter(
            "automap",
            False,
            "Whether to wait on /polygon for an area, and to show in mapped_grid what is covered.",
            changes=True,
        ),
        Parameter(
            "covered_topic",
            "/mapping/complete_area_pg",
            "Polygons that were covered; of our semantic_mapper: /semantic_mapper/observed_area.",
        ),
    )

    def __init__(self, port: Port, current: CurrentMap, requests: Requests) -> None:
        self._port = port
        self._current = current
        self._requests = requests
        self._covered_topic = ""
        self._open: tuple[Closable, ...] = ()
        self._inside: BoolArray | None = None  # cells of the area; None while there is none
        self._source = ""  # name of the layer that they are copied from

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters."""
        self._covered_topic = str(values.get("covered_topic", self._covered_topic))
        if "automap" in values:
            if values["automap"]:
                self._port.log("info", self.start())
            else:
                self.close()

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Forget the area if another map has come."""
        if changed is None and LAYER not in hypermap:
            self._inside = None

    def close(self) -> None:
        """Listen no more; the layer stays."""
        opened, self._open = self._open, ()
        for each in opened:
            each.close()
        self._inside = None

    def start(self) -> str:
        """Wait for an area, if that is not done yet; return how far it is, in words."""
        if not self._open:
            self._open = (
                self._port.subscribe(_AREA_TOPIC, _POLYGON, self._choose),
                self._port.subscribe(self._covered_topic, _POLYGON, self._cover, queue=_WAITING),
            )
        layer = next((each for each in self._current.hypermap if each.name == LAYER), None)
        inside = self._inside
        if inside is None or not isinstance(layer, OccupancyLayer) or layer.cells is None:
            return f"automap: waiting on {_AREA_TOPIC} for the area to map"
        share = np.mean(layer.cells[inside] != UNKNOWN)
        return f"automap: {share:.0%} of the area is mapped"

    def _choose(self, message: Message) -> None:
        """Begin with an area."""
        try:
            area = self._requests.area(self._current.hypermap, message)
            self._current.put(partial(self._begun, area))
        except HypermapError as error:
            self._port.log("warning", f"{_AREA_TOPIC}: {error}; the area is ignored")
            return
        self._port.log("info", f"automap: {area.area:.1f} m2 are to be mapped")

    def _begun(self, area: BaseGeometry, hypermap: Hypermap) -> OccupancyLayer:
        """Return the layer in which nothing is covered yet."""
        source = _first_grid(hypermap)
        grid = source.grid
        assert grid is not None  # it has cells
        local = hypermap.frames.lookup(source.frame_id, hypermap.base_frame).apply_geometry(area)
        border = grid.cells_in(local.boundary.buffer(_THICK * grid.resolution))
        inside = np.zeros(grid.shape, dtype=bool)
        inside[grid.cells_in(local)] = True
        inside[border] = False
        if not inside.any():
            raise HypermapError(f"the area covers no cell of layer {source.name!r}")
        cells = np.full(grid.shape, UNKNOWN, dtype=np.int8)
        cells[border] = OCCUPIED
        self._inside, self._source = inside, source.name
        return OccupancyLayer(LAYER, source.frame_id, grid, cells)

    def _cover(self, message: Message) -> None:
        """Copy what a polygon covers of the area."""
        inside = self._inside
        if inside is None:
            return
        try:
            area = self._requests.area(self._current.hypermap, message)
            self._current.change(LAYER, partial(self._covered, area, inside))
        except HypermapError as error:
            self._port.log("warning", f"{self._covered_topic}: {error}; the polygon is ignored")

    def _covered(
        self, area: BaseGeometry, inside: BoolArray, hypermap: Hypermap, layer: Layer
    ) -> Layer:
        source = hypermap.occupancy(self._source)
        if not isinstance(layer, OccupancyLayer) or layer.grid is None or layer.cells is None:
            return layer
        local = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame).apply_geometry(area)
        rows, cols = layer.grid.cells_in(local)
        if layer.cells.shape == inside.shape:
            rows, cols = rows[inside[rows, cols]], cols[inside[rows, cols]]
        cells = layer.cells.copy()
        # By place, as a map that another node makes may have grown meanwhile.
        cells[rows, cols] = source.value_at(layer.grid.centers(rows, cols))
        return OccupancyLayer(layer.name, layer.frame_id, layer.grid, cells, layer.settings)


def _first_grid(hypermap: Hypermap) -> OccupancyLayer:
    """Return the first occupancy layer that holds something.

    Raises:
        HypermapError: If there is none, or the name of ours is taken.
    """
    if LAYER in hypermap and not isinstance(hypermap[LAYER], OccupancyLayer):
        raise HypermapError(f"layer {LAYER!r} is no occupancy layer; rename it")
    for layer in hypermap:
        if isinstance(layer, OccupancyLayer) and layer.name != LAYER and layer.cells is not None:
            return layer
    raise HypermapError("the map has no occupancy layer yet")
