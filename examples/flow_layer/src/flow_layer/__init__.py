"""A layer that says in each cell of a grid which way people mostly walk."""

from flow_layer.files import PLUGIN
from flow_layer.layer import FlowLayer

__all__ = ["PLUGIN", "FlowLayer"]
