"""A layer that holds a number with a unit in each cell of a grid: temperature, noise, WiFi."""

from value_layer.files import PLUGIN
from value_layer.layer import ValueLayer

__all__ = ["PLUGIN", "ValueLayer"]
