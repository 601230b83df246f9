"""Paths of the page: the shortest way between two places, for a robot of a radius."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from hypermap.console.paths import Planned, document
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.paths import PathSettings, Planner
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.requests import number_in, point_in
from hypermap.viewer.live.snippets import snippets_for_path


class Paths:
    """Answers about paths; what a map and a robot take to prepare is kept for the next question."""

    def __init__(self) -> None:
        self._planner: tuple[Hypermap, float, Planner] | None = None
        self._lock = threading.Lock()

    def answer(self, hypermap: Hypermap, path: str, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return what the page shows of a path, and the code that asks the same.

        Args:
            hypermap: the map.
            path: its file.
            values: `from` and `to`, as X,Y in the base frame; `radius` of the robot [m].

        Raises:
            Refused: If the request is wrong.
            HypermapError: If no path leads there.
        """
        start, goal = point_in(values, "from"), point_in(values, "to")
        radius = number_in(values, "radius") if "radius" in values else 0.0
        if radius < 0:
            raise Refused(f"radius: must not be negative, got {radius:g} m")
        planner = self._planner_for(hypermap, radius)
        planned = document(Planned(planner.path(start, goal)), hypermap.base_frame)
        del planned["approach"]
        return {**planned, **snippets_for_path(path, start, goal, radius)}

    def _planner_for(self, hypermap: Hypermap, radius: float) -> Planner:
        with self._lock:
            if self._planner is None or not (
                self._planner[0] is hypermap and self._planner[1] == radius
            ):
                # Of several grids, the first one.
                names = [layer.name for layer in hypermap if isinstance(layer, OccupancyLayer)]
                settings = PathSettings(radius)
                planner = Planner(hypermap, settings, occupancy=names[0] if names else None)
                self._planner = hypermap, radius, planner
            return self._planner[2]
