"""Shapes in what mapping keeps: collections within collections would end the process in GEOS."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from hypermap.formats.array_file import unpacked_shapes
from hypermap.mapping.by_hand import from_record

NESTED = struct.pack("<BII", 1, 7, 1) * 200_000 + struct.pack("<BII", 1, 7, 0)


def test_shapes_of_tracks_are_no_nested_collections() -> None:
    arrays = {
        "shape.wkb": np.frombuffer(NESTED, np.uint8),
        "shape.lengths": np.array([len(NESTED)]),
        "shape.points": np.empty((2, 0)),
    }
    with pytest.raises(ValueError, match="must be a polygon or multipolygon"):
        unpacked_shapes("shape", arrays)


def test_shapes_drawn_by_hand_are_no_nested_collections() -> None:
    with pytest.raises(ValueError, match="must be a polygon or multipolygon"):
        from_record({"words": ["reshaped"], "shape": NESTED.hex()})
