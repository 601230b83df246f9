"""The objects of a layer, written from their columns as ROS 1 sends them."""

from __future__ import annotations

import struct

import numpy as np

from hypermap.core.objects import ObjectTable
from hypermap.ros.messages.geometry_messages import outlines
from hypermap.ros.ros1.arrays import WrittenList, text, texts

_HEAD = struct.Struct("<iI")
_COUNT = struct.Struct("<I")
_POINT32, _POINT = 12, 24  # bytes


def written_objects(table: ObjectTable) -> WrittenList:
    """Return the rows of a table as the list of `hypermap_msgs/SemanticObject` that they make."""
    points_xy, starts = outlines(table.footprints)
    rings = np.zeros((len(points_xy), 3), dtype="<f4")
    rings[:, :2] = points_xy
    positions = np.zeros((len(table), 3), dtype="<f8")
    positions[:, :2] = table.centroids
    ring_bytes, position_bytes = rings.tobytes(), positions.tobytes()
    names = {name: text(name) for name in table.vocabulary}
    written: list[bytes] = []
    columns = zip(
        table.ids.tolist(),
        starts[:-1].tolist(),
        starts[1:].tolist(),
        table.names.tolist(),
        table.tags,
        table.confidence,
        strict=True,
    )
    for row, (number, start, end, name, tags, confidence) in enumerate(columns):
        written += (
            _HEAD.pack(number, end - start),
            ring_bytes[_POINT32 * start : _POINT32 * end],
            position_bytes[_POINT * row : _POINT * (row + 1)],
            names[name],
            _COUNT.pack(len(tags)),
            texts(map(str, tags)),
            _COUNT.pack(len(confidence)),
            struct.pack(f"<{len(confidence)}d", *confidence),
        )
    return WrittenList(len(table), b"".join(written))
