from __future__ import annotations

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.values import converted
from hypermap.values.units import unit_named


@pytest.mark.parametrize(
    ("value", "unit", "wanted", "expected"),
    [
        (100, "°C", "degF", 212),
        (-40, "degF", "degC", -40),
        (0, "K", "celsius", -273.15),
        (1013.25, "hPa", "Pa", 101325),
        (4.8e-5, "T", "uT", 48),
        (0.45, "1", "%", 45),
        (-71, "dBm", "dBm", -71),  # of units that are not known, nothing is changed
    ],
)
def test_values_are_converted(value, unit, wanted, expected):
    assert converted(np.array([float(value)]), unit, wanted)[0] == pytest.approx(expected)


@pytest.mark.parametrize(("unit", "wanted"), [("°C", "Pa"), ("dBm", "°C"), ("", "K")])
def test_what_cannot_be_converted_is_refused(unit, wanted):
    with pytest.raises(HypermapError, match=f"values in {unit!r} cannot be converted to"):
        converted(np.array([1.0]), unit, wanted)


def test_a_unit_has_one_spelling_in_maps():
    assert {unit_named(text) for text in ("degC", "celsius", " °C ")} == {"°C"}
    assert unit_named("uT") == unit_named("μT") == "µT"
