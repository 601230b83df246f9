"""Units of measured values, and what one is in another.

Source: BIPM, The International System of Units, 9th ed., 2019.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError


class _Unit(NamedTuple):
    """A value of `scale` times x + `offset` in the base unit of a dimension is x here."""

    dimension: str
    scale: float = 1.0
    offset: float = 0.0


_UNITS = {
    "K": _Unit("temperature"),
    "°C": _Unit("temperature", 1.0, 273.15),
    "°F": _Unit("temperature", 5 / 9, 459.67 * 5 / 9),
    "Pa": _Unit("pressure"),
    "hPa": _Unit("pressure", 1e2),
    "kPa": _Unit("pressure", 1e3),
    "bar": _Unit("pressure", 1e5),
    "T": _Unit("magnetic field"),
    "µT": _Unit("magnetic field", 1e-6),
    "G": _Unit("magnetic field", 1e-4),
    "m": _Unit("length"),
    "cm": _Unit("length", 1e-2),
    "mm": _Unit("length", 1e-3),
    "V": _Unit("voltage"),
    "mV": _Unit("voltage", 1e-3),
    "1": _Unit("ratio"),
    "%": _Unit("ratio", 1e-2),
}
_ALSO = {
    "degC": "°C",
    "celsius": "°C",
    "degF": "°F",
    "fahrenheit": "°F",
    "kelvin": "K",
    "mbar": "hPa",
    "uT": "µT",
    "μT": "µT",  # a Greek letter instead of the micro sign
    "percent": "%",
}


def unit_named(text: str) -> str:
    """Return a unit in the spelling that maps have; one that is not known, as it is.

    >>> unit_named("degC"), unit_named("dBm")
    ('°C', 'dBm')
    """
    return _ALSO.get(text.strip(), text.strip())


def is_signal(unit: str) -> bool:
    """Return whether values in a unit are the strength of a radio signal.

    >>> is_signal("dBm"), is_signal("degC")
    (True, False)
    """
    return unit_named(unit) == "dBm"


def converted(values: NDArray[np.float64], unit: str, wanted: str) -> NDArray[np.float64]:
    """Return values of one unit in another.

    Args:
        values: shape (N,).
        unit: theirs, as "degF".
        wanted: the one that they are to have.

    Raises:
        HypermapError: If the one is not known to be the other times a number.

    >>> converted(np.array([32.0, 212.0]), "degF", "degC").round(6)
    array([  0., 100.])
    """
    old, new = unit_named(unit), unit_named(wanted)
    if old == new:
        return values
    one, other = _UNITS.get(old), _UNITS.get(new)
    if one is None or other is None or one.dimension != other.dimension:
        raise HypermapError(f"values in {old!r} cannot be converted to {new!r}")
    return (values * one.scale + one.offset - other.offset) / other.scale
