"""Measured values from recordings and tables, each with the place where it was measured."""

from hypermap.recordings.samples.bag import message_count, motion_in_bag, read_bag
from hypermap.recordings.samples.measured import Measured, reasons
from hypermap.recordings.samples.source import ValueSource
from hypermap.recordings.samples.table import read_table

__all__ = [
    "Measured",
    "ValueSource",
    "message_count",
    "motion_in_bag",
    "read_bag",
    "read_table",
    "reasons",
]
