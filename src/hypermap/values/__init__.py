"""Measured values: estimate a quantity all over the floor from samples, with regard to walls."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.core.samples import Samples
    from hypermap.values.interpolation import Interpolation, interpolate
    from hypermap.values.layers import value_layer_of
    from hypermap.values.live_field import LiveField
    from hypermap.values.methods import METHODS, Method
    from hypermap.values.questions import (
        nearest_where,
        summaries_of,
        summary_in,
        value_layer_called,
        where,
    )
    from hypermap.values.random_field import FieldSettings
    from hypermap.values.units import converted

_HOMES = {
    "LiveField": "hypermap.values.live_field",
    "METHODS": "hypermap.values.methods",
    "FieldSettings": "hypermap.values.random_field",
    "Interpolation": "hypermap.values.interpolation",
    "Method": "hypermap.values.methods",
    "Samples": "hypermap.core.samples",
    "converted": "hypermap.values.units",
    "interpolate": "hypermap.values.interpolation",
    "nearest_where": "hypermap.values.questions",
    "summaries_of": "hypermap.values.questions",
    "summary_in": "hypermap.values.questions",
    "value_layer_called": "hypermap.values.questions",
    "value_layer_of": "hypermap.values.layers",
    "where": "hypermap.values.questions",
}

__all__ = [
    "METHODS",
    "FieldSettings",
    "Interpolation",
    "LiveField",
    "Method",
    "Samples",
    "converted",
    "interpolate",
    "nearest_where",
    "summaries_of",
    "summary_in",
    "value_layer_called",
    "value_layer_of",
    "where",
]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
