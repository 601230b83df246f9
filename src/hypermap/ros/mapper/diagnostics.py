"""What a node reports on `/diagnostics`."""

from __future__ import annotations

import math

from hypermap.ros.mapper.statistics import Fate, Report
from hypermap.ros.messages.diagnostics import TYPE, status_array
from hypermap.ros.messages.geometry_messages import Message, Types

__all__ = ["TYPE", "diagnostic_array"]


def diagnostic_array(
    report: Report, objects: int, node_name: str, types: Types, stamp: int
) -> Message:
    """Return a `diagnostic_msgs/DiagnosticArray` of one status.

    Args:
        report: how the node fares.
        objects: how many objects are in its map.
        node_name: who reports, as "/semantic_mapper".
        types: makes messages and their stamps.
        stamp: time of the report [ns].
    """
    return status_array(
        report.state.value,
        f"{node_name}: mapping",
        report.message,
        _values(report, objects),
        types,
        stamp,
    )


def _values(report: Report, objects: int) -> list[tuple[str, str]]:
    median, late = report.latency
    return [
        ("objects in the map", str(objects)),
        ("frames per second", f"{report.frame_rate:.1f}"),
        ("mapped per second", f"{report.map_rate:.1f}"),
        ("latency, median [ms]", _milliseconds(median)),
        ("latency, 95 % [ms]", _milliseconds(late)),
        ("dropped [%]", f"{100 * report.dropped:.0f}"),
        *((f"frames: {fate.value}", str(report.totals.get(fate, 0))) for fate in Fate),
    ]


def _milliseconds(seconds: float) -> str:
    return "none" if math.isnan(seconds) else f"{1000 * seconds:.0f}"
