"""Semantic objects as input of costmaps: masks for nav2's filters and move_base's static layers."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.ros.messages.to_messages import occupancy_grid
from hypermap.ros.port import Parameter, Port, Publisher, Value
from hypermap.ros.server.zones import Filter, draw, entries_of, keepout_filter, speed_filter


class CostmapMasks:
    """Publishes `keepout_mask` and `speed_mask` (`nav_msgs/OccupancyGrid`, latched).

    Where there is `nav2_msgs`, `keepout_filter_info` and `speed_filter_info`
    (`nav2_msgs/CostmapFilterInfo`, latched) say how nav2 is to read them. A mask is drawn again
    when objects or parameters change, and published when that changed a cell.

    A mask that cannot be drawn is an error in the log; the last one stays.
    """

    PARAMETERS = (
        Parameter(
            "keepout",
            (),
            "Classes to keep out of, each with a margin [m] around its objects, as 'desk 0.2'.",
            changes=True,
        ),
        Parameter(
            "speed",
            (),
            "Classes to drive slowly near, each with a margin [m] and a limit in percent of the "
            "maximum or in m/s, as 'plant 0.5 50%' or 'plant 0.5 0.3m/s'.",
            changes=True,
        ),
        Parameter(
            "mask_resolution",
            0.0,
            "Cell size [m] of masks with a grid of their own around the zones; 0 for the grid of "
            "the first occupancy layer.",
            minimum=0.0,
            maximum=1e3,
            changes=True,
        ),
    )

    def __init__(self, port: Port) -> None:
        self._port = port
        self._lock = threading.Lock()
        self._filters: dict[str, Filter] = {}
        self._resolution: float | None = None
        self._hypermap: Hypermap | None = None
        self._shown: dict[str, _Shown] = {}

    def set(self, values: Mapping[str, Value]) -> None:
        """Take over parameters, all or those that changed, and draw the masks again.

        Raises:
            HypermapError: If one is wrong; nothing is changed then.
        """
        filters = {
            name: read(entries_of(values[name]))
            for name, read in (("keepout", keepout_filter), ("speed", speed_filter))
            if name in values
        }
        with self._lock:
            self._filters.update(filters)
            if "mask_resolution" in values:
                self._resolution = float(values["mask_resolution"]) or None  # type: ignore[arg-type]
            self._draw()

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:  # noqa: ARG002
        """Draw the masks of a map; any of its layers may hold the objects or the grid."""
        with self._lock:
            self._hypermap = hypermap
            self._draw()

    def close(self) -> None:
        """End the topics."""
        with self._lock:
            for shown in self._shown.values():
                shown.close()
            self._shown.clear()
            self._hypermap = None

    def _draw(self) -> None:
        if self._hypermap is None:
            return
        for name, wanted in self._filters.items():
            # A mask that has lost its last zone is published once more, without marks.
            if not wanted.zones and name not in self._shown:
                continue
            try:
                mask = draw(self._hypermap, wanted, self._resolution)
            except (HypermapError, ValueError) as error:
                self._port.log("error", f"{name}_mask: {error}; the last mask stays")
                continue
            if name not in self._shown:
                self._shown[name] = _Shown(self._port, name)
            self._shown[name].publish(mask, wanted)


class _Shown:
    """The topics of one mask, and what was last published on them."""

    def __init__(self, port: Port, name: str) -> None:
        self._port = port
        self._topic = f"{name}_mask"
        self._mask: OccupancyLayer | None = None
        self._info: tuple[int, float] | None = None
        self._masks = port.publisher(self._topic, "nav_msgs/OccupancyGrid", latched=True)
        self._infos: Publisher | None = None
        try:
            self._infos = port.publisher(
                f"{name}_filter_info", "nav2_msgs/CostmapFilterInfo", latched=True
            )
        except HypermapError:
            port.log("info", f"{self._topic}: no nav2_msgs here, so no CostmapFilterInfo for it")

    def publish(self, mask: OccupancyLayer, wanted: Filter) -> None:
        """Publish a mask, and how to read it, where they differ from what was published."""
        stamp = self._port.now()
        if not _same(mask, self._mask):
            self._masks.publish(occupancy_grid(mask, self._port, stamp))
            self._mask = mask
        if self._infos is not None and self._info != (wanted.type, wanted.multiplier):
            info = self._port.message("nav2_msgs/CostmapFilterInfo")()
            info.header.frame_id = mask.frame_id
            info.header.stamp = self._port.stamp(stamp)
            info.type = wanted.type
            info.filter_mask_topic = f"{self._port.node_name}/{self._topic}"
            info.base = wanted.base
            info.multiplier = wanted.multiplier
            self._infos.publish(info)
            self._info = wanted.type, wanted.multiplier

    def close(self) -> None:
        """End the topics."""
        self._masks.close()
        if self._infos is not None:
            self._infos.close()


def _same(mask: OccupancyLayer, other: OccupancyLayer | None) -> bool:
    return (
        other is not None
        and mask.frame_id == other.frame_id
        and mask.grid == other.grid
        and np.array_equal(np.asarray(mask.cells), np.asarray(other.cells))
    )
