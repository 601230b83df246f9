"""The part of the map server that shows what a camera has covered of an area that is to be mapped.

Source: INTERFACES, section 9: `automap` of the first program, whose topics keep their names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.exploration.coverage import LAYER, AreaToMap, Coverage
from hypermap.ros.port import Closable, Message, Parameter, Port, Value
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.requests import Requests
from hypermap.ros.topic_names import named_by_user

_AREA_TOPIC, _POLYGON = "/polygon", "geometry_msgs/PolygonStamped"
_WAITING = 100  # polygons in the queue; each of them counts


class AutoMap:
    """Makes the layer `mapped_grid`: the part of an area that was covered, with a border around it.

    It waits for the area on `/polygon`, or for `begin`. Each polygon on `covered_topic` copies the
    cells of the area that it covers. So a program that drives to frontiers of `mapped_grid`, as
    explore_lite, drives to where the camera has not looked yet. The occupancy layer is unchanged.
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
        self._area: AreaToMap | None = None  # None while there is none

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters."""
        named = str(values.get("covered_topic", self._covered_topic))
        self._covered_topic = named_by_user(named, self._port.node_name)
        if "automap" in values:
            if values["automap"]:
                self._port.log("info", self.start())
            else:
                self.close()

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Forget the area if another map has come."""
        if changed is None and LAYER not in hypermap:
            self._area = None

    def close(self) -> None:
        """Listen no more; the layer stays."""
        opened, self._open = self._open, ()
        for each in opened:
            each.close()
        self._area = None

    def start(self) -> str:
        """Wait for an area, if that is not done yet; return how far it is, in words."""
        self._listen()
        coverage = self.coverage()
        if coverage is None:
            return f"automap: waiting on {_AREA_TOPIC} for the area to map"
        return f"automap: {coverage.share:.0%} of the area is mapped"

    def begin(self, area: BaseGeometry) -> None:
        """Begin with an area of the base frame, and listen to what is covered.

        Raises:
            HypermapError: If the map has no occupancy layer, or no cell of it is in the area.
        """
        self._current.put(lambda hypermap: self._begun(hypermap, area))
        self._listen()
        self._port.log("info", f"automap: {area.area:.1f} m2 are to be mapped")

    def coverage(self) -> Coverage | None:
        """Return what is covered by now; None while there is no area."""
        area = self._area
        return None if area is None else area.coverage(self._current.hypermap)

    def _listen(self) -> None:
        if not self._open:
            self._open = (
                self._port.subscribe(_AREA_TOPIC, _POLYGON, self._choose),
                self._port.subscribe(self._covered_topic, _POLYGON, self._cover, queue=_WAITING),
            )

    def _choose(self, message: Message) -> None:
        """Begin with an area."""
        try:
            self.begin(self._requests.area(self._current.hypermap, message))
        except HypermapError as error:
            self._port.log("warning", f"{_AREA_TOPIC}: {error}; the area is ignored")

    def _begun(self, hypermap: Hypermap, area: BaseGeometry) -> OccupancyLayer:
        self._area, layer = AreaToMap.begun(hypermap, area)
        return layer

    def _cover(self, message: Message) -> None:
        """Copy what a polygon covers of the area."""
        chosen = self._area
        if chosen is None:
            return
        try:
            seen = self._requests.area(self._current.hypermap, message)

            def covered(hypermap: Hypermap, layer: Layer) -> Layer:
                return chosen.covered(seen, hypermap, layer)

            self._current.change(LAYER, covered)
        except HypermapError as error:
            self._port.log("warning", f"{self._covered_topic}: {error}; the polygon is ignored")
