"""Observations on their way to a store as JSON, as a spool keeps them."""

from __future__ import annotations

import base64
import json
import uuid
import zlib
from typing import Any

import numpy as np

from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.semantic import SemanticLayer
from hypermap.fleet.store.observed import Observed
from hypermap.fleet.store.seen_cells import ChangedCells
from hypermap.formats.semantic.evidence_file import dump_evidence, parse_evidence
from hypermap.formats.semantic.geojson import from_geojson, to_geojson
from hypermap.mapping.stages import OccupancyConfig

_WRONG = (
    *(ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError),
    zlib.error,
)


def dump_observed(observed: Observed) -> str:
    """Return observations as JSON; evidence and cells are base64 within it."""
    layer = SemanticLayer(observed.layer, "map", observed.objects)
    evidence = observed.evidence
    content = None if evidence is None else base64.b64encode(dump_evidence(evidence)).decode()
    return json.dumps(
        {
            "id": str(observed.id),
            "site": observed.site,
            "source": observed.source,
            "objects": to_geojson(layer),
            "removed": [int(number) for number in observed.removed],
            "evidence": content,
            "cells": None if observed.cells is None else _dump_cells(observed.cells),
        }
    )


def parse_observed(content: bytes) -> Observed:
    """Return the observations that `dump_observed` made into JSON.

    Raises:
        FormatError: If it is damaged.
    """
    try:
        kept = json.loads(content)
        layer = from_geojson(kept["objects"])
        evidence = kept["evidence"]
        if evidence is not None:
            evidence = parse_evidence(base64.b64decode(evidence), "evidence")
        cells = kept.get("cells")  # entries of earlier programs have none
        return Observed(
            str(kept["site"]),
            layer.name,
            str(kept["source"]),
            layer.objects(),
            [int(number) for number in kept["removed"]],
            evidence,
            None if cells is None else _parse_cells(cells),
            uuid.UUID(kept["id"]),
        )
    except (*_WRONG, FormatError) as error:
        raise FormatError(f"is damaged: {error}") from None


def _dump_cells(seen: ChangedCells) -> dict[str, Any]:
    grid = seen.grid
    return {
        "layer": seen.layer,
        "frame": seen.frame_id,
        "shape": grid.shape,
        "resolution": grid.resolution,
        "origin": [grid.origin.x, grid.origin.y, grid.origin.yaw],
        "content": base64.b64encode(zlib.compress(seen.cells.tobytes(), 1)).decode(),
    }


def _parse_cells(kept: Any) -> ChangedCells:
    height, width = kept["shape"]
    grid = GridGeometry(width, height, kept["resolution"], Pose2D(*kept["origin"]))
    if height * width > OccupancyConfig().max_cells:
        raise ValueError(f"{width} x {height} cells are too many")
    content = zlib.decompressobj().decompress(base64.b64decode(kept["content"]), height * width)
    cells = np.frombuffer(content, np.int8).reshape(height, width)
    return ChangedCells(str(kept["layer"]), str(kept["frame"]), grid, cells)
