"""Keepout zones and speed limits as an operator writes them in a parameter."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.masks import MAX_MARGIN, Zone, draw_mask
from hypermap.core.occupancy import OccupancyLayer
from hypermap.ros.port import Value

KEEPOUT, SPEED_IN_PERCENT, SPEED_IN_METRES = 0, 1, 2
"""Types of nav2's costmap filters, as in nav2_msgs/CostmapFilterInfo."""

_NUMBER = r"(\d+\.?\d*|\.\d+)"
_KEEPOUT = re.compile(rf"\s*(.*\S)\s+{_NUMBER}\s*")
_SPEED = re.compile(rf"\s*(.*\S)\s+{_NUMBER}\s+{_NUMBER}\s*(%|m/s)\s*")
_LARGEST = 100  # value of a cell
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Filter:
    """What a costmap filter of nav2 needs besides its mask.

    A cell of value v stands for `base + multiplier * v`, in the unit that the type names.

    Attributes:
        name: "keepout" or "speed".
        type: as in nav2_msgs/CostmapFilterInfo.
        zones: what to mark.
        outside: value of all other cells.
        multiplier: what one step of a cell's value stands for.
        base: what a value of 0 stands for.
    """

    name: str
    type: int
    zones: tuple[Zone, ...]
    outside: int
    multiplier: float = 1.0
    base: float = 0.0


def draw(hypermap: Hypermap, wanted: Filter, resolution: float | None = None) -> OccupancyLayer:
    """Return a filter's mask, as it is published and as it is saved.

    Args:
        hypermap: of whose objects.
        wanted: which zones.
        resolution: side of a cell [m]; None for the grid of the first occupancy layer.

    Raises:
        HypermapError, ValueError: As `draw_mask`.
    """
    return draw_mask(
        hypermap,
        wanted.zones,
        outside=wanted.outside,
        resolution=resolution,
        name=f"{wanted.name}_mask",
    )


def entries_of(value: Value) -> tuple[object, ...]:
    """Return the entries in the value of a parameter, which may be a single one."""
    return (value,) if isinstance(value, (str, bool, int, float)) else tuple(value)


def keepout_filter(entries: Iterable[object]) -> Filter:
    """Return the filter for entries like "potted plant 0.3": a class and its margin [m].

    Cells of zones are 100, which costmaps take as lethal. All others are -1, not 0, which would
    turn a costmap's unknown cells into free ones.

    Raises:
        HypermapError: If an entry is none; it names the entry.

    >>> keepout_filter(["potted plant 0.3"]).zones
    (Zone(name='potted plant', margin=0.3, value=100),)
    """
    zones = []
    for entry in entries:
        match = _KEEPOUT.fullmatch(entry) if isinstance(entry, str) else None
        if match is None:
            raise HypermapError(
                f"keepout: {entry!r} is not a zone; expected a class and a margin in meters, "
                "as 'desk 0.2'"
            )
        name, margin = match.groups()
        zones.append(Zone(name, _margin("keepout", entry, margin)))
    return Filter("keepout", KEEPOUT, tuple(zones), outside=-1)


def speed_filter(entries: Iterable[object]) -> Filter:
    """Return the filter for entries like "plant 0.5 50%": a class, its margin [m] and a limit.

    Limits are in percent of the robot's maximum speed, or all in m/s: "plant 0.5 0.3m/s". They
    are rounded down to what a cell can hold. Where zones overlap, the lowest limit counts.

    Raises:
        HypermapError: If an entry is none, or has another unit than the first; it names the entry.

    >>> limits = speed_filter(["plant 0.5 0.3m/s", "desk 0 0.6 m/s"])
    >>> [(zone.name, round(zone.value * limits.multiplier, 3)) for zone in limits.zones]
    [('desk', 0.6), ('plant', 0.3)]
    """
    found: list[tuple[float, str, float]] = []
    first_unit = ""
    for entry in entries:
        match = _SPEED.fullmatch(entry) if isinstance(entry, str) else None
        if match is None:
            raise HypermapError(
                f"speed: {entry!r} is not a zone; expected a class, a margin in meters and a "
                "limit, as 'plant 0.5 50%' or 'plant 0.5 0.3m/s'"
            )
        name, margin, limit, unit = match.groups()
        first_unit = first_unit or unit
        if unit != first_unit:
            raise HypermapError(
                f"speed: {entry!r} has its limit in {unit}, others have it in {first_unit}; "
                "all limits of one mask must have the same unit"
            )
        if float(limit) <= 0 or (unit == "%" and float(limit) > 100):
            allowed = "above 0 and at most 100 %" if unit == "%" else "above 0 m/s"
            raise HypermapError(f"speed: {entry!r}: a limit must be {allowed}")
        found.append((float(limit), name, _margin("speed", entry, margin)))
    found.sort(key=lambda zone: -zone[0])  # the lowest last, which counts
    in_metres = first_unit == "m/s"
    multiplier = found[0][0] / _LARGEST if in_metres else 1.0
    zones = [
        Zone(name, margin, max(1, int(limit / multiplier + _ROUNDING)))
        for limit, name, margin in found
    ]
    kind = SPEED_IN_METRES if in_metres else SPEED_IN_PERCENT
    return Filter("speed", kind, tuple(zones), outside=0, multiplier=multiplier)


def _margin(what: str, entry: object, text: str) -> float:
    """Return an entry's margin [m]; raise a HypermapError if it is too large."""
    margin = float(text)
    if margin > MAX_MARGIN:
        raise HypermapError(f"{what}: {entry!r}: a margin must be at most {MAX_MARGIN:g} m")
    return margin
