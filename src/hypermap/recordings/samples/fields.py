"""The number in a message: what each kind of sensor measures, or any field by its path."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hypermap.core.errors import HypermapError, did_you_mean

_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_PATH = re.compile(r"[A-Za-z]\w*(\[\d+\])*(\.[A-Za-z]\w*(\[\d+\])*)*")


@dataclass(frozen=True)
class Reading:
    """How to get a number out of the messages of a topic.

    Attributes:
        read: returns it; NaN where a message has none.
        unit: of the number; empty where the kind of message does not say.
        quantity: what it is, likewise.
    """

    read: Callable[[Any], float]
    unit: str = ""
    quantity: str = ""


def reading_of(kind: str, field: str | None) -> Reading:
    """Return how to read a topic.

    Args:
        kind: type of its messages, as `sensor_msgs/msg/Temperature`.
        field: path of the number, as `signal.rssi` or `ranges[3]`; of diagnostics the key, or the
            name of the status and the key, as `wifi/rssi`. None for what the kind measures.

    Raises:
        HypermapError: If the kind has no number of its own and no field was named.
    """
    if kind == _DIAGNOSTICS:
        if field is None:
            raise HypermapError("for diagnostics, name the key of the value with --field")
        return Reading(lambda message: _diagnostic(message, field), quantity=field)
    known = _KNOWN.get(kind)
    if field is not None:
        of_field = known if known is not None and field == known.quantity else None
        return of_field or Reading(_at_path(field), quantity=field)
    if known is not None:
        return known
    if kind.startswith("std_msgs/msg/") and re.search(r"/U?(Int|Float)\d+$", kind):
        return Reading(_at_path("data"))
    raise HypermapError(
        f"a {kind} has no single number; name the field that has it with --field, such as "
        "rssi or signal.level or values[0]"
    )


def _field(name: str, unit: str) -> Reading:
    return Reading(_at_path(name), unit, name)


def _norm(message: Any) -> float:
    field = message.magnetic_field
    return math.hypot(field.x, field.y, field.z)


def _percent(message: Any) -> float:
    return 100.0 * float(message.relative_humidity)


def _range(message: Any) -> float:
    """Return a distance; none where nothing was in range (REP 117)."""
    distance = float(message.range)
    return distance if message.min_range <= distance <= message.max_range else math.nan


def _at_path(path: str) -> Callable[[Any], float]:
    """Return what reads the number at a path of fields.

    Raises:
        HypermapError: If it is not a path, or a message has no such field, or no number there.
    """
    if not _PATH.fullmatch(path):
        raise HypermapError(f"--field {path!r}: a path is like signal.rssi or values[0]")
    steps = [int(step) if step.isdigit() else step for step in re.findall(r"\w+", path)]

    def read(message: Any) -> float:
        value = message
        for step in steps:
            value = _element(value, step, path)
            if value is None:
                return math.nan
        if not isinstance(value, bool | int | float | np.number):
            parts = ", ".join(_names(value))
            raise HypermapError(f"--field {path!r}: is not a number{parts and '; it has '}{parts}")
        return float(value)

    return read


def _element(value: Any, step: str | int, path: str) -> Any:
    """Return a field of a message or an element of a list; None where the list is shorter."""
    if isinstance(step, str):
        known = _names(value)
        if step not in known:
            hint = did_you_mean(step, known)
            raise HypermapError(f"--field {path!r}: there is no {step!r}; {hint}")
        return getattr(value, step)
    if isinstance(value, str) or not hasattr(value, "__len__"):
        raise HypermapError(f"--field {path!r}: there is no list that has element {step}")
    return value[step] if step < len(value) else None


def _names(value: Any) -> list[str]:
    """Return the fields of a message: of rosbags', of ROS 2's or of ROS 1's class."""
    if hasattr(value, "get_fields_and_field_types"):
        return list(value.get_fields_and_field_types())
    slots = getattr(value, "__slots__", ())
    fields = getattr(value, "__dataclass_fields__", slots)
    return [name for name in fields if not name.startswith("_")]


def _diagnostic(message: Any, key: str) -> float:
    """Return the first value of a key that is a number; diagnostics are text."""
    for status in message.status:
        for pair in status.values:
            if key in (pair.key, f"{status.name}/{pair.key}"):
                number = re.match(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", pair.value)
                return float(number[0]) if number else math.nan
    return math.nan


_KNOWN = {
    "sensor_msgs/msg/Temperature": _field("temperature", "°C"),
    "sensor_msgs/msg/RelativeHumidity": Reading(_percent, "%", "relative_humidity"),
    "sensor_msgs/msg/Illuminance": _field("illuminance", "lx"),
    "sensor_msgs/msg/FluidPressure": _field("fluid_pressure", "Pa"),
    "sensor_msgs/msg/BatteryState": _field("voltage", "V"),
    "sensor_msgs/msg/MagneticField": Reading(_norm, "T", "magnetic_field"),
    "sensor_msgs/msg/Range": Reading(_range, "m", "range"),
}
