"""Measured values: from samples at places to a quantity all over the floor, which knows walls."""

from hypermap.core.samples import Samples
from hypermap.values.interpolation import METHODS, Interpolation, Method, interpolate
from hypermap.values.random_field import FieldSettings

__all__ = ["METHODS", "FieldSettings", "Interpolation", "Method", "Samples", "interpolate"]
